"""Reflective shadow maps in float64: where texels look, how much of the light each has, what it reflects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .hemisphere import cosine_directions, frame
from .lights import Area
from .structs import HIT, MISS, RSM_MAP, record
from .surfaces import Placed, surfaces

Array = NDArray[np.float64]
FAR = float(np.float32(3.0e38))
SPOT, AREA = 0, 1
LEAST_COSINE = 0.05


def spot_map(
    position: Array, axis: Array, degrees: float, resolution: int, *, equal: bool = False, number: int = 0
) -> NDArray[Any]:
    """The map of a spot: a frustum that touches its cone."""
    tan = np.tan(np.radians(degrees))
    share = frustum_solid_angle(tan) / resolution**2 if equal else 0.0
    return record(
        RSM_MAP,
        origin=position,
        kind=SPOT,
        axis=axis / np.linalg.norm(axis),
        tan_half=tan,
        cos_cutoff=np.cos(np.radians(degrees)),
        tiles=1,
        resolution=resolution,
        equal=share,
        map=number,
    )


def area_map(
    light: Area, tiles: int, resolution: int, *, back: bool = False, number: int = 0
) -> NDArray[Any]:
    """The map of one side of an area light."""
    longer = max(np.linalg.norm(light.u), np.linalg.norm(light.v))
    return record(
        RSM_MAP,
        origin=light.corner,
        kind=AREA,
        axis=light.normal * (-1 if back else 1),
        edge_u=light.u,
        edge_v=light.v,
        offset=1e-4 * longer,
        tiles=tiles,
        resolution=resolution,
        map=number,
    )


def frustum_solid_angle(tan: float) -> float:
    """Of a square frustum of half-width `tan` at distance 1."""
    return float(4 * np.arcsin(tan**2 / (1 + tan**2)))


def cone_solid_angle(degrees: float) -> float:
    """Of a cone of this half-angle."""
    return float(2 * np.pi * (1 - np.cos(np.radians(degrees))))


def texels(resolution: int) -> NDArray[np.int64]:
    """Column and row of each texel, row by row (n, 2)."""
    row, column = np.divmod(np.arange(resolution**2), resolution)
    return np.stack([column, row], -1)


def tiles(map_: NDArray[Any]) -> NDArray[np.int64]:
    """Column and row of each texel's tile."""
    return texels(int(map_["resolution"][0])) * int(map_["tiles"][0]) // int(map_["resolution"][0])


def starts_and_directions(map_: NDArray[Any]) -> tuple[Array, Array]:
    """Origins and unit directions of the rays through the middles of texels."""
    m = map_[0]
    axis, n = m["axis"].astype(np.float64), int(m["resolution"])
    place = (texels(n) + 0.5) / n
    if m["kind"] == SPOT:
        t = frame(axis[None])[0]
        d = axis + float(m["tan_half"]) * (2 * place - 1) @ t
        origin = np.broadcast_to(m["origin"].astype(np.float64), d.shape)
        return origin, d / np.linalg.norm(d, axis=1, keepdims=True)
    tile, count = tiles(map_), int(m["tiles"])
    ab = (tile + 0.5) / count
    edges = np.stack([m["edge_u"], m["edge_v"]]).astype(np.float64)
    origin = m["origin"] + ab @ edges + float(m["offset"]) * axis
    return origin, cosine_directions(np.broadcast_to(axis, origin.shape), place * count - tile)


def solid_angles(map_: NDArray[Any]) -> Array:
    """What texels are summed by: of a spot the part in its cone, by 4 × 4 parts that lie in it or do not.

    A part of width w at (u, v) on the plane at distance 1 has w² cosθ / d² = w² / (1 + u² + v²)^(3/2).
    """
    m = map_[0]
    n = int(m["resolution"])
    if m["kind"] == AREA:
        return np.full(n * n, np.pi / n**2)
    tan = float(m["tan_half"])
    along = tan * (2 * (np.arange(4 * n) + 0.5) / (4 * n) - 1)
    d2 = 1 + along[None] ** 2 + along[:, None] ** 2
    part = (2 * tan / (4 * n)) ** 2 / d2**1.5
    if m["equal"] > 0:
        part = np.full_like(part, float(m["equal"]) / 16)
    inside = 1 / np.sqrt(d2) >= float(m["cos_cutoff"])
    whole: Array = np.where(inside, part, 0).reshape(n, 4, n, 4).sum((1, 3)).reshape(-1)
    return whole


def rows(map_: NDArray[Any], emitted: Array, meshes: list[Placed], hits: NDArray[Any]) -> tuple[Array, Array]:
    """The three rows of each texel (n, 3, 4), and how clearly each faces the light.

    `emitted` is a spot's intensity (1, 3), or radiance times area of each tile's part, by rows (tiles², 3).
    """
    m, count = map_[0], int(map_["tiles"][0]) ** 2
    angle, (_, d) = solid_angles(map_), starts_and_directions(map_)
    made = np.zeros((len(hits), 3, 4))
    made[:, 0, 3], made[:, 1, 3] = FAR, angle
    clear = np.ones(len(hits))
    seen = (angle > 0) & (hits["instance"] != MISS)
    for number, mesh in enumerate(meshes):
        if mesh.light != MISS:
            seen &= hits["instance"] != number
    s = surfaces(meshes, hits[seen], d[seen])
    distance = hits["t"][seen].astype(np.float64)
    true = angle[seen]
    if m["kind"] == AREA:
        true = true * count / np.maximum(d[seen] @ m["axis"].astype(np.float64), LEAST_COSINE)
    cosine = -(s.normal_geo * d[seen]).sum(1)
    tile = tiles(map_)[seen]
    light = emitted[tile[:, 1] * int(m["tiles"]) + tile[:, 0]]
    made[seen, 0, :3], made[seen, 0, 3] = s.position, distance
    made[seen, 1, :3] = s.normal_shade
    made[seen, 2, :3] = s.albedo * light * (angle[seen] * count)[:, None]
    made[seen, 2, 3] = true * distance**2 / np.maximum(cosine, LEAST_COSINE)
    clear[seen] = s.facing
    return made, clear


def box(half: float, albedo: float) -> Placed:
    """A closed cube about the origin, seen from inside."""
    corners = np.array([(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)])
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.uint32)
    return Placed(corners, triangles, np.eye(4), np.full(3, albedo))


def first_hits(mesh: Placed, origins: Array, directions: Array) -> NDArray[Any]:
    """What rays meet first of a mesh that is not transformed: every triangle is asked."""
    hits = np.zeros(len(origins), HIT)
    hits["t"], hits["instance"] = np.inf, MISS
    for number, triangle in enumerate(mesh.triangles):
        a, b, c = mesh.positions[triangle]
        p = np.cross(directions, c - a)
        det = p @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((origins - a) * p).sum(1) / det
            q = np.cross(origins - a, b - a)
            v = (directions * q).sum(1) / det
            t = q @ (c - a) / det
            found = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0) & (t < hits["t"])
        for name, values in (("t", t), ("u", u), ("v", v)):
            hits[name][found] = values[found]
        hits["instance"][found], hits["triangle"][found] = 0, number
    return hits
