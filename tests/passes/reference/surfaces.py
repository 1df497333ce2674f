"""Placed triangle meshes: how shaders find them in memory, and the surface at a hit in float64."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .image import rotation
from .lights import Area, single
from .pictures import half, pack_half, repeated
from .structs import COLORS, HIT, INSTANCE, LIGHT, MISS, SMOOTH, TEXTURE

Array = NDArray[np.float64]


@dataclasses.dataclass
class Placed:
    """A mesh with its place and material; attributes that are None are not there."""

    positions: Array
    triangles: NDArray[np.uint32]
    scene_from_object: Array
    albedo: Array
    normals: Array | None = None
    uvs: Array | None = None
    colors: Array | None = None
    texture: Array | None = None
    smooth: bool = False
    light: int = MISS

    def __post_init__(self) -> None:
        self.positions, self.albedo = single(self.positions), single(self.albedo)
        self.scene_from_object = single(self.scene_from_object)
        for name in ("normals", "uvs", "colors"):
            if getattr(self, name) is not None:
                setattr(self, name, single(getattr(self, name)))
        if self.texture is not None:
            self.texture = half(self.texture)


@dataclasses.dataclass
class Surface:
    """What is seen at each hit; arrays of n rows.

    `reach` is the largest coordinate that the triangle's corners have in scene space, each part taken as
    positive: what the rounding of the position, and of a ray's way back to it, goes by.
    """

    position: Array
    reach: Array
    normal_geo: Array
    normal_shade: Array
    front: NDArray[np.bool_]
    facing: Array
    albedo: Array


def pack(meshes: list[Placed]) -> dict[str, NDArray[Any]]:
    """Bindings `geometry`, `instances` and `texels`."""
    words: list[NDArray[np.uint32]] = [np.zeros(3, np.uint32)]  # nothing starts at 0: offsets must be used
    texels: list[NDArray[np.uint32]] = [np.zeros((5, 2), np.uint32)]
    instances = np.zeros(len(meshes), INSTANCE)
    for mesh, at in zip(meshes, instances, strict=True):
        attributes: dict[str, NDArray[Any] | None] = {
            "triangles": mesh.triangles,
            "positions": mesh.positions,
            "normals": mesh.normals,
            "uvs": mesh.uvs,
            "colors": mesh.colors,
        }
        for name, values in attributes.items():
            at[name] = sum(len(w) for w in words)
            if values is not None:
                stored = values if name == "triangles" else values.astype(np.float32).view(np.uint32)
                words.append(np.ascontiguousarray(stored).reshape(-1).view(np.uint32))
        at["scene_from_object"] = mesh.scene_from_object[:3]
        at["object_from_scene"] = np.linalg.inv(mesh.scene_from_object)[:3]
        at["albedo"], at["light"] = mesh.albedo, mesh.light
        at["flags"] = (
            SMOOTH * mesh.smooth
            | COLORS * (mesh.colors is not None)
            | TEXTURE * (mesh.texture is not None)
            | LIGHT * (mesh.light != MISS)
        )
        at["extent"] = np.abs(mesh.scene_from_object[:3, 3]).max()
        if mesh.texture is not None:
            at["texture"] = sum(len(t) for t in texels)
            at["texture_height"], at["texture_width"] = mesh.texture.shape[:2]
            texels.append(pack_half(mesh.texture))
    return {"geometry": np.concatenate(words), "instances": instances, "texels": np.concatenate(texels)}


def _interpolated(mesh: Placed, values: Array, hits: NDArray[Any]) -> Array:
    u, v = hits["u"].astype(np.float64)[:, None], hits["v"].astype(np.float64)[:, None]
    p0, p1, p2 = (values[mesh.triangles[hits["triangle"], k]] for k in range(3))
    between: Array = (1 - u - v) * p0 + u * p1 + v * p2
    return between


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _surface(mesh: Placed, hits: NDArray[Any], directions: Array) -> Surface:
    linear, moved = mesh.scene_from_object[:3, :3], mesh.scene_from_object[:3, 3]
    position = _interpolated(mesh, mesh.positions, hits) @ linear.T + moved
    corners = [mesh.positions[mesh.triangles[hits["triangle"], k]] @ linear.T for k in range(3)]
    outermost = np.max(
        [np.abs(mesh.positions[mesh.triangles[hits["triangle"], k]]) for k in range(3)], axis=0
    )
    reach = (outermost @ np.abs(linear).T).max(axis=-1)
    geometric = _unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    shading = geometric
    if mesh.smooth:
        assert mesh.normals is not None
        # normals are covectors: they move by the inverse transpose
        shading = _unit(_interpolated(mesh, mesh.normals, hits) @ np.linalg.inv(linear))
    albedo = np.broadcast_to(mesh.albedo, position.shape)
    if mesh.colors is not None:
        albedo = albedo * _interpolated(mesh, mesh.colors, hits)
    if mesh.texture is not None:
        assert mesh.uvs is not None
        albedo = albedo * repeated(mesh.texture, _interpolated(mesh, mesh.uvs, hits))
    facing = (_unit(directions) * geometric).sum(axis=-1)
    shade_facing = (_unit(directions) * shading).sum(axis=-1)
    front = facing <= 0
    return Surface(
        position,
        reach + np.abs(moved).max(),
        np.where(front, 1, -1)[:, None] * geometric,
        np.where(shade_facing <= 0, 1, -1)[:, None] * shading,
        front,
        np.minimum(np.abs(facing), np.abs(shade_facing)),
        albedo,
    )


ORIGIN_ERROR = 2.0**-19
"""How far rays start off a surface, as a share of its reach: 32 roundings of float32."""


def surfaces(meshes: list[Placed], hits: NDArray[Any], directions: Array) -> Surface:
    """The surface at every hit seen along `directions` (n, 3); hits must not be misses."""
    found: dict[str, Array] = {}
    for number, mesh in enumerate(meshes):
        mine = np.flatnonzero(hits["instance"] == number)
        if not len(mine):
            continue
        part = _surface(mesh, hits[mine], directions[mine])
        for field in dataclasses.fields(Surface):
            values = getattr(part, field.name)
            whole = found.setdefault(field.name, np.zeros((len(hits), *values.shape[1:]), values.dtype))
            whole[mine] = values
    return Surface(**found)  # type: ignore[arg-type]


def random_transform(rng: np.random.Generator, kind: str) -> Array:
    """A transform: "rigid", "mirrored", "stretched" (unequal scales, a shear) or "far" (from the origin)."""
    made = np.eye(4)
    made[:3, :3] = rotation(rng)
    made[:3, 3] = rng.normal(size=3) * (300.0 if kind == "far" else 1.0)
    if kind == "mirrored":
        made[:3, :3] = made[:3, :3] @ np.diag([1, -1, 1])
    if kind == "stretched":
        made[:3, :3] = made[:3, :3] @ np.array([[3, 0.4, 0], [0, 0.2, 0], [0, 0, 1]]) @ rotation(rng)
    return made


def random_mesh(rng: np.random.Generator, kind: str, **options: Any) -> Placed:
    """Some triangles, none of them a sliver, with every attribute unless told otherwise."""
    count = 12
    positions = rng.normal(size=(count, 3))
    triangles = np.array([rng.choice(count, 3, replace=False) for _ in range(200)], np.uint32)
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    edge = np.maximum(((b - a) ** 2).sum(axis=1), ((c - a) ** 2).sum(axis=1))
    fat = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.3 * edge
    values = {
        "normals": _unit(np.array([0, 0, 2.5]) + rng.normal(size=(count, 3))),
        "uvs": rng.uniform(-2.5, 2.5, (count, 2)),
        "colors": rng.uniform(0.1, 1, (count, 3)),
        "texture": rng.uniform(0, 1, (5, 7, 3)),
        "albedo": rng.uniform(0.2, 0.9, 3),
        "smooth": True,
    }
    values.update(options)
    return Placed(positions, triangles[fat], random_transform(rng, kind), **values)


def light_quad(light: Area, number: int) -> Placed:
    """The surface of a visible light: a unit square about the origin, placed by the light's edges."""
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) - [0.5, 0.5, 0]
    placed = np.eye(4)
    placed[:3, 0], placed[:3, 1] = light.u, light.v
    placed[:3, 2] = light.normal * np.sqrt(light.area)
    placed[:3, 3] = light.corner + 0.5 * (light.u + light.v)
    triangles = np.array([(0, 1, 2), (0, 2, 3)], np.uint32)
    return Placed(square, triangles, placed, np.zeros(3), light=number)


def random_hits(
    rng: np.random.Generator, meshes: list[Placed], count: int, misses: float = 0.0
) -> NDArray[Any]:
    """Hits all over the meshes, a share of them misses."""
    hits = np.zeros(count, HIT)
    hits["instance"] = rng.integers(0, len(meshes), count)
    sizes = np.array([len(mesh.triangles) for mesh in meshes])
    hits["triangle"] = rng.integers(0, sizes[hits["instance"]])
    uv = rng.uniform(size=(count, 2))
    outside = uv.sum(axis=1) > 1
    uv[outside] = 1 - uv[outside]
    hits["u"], hits["v"] = uv[:, 0], uv[:, 1]
    hits["t"] = rng.uniform(0.1, 5, count)
    missed = rng.uniform(size=count) < misses
    hits["instance"][missed], hits["triangle"][missed] = MISS, MISS
    return hits
