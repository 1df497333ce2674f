"""A colonnade with arches: half a million triangles, columns that share their geometry, long shadows."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from miplight.validate import as_count

from .primitives import box, grid_faces, lathe, merge, mesh, quad
from .rooms import Place, light_row, place_at

__all__ = ["arch", "colonnade", "column"]

COLUMNS = 8  # in each of the two rows
BAY = 2.7  # between the axes of neighbours, m
AISLE = 2.3  # from the middle to the axes of a row
HEIGHT = 4.2  # of a column, plinth to abacus
WALL = 0.56  # thickness of the wall that the arches carry
TOP = 6.3  # of that wall
LENGTH = COLUMNS * BAY


def colonnade(triangles: int = 500_000) -> trimesh.Scene:
    """Nave of two rows of fluted columns, arches, cornice, pergola beams, tiled floor, steps and urns.

    Parameters
    ----------
    triangles : int, default 500,000
        Counted over all instances; 80,000 or more, met within 2 %. The columns take what the rest leaves.

    Returns
    -------
    trimesh.Scene
        ``column_0`` … ``column_15`` share one geometry, as do arches, beams and urns. Y is up, metres; the
        floor is at y = 0, the nave runs along z. ``metadata["view"]`` looks down the nave;
        ``metadata["lights"]`` are a low sun and a wide sky.
    """
    budget = as_count(triangles, "triangles", at_least=80_000)
    fine = budget >= 200_000
    place = Place()
    _add_ground(place)
    _add_walls(place, arch(48 if fine else 16))
    urn = _urn(28 if fine else 12)
    spots = [(side * AISLE, k) for side in (-1, 1) for k in range(COLUMNS)]
    middles = [place_at(x, 0, (k - (COLUMNS - 1) / 2) * BAY, 180.0 * (x > 0)) for x, k in spots]
    urns = [place_at(side * (AISLE + 1.35), 0, z * BAY, 40.0 * z) for side in (-1, 1) for z in (-2, 0, 2)]
    place.add("urn", urn, (0.62, 0.32, 0.2), urns)
    rest = sum(
        len(place.scene.geometry[place.scene.graph[node][1]].faces)
        for node in place.scene.graph.nodes_geometry
    )
    place.add("column", column((budget - rest) // len(middles)), (0.78, 0.74, 0.66), middles)
    sun = light_row((9.0, 8.5, 1.0), (0.0, 0.0, 2.6), (-1.5, 2.1, 0.0), (190.0, 160.0, 115.0))
    sky = light_row((-9.0, 15.0, -14.0), (18.0, 0.0, 0.0), (0.0, 0.0, 28.0), (0.55, 0.7, 1.0))
    view = {"origin": (-0.75, 1.65, 11.6), "target": (0.25, 2.25, 0.0), "fov_y": 55.0}
    return place.finish(view, [sun, sky])


def column(triangles: int = 20_000) -> trimesh.Trimesh:
    """One column of about that many triangles: plinth, base, fluted shaft with entasis, capital."""
    segments = next(n for n in (160, 120, 80, 60, 40) if n == 40 or triangles > 2 * n * 40)
    radius = 0.30
    base = _profile([(0.44, 0.14), (0.44, 0.28)], bulge=0.06, rows=6)
    base += _profile([(0.36, 0.30), (0.36, 0.38)], bulge=-0.035, rows=6)
    base += _profile([(0.38, 0.40), (0.38, 0.48)], bulge=0.035, rows=6)
    foot, head = 0.50, HEIGHT - 0.52
    capital = [
        (0.265, head),
        (0.29, head + 0.02),
        (0.29, head + 0.05),
        (0.265, head + 0.07),
        (0.265, head + 0.16),
    ]
    capital += [
        (0.265 + 0.17 * np.sin(a), head + 0.16 + 0.20 * (1 - np.cos(a))) for a in np.linspace(0, 1.5, 9)
    ]
    turned = [lathe(base, segments), lathe(capital, segments)]
    blocks = [box((0.94, 0.14, 0.94), (0, 0.07, 0)), box((0.92, 0.14, 0.92), (0, HEIGHT - 0.07, 0))]
    left = triangles - sum(len(part.faces) for part in turned + blocks)
    rows = max(4, round(left / (2 * segments)))
    up = np.linspace(0.0, 1.0, rows + 1)
    swell = radius * (1.0 - 0.15 * up**2.2)  # entasis: nearly straight below, drawn in above
    shaft = lathe(
        np.stack([swell, foot + up * (head - foot)], axis=-1), segments, flutes=20, flute_depth=0.09
    )
    return merge([*turned, shaft, *blocks])


def _profile(ends: list[tuple[float, float]], bulge: float, rows: int) -> list[tuple[float, float]]:
    """Half-round moulding between two points, outwards for a positive bulge; both ends are hard edges."""
    (r0, y0), (r1, y1) = ends
    turn = np.linspace(0.0, np.pi, rows + 1)
    part = (1.0 - np.cos(turn)) / 2
    curve = [
        (float(r0 + (r1 - r0) * t + bulge * np.sin(a)), float(y0 + (y1 - y0) * t))
        for t, a in zip(part, turn, strict=True)
    ]
    return [curve[0], *curve, curve[-1]]


def arch(segments: int = 48) -> trimesh.Trimesh:
    """One bay of the wall above the columns, along z, with a round opening and an archivolt."""
    inner, thick, spring, top = (BAY - 0.72) / 2, WALL, HEIGHT, TOP
    turn = np.linspace(0.0, np.pi, segments + 1)
    circle = np.stack([-np.cos(turn) * inner, spring + np.sin(turn) * inner], axis=-1)
    # the wall's outline seen from the arch's centre, so that each face is one strip from opening to outline
    outline = np.stack([np.linspace(-BAY / 2, BAY / 2, segments + 1), np.full(segments + 1, top)], axis=-1)
    outline[0], outline[-1] = (-BAY / 2, spring), (BAY / 2, spring)
    outline[1], outline[-2] = (-BAY / 2, top), (BAY / 2, top)
    parts = []
    for x in (thick / 2, -thick / 2):
        face = _strip_between(circle, outline, x, x)
        parts.append(face if x < 0 else _flipped(face))
    parts.append(_strip_between(circle, circle, thick / 2, -thick / 2))
    for sign in (1.0, -1.0):
        # three stepped bands around the opening, each a little further out of the wall
        for k in range(3):
            near, far = inner + 0.10 * k, inner + 0.10 * (k + 1)
            out = sign * (thick / 2 + 0.06 - 0.018 * k)
            rings = [circle_at(turn, near, spring), circle_at(turn, far, spring)]
            band = _strip_between(rings[0], rings[1], out, out)
            edge = _strip_between(rings[1], rings[1], out, sign * thick / 2)
            parts += [_flipped(band), edge] if sign > 0 else [band, _flipped(edge)]
        lip = _strip_between(circle, circle, sign * thick / 2, sign * (thick / 2 + 0.06))
        parts.append(_flipped(lip) if sign > 0 else lip)
    return merge(parts)


def circle_at(turn: NDArray[np.float64], radius: float, spring: float) -> NDArray[np.float64]:
    """Points of a half circle above the springing line, (N, 2): along the wall, and up."""
    return np.stack([-np.cos(turn) * radius, spring + np.sin(turn) * radius], axis=-1)


def _strip_between(
    first: NDArray[np.float64], second: NDArray[np.float64], x_first: float, x_second: float
) -> trimesh.Trimesh:
    """Quads between two polylines in planes of constant x."""
    count = len(first)
    rows = [
        np.stack([np.full(count, x), line[:, 1], line[:, 0]], axis=-1)
        for line, x in ((first, x_first), (second, x_second))
    ]
    return mesh(np.vstack(rows), grid_faces(2, count))


def _flipped(part: trimesh.Trimesh) -> trimesh.Trimesh:
    return mesh(part.vertices, part.faces[:, ::-1])


def _add_walls(place: Place, bay: trimesh.Trimesh) -> None:
    """Arches, cornice with dentils, beams across, and the wall that closes the nave."""
    stone, wood = (0.74, 0.68, 0.58), (0.38, 0.24, 0.14)
    bays = [
        place_at(side * AISLE, 0, (k + 0.5 - (COLUMNS - 1) / 2) * BAY)
        for side in (-1, 1)
        for k in range(-1, COLUMNS)
    ]
    place.add("arch", bay, stone, bays)
    span = LENGTH + BAY
    pieces = []
    for side in (-1, 1):
        for k, (wide, high) in enumerate(((0.70, 0.12), (0.86, 0.10), (1.0, 0.12))):
            level = TOP + 0.06 + 0.11 * k
            pieces.append(box((wide, high, span), (side * AISLE, level, 0)))
        teeth = np.arange(-span / 2 + 0.1, span / 2, 0.2)
        for edge in (-0.40, 0.40):
            pieces += [box((0.10, 0.12, 0.11), (side * AISLE + edge, TOP - 0.06, z)) for z in teeth]
    place.add("cornice", merge(pieces), stone)
    beams = [place_at(0, TOP + 0.48, z) for z in np.arange(-span / 2 + 0.45, span / 2, BAY / 3)]
    place.add("beam", box((2 * AISLE + 1.6, 0.22, 0.16)), wood, beams)
    red, far = (0.55, 0.30, 0.18), LENGTH / 2 + 2.2
    place.add("end", quad((-10, -0.6, -far), (20.0, 0, 0), (0, 9.0, 0)), red)
    place.add("west", quad((-10, -0.6, 18), (0, 0, -18 - far), (0, 7.0, 0)), (0.66, 0.5, 0.32))
    place.add("east", quad((10, -0.6, -far), (0, 0, 18 + far), (0, 7.0, 0)), (0.66, 0.5, 0.32))


def _add_ground(place: Place) -> None:
    """Floor of bevelled tiles in two colours, three steps around it, and the ground."""
    half_x, half_z, tile = 4, 17, 0.7
    light: list[trimesh.Trimesh] = []
    dark: list[trimesh.Trimesh] = []
    for i in range(-half_x, half_x + 1):
        for k in range(-half_z, half_z + 1):
            (light if (i + k) % 2 else dark).append(_tile(i * tile, k * tile, tile))
    place.add("tiles_light", merge(light), (0.72, 0.68, 0.60))
    place.add("tiles_dark", merge(dark), (0.30, 0.20, 0.17))
    steps = []
    for k in range(3):
        wide, long = 2 * (3.6 + 0.35 * k), 2 * (half_z + 0.5) * tile + 0.9 + 0.7 * k
        steps.append(box((wide, 0.18, long), (0, -0.1 - 0.18 * k, 0)))
    place.add("steps", merge(steps), (0.66, 0.62, 0.55))
    place.add("ground", quad((-40, -0.55, 40), (80, 0, 0), (0, 0, -80)), (0.42, 0.36, 0.24))


def _tile(x: float, z: float, size: float, bevel: float = 0.012) -> trimesh.Trimesh:
    """Tile with its top at y = 0 and sloping edges, 10 triangles."""
    outer, inner = size / 2, size / 2 - bevel
    corners = np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)], dtype=np.float64)
    low = np.stack([x + corners[:, 0] * outer, np.full(4, -bevel), z + corners[:, 1] * outer], axis=-1)
    high = np.stack([x + corners[:, 0] * inner, np.zeros(4), z + corners[:, 1] * inner], axis=-1)
    parts = [mesh(high, [(0, 1, 2), (0, 2, 3)])]
    for k in range(4):
        n = (k + 1) % 4
        parts.append(mesh([low[k], low[n], high[n], high[k]], [(0, 1, 2), (0, 2, 3)]))
    return merge(parts)


def _urn(segments: int) -> trimesh.Trimesh:
    """Vase on a block, about 100 triangles a segment."""
    t = np.linspace(0.0, 1.0, 25)
    body = 0.10 + 0.24 * np.sin(np.pi * t**0.8) ** 1.2 + 0.05 * t
    outside = np.stack([body, 0.62 + 0.75 * t], axis=-1)
    inside = np.stack([body[::-1] - 0.02, 0.62 + 0.75 * t[::-1] - 0.01], axis=-1)
    profile = [(0.16, 0.52), (0.16, 0.56), (0.10, 0.62), (0.10, 0.62), *outside, outside[-1], *inside[:-4]]
    return merge([lathe(profile, segments), box((0.5, 0.52, 0.5), (0, 0.26, 0))])
