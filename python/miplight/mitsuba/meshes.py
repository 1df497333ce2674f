"""A miplight mesh as a ``mitsuba.Mesh``: its triangles in world space, its normals, UVs and colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import plugins

if TYPE_CHECKING:
    from miplight.geometry import MeshInstance
    from miplight.material import Material

__all__ = ["mesh_object", "world_positions"]

_COLOR = "vertex_color"


def world_positions(mesh: MeshInstance) -> NDArray[np.float64]:
    """Vertices in world space: float64 of shape (V, 3)."""
    matrix = np.asarray(mesh.transform, dtype=np.float64)
    positions: NDArray[np.float64] = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
    return positions


def mesh_object(
    mi: Any, name: str, mesh: MeshInstance, anchor: NDArray[np.float64], specular: bool = True
) -> Any | None:
    """Build the shape.

    Parameters
    ----------
    mi : module
        Mitsuba with an active variant.
    name : str
    mesh : MeshInstance
        Triangles with a vertex that is not finite are left out, as the renderer leaves them.
    anchor : (3,) float64
        Subtracted from all positions.
    specular : bool, default True
        False leaves out the material's Phong lobe.

    Returns
    -------
    mitsuba.Mesh or None
        None if no triangle is left.
    """
    positions = world_positions(mesh) - anchor
    triangles = np.asarray(mesh.triangles)
    kept = triangles[np.isfinite(positions[triangles]).all(axis=(1, 2))]
    if not len(kept):
        return None
    used, faces = np.unique(kept, return_inverse=True)
    smooth = mesh.shading == "smooth" and mesh.normals is not None
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(_bsdf(mi, mesh.material, mesh.colors is not None, specular))
    if not smooth:
        props["face_normals"] = True
    shape = mi.Mesh(
        name,
        len(used),
        len(kept),
        props,
        has_vertex_normals=smooth,
        has_vertex_texcoords=mesh.uvs is not None,
    )
    buffers = mi.traverse(shape)
    buffers["vertex_positions"] = _flat(positions[used])
    buffers["faces"] = np.ascontiguousarray(faces.ravel(), dtype=np.uint32)
    if mesh.uvs is not None:
        # an image's row 0 is at v = 1 for us, at v = 0 for Mitsuba
        buffers["vertex_texcoords"] = _flat(np.asarray(mesh.uvs)[used] * (1.0, -1.0) + (0.0, 1.0))
    buffers.update()
    if smooth:
        # after the positions, whose update computes normals of its own
        buffers["vertex_normals"] = _flat(_world_normals(mesh)[used])
        buffers.update()
    if mesh.colors is not None:
        shape.add_attribute(_COLOR, 3, _flat(_vertex_albedo(mesh)[used]))
    return shape


def _flat(array: NDArray[Any]) -> NDArray[np.float32]:
    return np.ascontiguousarray(array, dtype=np.float32).ravel()


def _world_normals(mesh: MeshInstance) -> NDArray[np.float64]:
    """Vertex normals in world space, unit length: they go by the inverse transpose."""
    matrix = np.asarray(mesh.transform, dtype=np.float64)[:3, :3]
    normals = np.asarray(mesh.normals, dtype=np.float64) @ np.linalg.inv(matrix)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: NDArray[np.float64] = normals / np.where(length > 0, length, 1.0)
    return unit


def _vertex_albedo(mesh: MeshInstance) -> NDArray[np.float32]:
    """Vertex colours, times the constant albedo where there is no image."""
    colors = np.asarray(mesh.colors, dtype=np.float32)
    albedo = mesh.material.albedo
    return colors * albedo if albedo.ndim == 1 else colors


def _bsdf(mi: Any, material: Material, colored: bool, specular: bool) -> dict[str, Any]:
    attribute = {"type": "mesh_attribute", "name": _COLOR}
    if not material.is_textured:
        constant = {"type": "rgb", "value": [float(c) for c in material.albedo]}
        reflectance: dict[str, Any] = attribute if colored else constant
    else:
        image = {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.array(material.albedo)),
            "raw": True,
            "filter_type": "bilinear",
            "wrap_mode": "repeat",
        }
        reflectance = {"type": plugins.PRODUCT, "first": image, "second": attribute} if colored else image
    if not (specular and material.specular.any()):
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    lobe = {
        "type": plugins.PHONG,
        "diffuse_reflectance": reflectance,
        "specular_reflectance": {"type": "rgb", "value": [float(c) for c in material.specular]},
        "shininess": material.shininess,
    }
    return {"type": "twosided", "bsdf": lobe}
