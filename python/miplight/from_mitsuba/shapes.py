"""Mitsuba shapes as meshes: Mitsuba loads the files, so triangles, normals and UVs are its own."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from miplight.errors import SceneError
from miplight.normals import smooth_normals

from .materials import Surface, surface_of
from .nodes import Document, Node

if TYPE_CHECKING:
    from miplight.scene import Scene

__all__ = ["Triangles", "add_shape", "triangles_of"]

_FILES = frozenset({"obj", "ply", "serialized", "cube"})
_DISK_SIDES = 64
_SPHERE_SUBDIVISIONS = 5
_CYLINDER_SIDES = 128


@dataclasses.dataclass
class Triangles:
    """Arrays of a shape before its transform; normals and UVs as Mitsuba has them (v = 0 at the top)."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.int64]
    normals: NDArray[np.float64] | None
    uvs: NDArray[np.float64] | None
    smooth: bool
    mesh: Any = None


def add_shape(document: Document, scene: Scene, node: Node) -> None:
    """Add a shape that does not emit.

    Raises
    ------
    SceneError
        If the shape or its material cannot be taken over.
    """
    surface = surface_of(document, node)
    name = document.free_name(node, node.plugin, [*scene.meshes, *scene.lights])
    for note in surface.notes:
        document.note(note, name)
    if surface.left_out:
        return
    shape = triangles_of(document, node, name)
    uvs = _our_uvs(shape, surface)
    material, colors = surface.material, None
    if material.is_textured and uvs is None:
        document.note("a bitmap without UVs became its mean colour", name)
        material = material.replace(albedo=material.albedo.mean(axis=(0, 1)))
    if surface.color_attribute:
        colors = _colors(document, shape, surface.color_attribute, name)
    scene.add_arrays(
        shape.positions,
        shape.triangles,
        normals=shape.normals if shape.smooth else None,
        uvs=uvs,
        colors=colors,
        name=name,
        material=material,
        transform=node.matrix(),
        shading="smooth" if shape.smooth else "flat",
    )


def triangles_of(document: Document, node: Node, name: str) -> Triangles:
    """Return a shape's triangles, before its ``to_world``.

    Raises
    ------
    SceneError
        For a shape that has none, and files that cannot be read.
    """
    if node.plugin in _FILES:
        return _loaded(document, node)
    if node.plugin == "rectangle":
        return _rectangle()
    if node.plugin == "disk":
        return _disk()
    if node.plugin == "sphere":
        document.note("tessellated", name)
        return _sphere(node)
    if node.plugin == "cylinder":
        document.note("tessellated", name)
        return _cylinder(node)
    raise SceneError(
        f"shape is {node.plugin!r}; allowed: obj, ply, serialized, cube, rectangle, disk, sphere, cylinder"
    )


def _loaded(document: Document, node: Node) -> Triangles:
    """Let Mitsuba read a mesh without its transform, so that its vertices stay as the file has them."""
    mesh = document.instantiate(node.as_dict("to_world", "BSDF", "Emitter", "Sensor", "Medium"))
    buffers = document.mi.traverse(mesh)
    positions = np.array(buffers["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    triangles = np.array(buffers["faces"], dtype=np.int64).reshape(-1, 3)
    if not len(triangles):
        raise SceneError("the mesh has no triangles; allowed: at least one")
    smooth = bool(mesh.has_vertex_normals()) and not node.get("face_normals", False)
    normals = np.array(buffers["vertex_normals"], dtype=np.float64).reshape(-1, 3) if smooth else None
    uvs = None
    if mesh.has_vertex_texcoords():
        uvs = np.array(buffers["vertex_texcoords"], dtype=np.float64).reshape(-1, 2)
    if smooth and normals is not None and not np.abs(normals).any():
        normals = smooth_normals(positions, triangles.astype(np.uint32))
    return Triangles(positions, triangles, normals, uvs, smooth, mesh)


def _rectangle() -> Triangles:
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=np.float64)
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    return Triangles(corners, faces, None, 0.5 * corners[:, :2] + 0.5, smooth=False)


def _disk() -> Triangles:
    angle = np.arange(_DISK_SIDES) * (2.0 * np.pi / _DISK_SIDES)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(_DISK_SIDES)], axis=-1)
    index = np.arange(_DISK_SIDES)
    faces = np.stack([np.full(_DISK_SIDES, _DISK_SIDES), index, (index + 1) % _DISK_SIDES], axis=-1)
    return Triangles(np.vstack([rim, np.zeros((1, 3))]), faces, None, None, smooth=False)


def _sphere(node: Node) -> Triangles:
    ball = trimesh.creation.icosphere(subdivisions=_SPHERE_SUBDIVISIONS)
    normals = np.array(ball.vertices, dtype=np.float64)
    radius = float(node.get("radius", 1.0))
    center = np.array(node.get("center", (0.0, 0.0, 0.0)), dtype=np.float64).reshape(3)
    return Triangles(normals * radius + center, np.array(ball.faces), normals, None, smooth=True)


def _cylinder(node: Node) -> Triangles:
    start = np.array(node.get("p0", (0.0, 0.0, 0.0)), dtype=np.float64).reshape(3)
    end = np.array(node.get("p1", (0.0, 0.0, 1.0)), dtype=np.float64).reshape(3)
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    angle = np.arange(_CYLINDER_SIDES) * (2.0 * np.pi / _CYLINDER_SIDES)
    normals = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(axis, side)
    ring = normals * float(node.get("radius", 1.0))
    here = np.arange(_CYLINDER_SIDES)
    there = (here + 1) % _CYLINDER_SIDES
    above = _CYLINDER_SIDES
    faces = np.vstack(
        [np.stack([here, there, there + above], -1), np.stack([here, there + above, here + above], -1)]
    )
    return Triangles(
        np.vstack([ring + start, ring + end]), faces, np.vstack([normals, normals]), None, smooth=True
    )


def _our_uvs(shape: Triangles, surface: Surface) -> NDArray[np.float64] | None:
    """UVs with the texture's own transform applied, and v = 0 at the bottom as we have it."""
    if shape.uvs is None:
        return None
    uvs = np.column_stack([shape.uvs, np.ones(len(shape.uvs))]) @ surface.to_uv.T
    return np.column_stack([uvs[:, 0], 1.0 - uvs[:, 1]])


def _colors(document: Document, shape: Triangles, attribute: str, name: str) -> NDArray[np.float64]:
    """Vertex colours of a loaded mesh, clipped to [0, 1]."""
    if shape.mesh is None or not shape.mesh.has_attribute(attribute):
        raise SceneError(
            f"mesh_attribute is {attribute!r}, which the shape does not have; allowed: a vertex attribute"
        )
    colors = np.array(shape.mesh.attribute_buffer(attribute), dtype=np.float64).reshape(
        len(shape.positions), -1
    )
    if colors.shape[1] not in (1, 3):
        raise SceneError(f"mesh_attribute {attribute!r} has {colors.shape[1]} channels; allowed: 1 or 3")
    if colors.max(initial=0.0) > 1.0 or colors.min(initial=0.0) < 0.0:
        document.note("vertex colours were clipped to [0, 1]", name)
    return np.broadcast_to(np.clip(colors, 0.0, 1.0), (len(colors), 3))
