"""Checked mesh records from what users give: the work behind the methods of `Scene`."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from .convert import Converted, TextureCache, convert_mesh
from .errors import SceneError
from .geometry import Geometry, MeshInstance, Shading
from .material import Material
from .normals import mend_normals, smooth_normals
from .validate import (
    as_choice,
    as_colors,
    as_matrix,
    as_normals,
    as_positions,
    as_triangles,
    as_uvs,
    fail,
    freeze,
)

__all__ = ["deform", "from_arrays", "from_mesh", "instance", "recolor"]

_WHITE = (1.0, 1.0, 1.0)


def from_mesh(
    name: str,
    mesh: Any,
    material: Material | None,
    transform: ArrayLike | None,
    shading: Any,
    textures: TextureCache,
) -> MeshInstance:
    """Take over a trimesh mesh; its visual counts only where no material is given."""
    if not isinstance(mesh, trimesh.Trimesh):
        hint = " (for a trimesh.Scene: Scene.from_trimesh)" if isinstance(mesh, trimesh.Scene) else ""
        fail("mesh", mesh, "a trimesh.Trimesh" + hint)
    smooth = _as_shading(shading) == "smooth"
    label = f"mesh {name!r}"
    matrix = as_transform(transform)
    converted = convert_mesh(mesh, label, smooth=smooth, visual=material is None, textures=textures)
    use = converted.material if material is None else as_material(material)
    return instance(name, make_geometry(name, converted), matrix, use, shading, converted.notes)


def from_arrays(
    name: str, arrays: dict[str, Any], material: Material | None, transform: ArrayLike | None, shading: Any
) -> MeshInstance:
    """Take over plain arrays: positions, triangles, and normals, uvs, colors or None."""
    smooth = _as_shading(shading) == "smooth"
    label = f"mesh {name!r}, "
    matrix = as_transform(transform)
    positions = as_positions(arrays["positions"], label + "positions")
    count = len(positions)
    result = Converted(positions, as_triangles(arrays["triangles"], label + "triangles", count))
    given = arrays["normals"]
    normals = None if given is None else as_normals(given, label + "normals", count)
    if smooth:
        result.normals = smooth_normals(positions, result.triangles) if normals is None else normals
    if arrays["uvs"] is not None:
        result.uvs = as_uvs(arrays["uvs"], label + "uvs", count)
    if arrays["colors"] is not None:
        result.colors = as_colors(arrays["colors"], label + "colors", count)
    default = Material() if result.colors is None else Material(_WHITE)
    use = default if material is None else as_material(material)
    return instance(name, make_geometry(name, result), matrix, use, shading, result.notes)


def make_geometry(name: str, converted: Converted) -> Geometry:
    """Mend the normals and store the arrays, once for all meshes that have the same."""
    normals = None
    if converted.normals is not None:
        normals, mended = mend_normals(converted.normals, converted.positions, converted.triangles)
        if mended:
            converted.notes.append(f"{mended:,} normals that were zero or not finite were computed anew")
    return Geometry.shared(
        converted.positions, converted.triangles, normals, converted.uvs, converted.colors, name=name
    )


def instance(
    name: str,
    geometry: Geometry,
    transform: NDArray[np.float64],
    material: Material,
    shading: Shading,
    notes: list[str] | tuple[str, ...] = (),
) -> MeshInstance:
    """Put a record together; the core checks its part at once."""
    made = MeshInstance(
        name, geometry, transform, material, shading, geometry.colors is not None, tuple(notes)
    )
    return _checked(made)


def recolor(old: MeshInstance, material: Material) -> MeshInstance:
    """Return the mesh with another material, which replaces its vertex colours, too."""
    return _checked(dataclasses.replace(old, material=as_material(material), use_colors=False))


def deform(old: MeshInstance, vertices: ArrayLike, normals: ArrayLike | None) -> MeshInstance:
    """Return the mesh with other vertices; only this mesh's BVH is built again."""
    label = f"mesh {old.name!r}, "
    positions = as_positions(vertices, label + "vertices", count=len(old.positions))
    mended: NDArray[np.float32] | None = None
    if normals is not None:
        if old.shading == "flat":
            fail(label + "normals", normals, "None: the mesh is shaded flat")
        mended, _ = mend_normals(
            as_normals(normals, label + "normals", len(positions)), positions, old.triangles
        )
    geometry = old.geometry.deformed(positions, mended, old.name)
    return _checked(dataclasses.replace(old, geometry=geometry))


def _checked(made: MeshInstance) -> MeshInstance:
    if made.material.is_textured and made.uvs is None:
        raise SceneError(
            f"mesh {made.name!r} has no UVs, but the albedo of its material is an image; "
            "allowed: an albedo of shape (3,), or a mesh with UVs"
        )
    made._core_instance()
    return made


def as_transform(value: ArrayLike | None) -> NDArray[np.float64]:
    """Check a transform; None is the identity."""
    return freeze(np.eye(4)) if value is None else as_matrix(value, "transform")


def as_material(value: Any) -> Material:
    """Check that a material is one."""
    if not isinstance(value, Material):
        fail("material", value, "a miplight.Material")
    return value


def _as_shading(value: Any) -> Shading:
    return "smooth" if as_choice(value, "shading", ("smooth", "flat")) == "smooth" else "flat"
