"""Things that are thin: what makes shadows hard to sample and rays slip through."""

from __future__ import annotations

import numpy as np
import trimesh

from miplight.validate import as_count, as_number

from .primitives import box, grid_faces, merge, mesh, tube

__all__ = ["crossing_ribbon", "fence", "slats", "wires"]


def fence(
    width: float = 4.0, height: float = 1.2, pickets: int = 24, thickness: float = 0.02
) -> trimesh.Trimesh:
    """Picket fence in the plane z = 0, standing on y = 0, centred on x = 0.

    Parameters
    ----------
    width, height : float
    pickets : int, default 24
        Upright slats; as wide as the gaps between them.
    thickness : float, default 0.02
        Of slats and of the two rails behind them.
    """
    width, height = as_number(width, "width", above=0.0), as_number(height, "height", above=0.0)
    pickets, depth = as_count(pickets, "pickets"), as_number(thickness, "thickness", above=0.0)
    pitch = width / pickets
    upright = [
        box((pitch / 2, height, depth), ((k + 0.5) * pitch - width / 2, height / 2, 0.0))
        for k in range(pickets)
    ]
    rails = [box((width, height * 0.08, depth), (0.0, height * part, -1.001 * depth)) for part in (0.2, 0.8)]
    return merge(upright + rails)


def wires(
    count: int = 12, length: float = 4.0, radius: float = 0.004, spacing: float = 0.1, sag: float = 0.3
) -> trimesh.Trimesh:
    """Sagging wires along x, side by side along z, hung at y = 0.

    Parameters
    ----------
    count : int, default 12
    length, spacing : float
        Along x, and between neighbours along z.
    radius : float, default 0.004
    sag : float, default 0.3
        How far their middles hang below y = 0.
    """
    count, length = as_count(count, "count"), as_number(length, "length", above=0.0)
    drop, spacing = as_number(sag, "sag", at_least=0.0), as_number(spacing, "spacing", above=0.0)
    x = np.linspace(-1.0, 1.0, 41)
    hang = np.stack([x * length / 2, -drop * (1.0 - x * x), np.zeros_like(x)], axis=-1)
    shift = (np.arange(count) - (count - 1) / 2) * spacing
    return merge([tube(hang + np.array([0.0, 0.0, z]), radius, sides=6) for z in shift])


def slats(
    count: int = 20, width: float = 2.0, depth: float = 0.08, spacing: float = 0.07, tilt: float = 35.0
) -> trimesh.Trimesh:
    """Venetian blind: curved slats without thickness along x, stacked from y = 0 up, about the y axis.

    Parameters
    ----------
    count : int, default 20
    width, depth, spacing : float
        Of a slat along x and across, and between slats along y.
    tilt : float, default 35.0
        Degrees about the x axis; 0 is level.
    """
    count, width = as_count(count, "count"), as_number(width, "width", above=0.0)
    depth, spacing = as_number(depth, "depth", above=0.0), as_number(spacing, "spacing", above=0.0)
    angle = np.radians(as_number(tilt, "tilt"))
    across, along = np.meshgrid(np.linspace(-0.5, 0.5, 7), np.linspace(-0.5, 0.5, 5), indexing="ij")
    bulge = depth * 0.12 * (1.0 - 4.0 * across**2)
    y = across * depth * np.sin(angle) + bulge * np.cos(angle)
    z = across * depth * np.cos(angle) - bulge * np.sin(angle)
    one = np.stack([along * width, y, z], axis=-1).reshape(-1, 3)
    parts = [mesh(one + np.array([0.0, k * spacing, 0.0]), grid_faces(7, 5)) for k in range(count)]
    return merge(parts)


def crossing_ribbon(size: float = 2.0, width: float = 0.5, segments: int = 400) -> trimesh.Trimesh:
    """Closed band without thickness along a figure of eight: it twists and passes through itself.

    Parameters
    ----------
    size : float, default 2.0
        Extent along x.
    width : float, default 0.5
        Of the band.
    segments : int, default 400
        Along the band: 8 · segments triangles.
    """
    size, width = as_number(size, "size", above=0.0), as_number(width, "width", above=0.0)
    segments = as_count(segments, "segments", at_least=8)
    t = np.arange(segments) * (2 * np.pi / segments)
    centre = np.stack([np.sin(t), 0.1 * np.sin(3 * t), np.sin(t) * np.cos(t)], axis=-1) * (size / 2)
    tilt = 0.9 * np.sin(t)  # about the direction of travel
    heading = np.stack([np.cos(t), np.zeros_like(t), np.cos(2 * t)], axis=-1)
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    side = np.stack([-heading[:, 2], np.zeros_like(t), heading[:, 0]], axis=-1)
    across = np.sin(tilt)[:, None] * side + np.cos(tilt)[:, None] * (0.0, 1.0, 0.0)
    offset = np.linspace(-0.5, 0.5, 5)[:, None, None] * width
    return mesh((centre + offset * across).reshape(-1, 3), grid_faces(5, segments, wrap=True))
