"""The few surfaces that everything else is built from."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray
from trimesh.visual import TextureVisuals

from miplight.validate import as_count, as_number, as_numbers, as_vector, fail

__all__ = ["box", "grid_faces", "lathe", "merge", "mesh", "quad", "tube"]


def mesh(vertices: ArrayLike, faces: ArrayLike, uv: ArrayLike | None = None) -> trimesh.Trimesh:
    """Make a trimesh mesh of exactly these vertices and faces."""
    made = trimesh.Trimesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int64), process=False)
    if uv is not None:
        made.visual = TextureVisuals(uv=np.asarray(uv, np.float64))
    return made


def grid_faces(rows: int, columns: int, wrap: bool = False) -> NDArray[np.int64]:
    """Triangulate rows × columns vertices, row by row; with `wrap` the last column meets the first."""
    across = columns if wrap else columns - 1
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(across), indexing="ij")
    right = (column + 1) % columns
    a, b = row * columns + column, row * columns + right
    c, d = a + columns, b + columns
    return np.stack([a, b, d, a, d, c], axis=-1).reshape(-1, 3).astype(np.int64)


def quad(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, columns: int = 1, rows: int = 1
) -> trimesh.Trimesh:
    """Parallelogram corner + a·edge_u + b·edge_v with UV (a, b); its normal is along cross(edge_u, edge_v).

    Parameters
    ----------
    corner, edge_u, edge_v : array_like, (3,)
    columns, rows : int, default 1
        Divisions along edge_u and edge_v: 2 · columns · rows triangles.
    """
    origin, u, v = as_vector(corner, "corner"), as_vector(edge_u, "edge_u"), as_vector(edge_v, "edge_v")
    columns, rows = as_count(columns, "columns"), as_count(rows, "rows")
    b, a = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    uv = np.stack([a, b], axis=-1).reshape(-1, 2)
    return mesh(origin + uv[:, :1] * u + uv[:, 1:] * v, grid_faces(rows + 1, columns + 1), uv)


def box(extents: ArrayLike = (1.0, 1.0, 1.0), center: ArrayLike = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    """Closed box of 12 triangles, with outward normals, UVs on each face and split corners.

    Parameters
    ----------
    extents : array_like, (3,), default (1, 1, 1)
        Edge lengths along x, y, z.
    center : array_like, (3,), default (0, 0, 0)
    """
    size, middle = as_vector(extents, "extents"), as_vector(center, "center")
    vertices, faces, uv = _unit_box()
    return mesh(vertices * size + middle, faces, uv)


@functools.cache
def _unit_box() -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    sides = []
    for normal in np.eye(3):
        u, v = np.roll(normal, 1), np.roll(normal, 2)
        for sign in (1.0, -1.0):
            first, second = (u, v) if sign > 0 else (v, u)
            sides.append(quad((sign * normal - u - v) / 2, first, second))
    whole = merge(sides)
    return np.array(whole.vertices), np.array(whole.faces), np.array(whole.visual.uv)


def merge(meshes: Iterable[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Join meshes into one, vertex for vertex; UVs are kept if all of them have some."""
    parts = list(meshes)
    if not parts:
        fail("meshes", parts, "one mesh or more")
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.vstack([part.faces + offset for part, offset in zip(parts, offsets, strict=False)])
    uvs = [getattr(part.visual, "uv", None) for part in parts]
    known = [u for u in uvs if u is not None]
    uv = np.vstack(known) if len(known) == len(parts) else None
    return mesh(np.vstack([part.vertices for part in parts]), faces, uv)


def lathe(
    profile: Sequence[Sequence[float]] | NDArray[np.float64],
    segments: int = 32,
    flutes: int = 0,
    flute_depth: float = 0.0,
) -> trimesh.Trimesh:
    """Surface of revolution about the y axis.

    Parameters
    ----------
    profile : (N, 2)
        (radius, height) from one end to the other; upwards gives outward normals. A point given twice in a
        row is a hard edge. The ends stay open unless their radius is 0.
    segments : int, default 32
        Columns of quads around the axis.
    flutes : int, default 0
        Grooves around the axis, between narrow fillets, as on an Ionic column.
    flute_depth : float, default 0
        Depth of the grooves as a fraction of the radius, in [0, 1).
    """
    points = as_numbers(profile, "profile", "numbers of shape (N, 2), N > 1").astype(np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
        fail("profile", points, "numbers of shape (N, 2), N > 1")
    segments, flutes = as_count(segments, "segments", at_least=3), as_count(flutes, "flutes", at_least=0)
    depth = as_number(flute_depth, "flute_depth", at_least=0.0, below=1.0)
    angle = np.arange(segments) * (2 * np.pi / segments)
    radial = 1.0 - depth * _groove(angle * flutes / (2 * np.pi))
    ring = np.stack([np.sin(angle) * radial, np.cos(angle) * radial], axis=-1)
    creases = np.flatnonzero((points[1:] == points[:-1]).all(axis=1)) + 1
    strips = [_strip(run, ring) for run in np.split(points, creases) if len(run) > 1]
    if not strips:
        fail("profile", points, "two different points or more")
    return merge(strips)


def _groove(turn: NDArray[Any]) -> NDArray[np.float64]:
    """Depth of a flute, 0 to 1, where `turn` counts flutes: a half circle over 3/4 of it, then a fillet."""
    across = np.clip((turn % 1.0) / 0.75, 0.0, 1.0) * 2.0 - 1.0
    return np.sqrt(np.clip(1.0 - across * across, 0.0, 1.0))


def _strip(run: NDArray[np.float64], ring: NDArray[np.float64]) -> trimesh.Trimesh:
    x, z = run[:, :1] * ring[:, 0], run[:, :1] * ring[:, 1]
    y = np.broadcast_to(run[:, 1:], x.shape)
    faces = grid_faces(len(run), len(ring), wrap=True)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    # a ring of radius 0 is a point: of its quads only one triangle has an area
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return mesh(vertices, faces[area > 1e-12 * area.max()])


def tube(path: ArrayLike, radius: float, sides: int = 8) -> trimesh.Trimesh:
    """Round wire of constant radius along a polyline, open at its ends.

    Parameters
    ----------
    path : array_like, (N, 3), N > 1
        Points in order; neighbours differ.
    radius : float
    sides : int, default 8
        2 · sides · (N − 1) triangles.
    """
    points = as_numbers(path, "path", "numbers of shape (N, 3), N > 1").astype(np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
        fail("path", points, "numbers of shape (N, 3), N > 1")
    radius, sides = as_number(radius, "radius", above=0.0), as_count(sides, "sides", at_least=3)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.empty_like(tangent)
    side = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for k, along in enumerate(tangent):  # carried along the path, so that the tube does not twist
        side = side - along * (side @ along)
        side = normal[k] = side / np.linalg.norm(side)
    binormal = np.cross(tangent, normal)
    angle = np.arange(sides) * (2 * np.pi / sides)
    around = np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * binormal[:, None]
    return mesh((points[:, None] + radius * around).reshape(-1, 3), grid_faces(len(points), sides, wrap=True))
