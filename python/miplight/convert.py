"""trimesh meshes and scenes to our arrays and materials.

How a trimesh visual becomes an albedo (linear RGB):

- ``PBRMaterial`` (glTF): baseColorFactor / 255 (linear) times baseColorTexture (sRGB) times COLOR_0 (linear).
  Metals are lit as diffuse surfaces of their base colour, and reported.
- ``SimpleMaterial`` (OBJ and others): the image (sRGB) if there is one, else diffuse / 255 (linear, as ``Kd``
  is written today).
- ``ColorVisuals``: vertex or face colours; sRGB display colours, as in PLY files, but linear if the mesh was
  loaded from glTF, whose COLOR_0 is linear.
- None, or trimesh's own filler for a missing material: grey, 0.5.

Emission, alpha and all other maps are reported in ``scene.report`` and not used.
"""

from __future__ import annotations

import dataclasses
import struct
import zlib
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import MultiMaterial, PBRMaterial, SimpleMaterial

from .color import srgb_to_linear
from .errors import SceneError
from .material import Material
from .normals import smooth_normals
from .validate import as_positions, as_triangles

__all__ = ["Converted", "TextureCache", "convert_mesh", "image_to_linear"]

TextureCache = dict[tuple[int, bytes], tuple[Any, Material]]
"""Materials by image and factor: meshes with one image share one. Holding the image keeps its id alive."""

_WHITE = np.ones(3)
_UNREADABLE = (OSError, SyntaxError, EOFError, struct.error, zlib.error)
"""What PIL raises while it decodes a damaged image."""


@dataclasses.dataclass
class Converted:
    """A mesh as checked arrays, with the material that its visual describes."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    normals: NDArray[np.float64] | None = None
    uvs: NDArray[np.float32] | None = None
    colors: NDArray[np.float32] | None = None
    material: Material = dataclasses.field(default_factory=Material)
    notes: list[str] = dataclasses.field(default_factory=list)

    def split_faces(self, face_colors: NDArray[np.float32]) -> None:
        """Give every triangle its own corners, so that each can have its own colour."""
        corner = self.triangles.ravel()
        self.positions = self.positions[corner]
        self.normals = None if self.normals is None else self.normals[corner]
        self.uvs = None if self.uvs is None else self.uvs[corner]
        self.triangles = np.arange(len(corner), dtype=np.uint32).reshape(-1, 3)
        self.colors = np.repeat(face_colors, 3, axis=0)


def convert_mesh(
    mesh: trimesh.Trimesh, label: str, *, smooth: bool, visual: bool, textures: TextureCache
) -> Converted:
    """Take over a mesh's arrays; with `visual` its material too.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    label : str
        How errors name the mesh.
    smooth : bool
        Take the mesh's vertex normals: those of its file, or else the corner-angle average.
    visual : bool
        Convert the mesh's visual; otherwise only its UVs are taken.
    textures : dict
        Shared by the meshes of one call.

    Raises
    ------
    SceneError
        If vertices or faces have a wrong shape, an index is out of range, or an image cannot be read.
    """
    positions = as_positions(mesh.vertices, f"{label}, vertices")
    triangles = as_triangles(mesh.faces, f"{label}, faces", len(positions))
    result = Converted(positions, triangles)
    if smooth:
        result.normals = _vertex_normals(mesh, positions, triangles)
    kind = mesh.visual
    if isinstance(kind, TextureVisuals):
        result.uvs = _uvs(kind, len(positions), result.notes)
    if not visual:
        return result
    try:
        if isinstance(kind, TextureVisuals):
            _convert_texture_visuals(kind, result, textures)
        elif isinstance(kind, ColorVisuals):
            _convert_color_visuals(kind, result, linear=_is_gltf(mesh))
    except _UNREADABLE as error:  # images are decoded only now, and may be damaged
        raise SceneError(
            f"{label}: its image cannot be read ({error}); allowed: a complete image file"
        ) from error
    return result


def _vertex_normals(
    mesh: trimesh.Trimesh, positions: NDArray[np.float64], triangles: NDArray[np.uint32]
) -> NDArray[np.float64]:
    # trimesh keeps a file's normals in its cache. What it computes itself uses absolute thresholds that
    # lose the triangles of small scenes, so that part is ours.
    if "vertex_normals" in mesh._cache:
        given = np.asarray(mesh.vertex_normals, dtype=np.float64)
        if given.shape == positions.shape:
            return given
    return smooth_normals(positions, triangles)


def _is_gltf(mesh: trimesh.Trimesh) -> bool:
    return str(getattr(mesh.source, "file_type", "")).lower() in ("glb", "gltf")


def _uvs(visual: TextureVisuals, count: int, notes: list[str]) -> NDArray[np.float32] | None:
    if visual.uv is None:
        return None
    uvs = np.asarray(visual.uv)
    if uvs.ndim != 2 or uvs.shape[0] != count or uvs.shape[1] < 2:
        notes.append(f"UVs of shape {uvs.shape} do not fit {count} vertices and are ignored")
        return None
    uvs = np.array(uvs[:, :2], dtype=np.float32, order="C")
    bad = ~np.isfinite(uvs).all(axis=1)
    if bad.any():
        notes.append(f"{int(bad.sum()):,} UVs that are not finite were set to 0")
        uvs[bad] = 0.0
    return uvs


def _convert_texture_visuals(visual: TextureVisuals, result: Converted, textures: TextureCache) -> None:
    material = visual.material
    if isinstance(material, MultiMaterial) and len(material.materials) > 0:
        parts = material.materials
        chosen = visual.face_materials
        if chosen is not None and len(chosen) == len(result.triangles):
            _convert_face_materials(parts, np.asarray(chosen, dtype=np.intp), result)
            return
        result.notes.append("of several materials without a choice per face, the first is used")
        material = parts[0]
    factor, image = _base_color(material, result.notes)
    if image is not None and result.uvs is None:
        result.notes.append("an image without UVs is ignored")
        image = None
    result.material = _material(factor, image, textures)
    color = visual.vertex_attributes.get("color") if "color" in visual.vertex_attributes else None
    if color is not None and len(color) == len(result.positions):
        result.colors = _linear_colors(np.asarray(color), result.notes)


def _convert_face_materials(parts: list[Any], chosen: NDArray[np.intp], result: Converted) -> None:
    table = np.empty((len(parts), 3), dtype=np.float32)
    for k, part in enumerate(parts):
        factor, image = _base_color(part, result.notes)
        if image is not None:
            factor = factor * image_to_linear(image).mean(axis=(0, 1))
            result.notes.append(
                f"material {k} of several in one mesh: its image is replaced by its mean colour"
            )
        table[k] = factor
    result.split_faces(table[np.clip(chosen, 0, len(parts) - 1)])
    result.material = Material(_WHITE)


def _base_color(material: Any, notes: list[str]) -> tuple[NDArray[np.float64], Any]:
    """Read the linear colour factor and the image of a trimesh material; note what is left out."""
    if isinstance(material, PBRMaterial):
        return _base_color_pbr(material, notes)
    if isinstance(material, SimpleMaterial):
        if _is_filler(material):
            return np.asarray(Material().albedo, dtype=np.float64), None
        if material.image is not None:
            return _WHITE, material.image
        return np.asarray(material.diffuse[:3], dtype=np.float64) / 255.0, None
    notes.append(f"a material of type {type(material).__name__} is not known: grey")
    return np.asarray(Material().albedo, dtype=np.float64), None


def _base_color_pbr(material: PBRMaterial, notes: list[str]) -> tuple[NDArray[np.float64], Any]:
    factor = material.baseColorFactor
    rgba = np.full(4, 255) if factor is None else np.asarray(factor)
    if rgba[3] < 255 or material.alphaMode in ("BLEND", "MASK"):
        notes.append(
            f"alpha is ignored (factor {rgba[3] / 255:.2f}, mode {material.alphaMode}): lit as opaque"
        )
    emissive = material.emissiveFactor
    if (emissive is not None and np.any(emissive)) or (
        emissive is None and material.emissiveTexture is not None
    ):
        notes.append("emission is ignored: add an AreaLight for what should shine")
    if material.metallicFactor:
        notes.append(f"metallic {material.metallicFactor:.2g}: lit as a diffuse surface of its base colour")
    maps = [
        m for m in ("normalTexture", "occlusionTexture", "metallicRoughnessTexture") if getattr(material, m)
    ]
    if maps:
        notes.append(f"{', '.join(maps)} ignored")
    return rgba[:3].astype(np.float64) / 255.0, material.baseColorTexture


def _is_filler(material: SimpleMaterial) -> bool:
    """Tell trimesh's stand-in for a missing material: a 2 x 2 image of one grey."""
    image = material.image
    if image is None or getattr(image, "size", None) != (2, 2) or getattr(image, "mode", "") != "RGBA":
        return False
    return bool((np.asarray(image) == (100, 100, 100, 255)).all())


def _material(factor: NDArray[np.float64], image: Any, textures: TextureCache) -> Material:
    if image is None:
        return Material(factor)
    key = (id(image), factor.tobytes())
    if key not in textures:
        textures[key] = (image, Material(image_to_linear(image) * factor.astype(np.float32)))
    return textures[key][1]


def _convert_color_visuals(visual: ColorVisuals, result: Converted, *, linear: bool) -> None:
    if visual.kind not in ("vertex", "face"):
        return
    codes = np.asarray(visual.vertex_colors if visual.kind == "vertex" else visual.face_colors)
    expected = len(result.positions if visual.kind == "vertex" else result.triangles)
    if len(codes) != expected:
        result.notes.append(f"{len(codes)} {visual.kind} colours do not fit {expected}: grey")
        return
    colors = _linear_colors(codes, result.notes) if linear else srgb_to_linear(codes[:, :3])
    if not linear and codes.shape[1] == 4 and (codes[:, 3] < 255).any():
        result.notes.append("alpha of the colours is ignored: lit as opaque")
    result.material = Material(_WHITE)
    if visual.kind == "vertex":
        result.colors = colors
    else:
        result.split_faces(colors)


def _linear_colors(colors: NDArray[Any], notes: list[str]) -> NDArray[np.float32]:
    """Take over linear (N, 3 or 4) colours, integers by their range; floats are clipped to [0, 1]."""
    full = float(np.iinfo(colors.dtype).max) if colors.dtype.kind in "iu" else 1.0
    scaled = np.nan_to_num(colors.astype(np.float64) / full, nan=0.0)
    if scaled.shape[1] == 4 and (scaled[:, 3] < 1).any():
        notes.append("alpha of the colours is ignored: lit as opaque")
    if ((scaled[:, :3] < 0) | (scaled[:, :3] > 1)).any():
        notes.append("colours outside [0, 1] were clipped")
    return np.ascontiguousarray(np.clip(scaled[:, :3], 0.0, 1.0), dtype=np.float32)


def image_to_linear(image: Any) -> NDArray[np.float32]:
    """Decode a PIL image (sRGB, 8 or 16 bits, any mode) to linear RGB.

    Parameters
    ----------
    image : PIL.Image.Image or array_like of uint8
        Alpha is dropped, grey is repeated.

    Returns
    -------
    (h, w, 3) float32, row 0 at the top

    Raises
    ------
    OSError
        If the file behind the image is cut short.
    """
    mode = getattr(image, "mode", None)
    if mode in ("I", "F") or (mode is not None and mode.startswith("I;16")):
        grey = np.asarray(image)
        if mode == "F":  # floats carry no sRGB encoding
            linear = np.clip(np.nan_to_num(grey), 0.0, 1.0).astype(np.float32)
        else:
            linear = srgb_to_linear(np.clip(grey, 0, 65535).astype(np.uint16))
        return np.repeat(linear[:, :, None], 3, axis=2)
    if mode is not None:
        return srgb_to_linear(np.asarray(image if mode == "RGB" else image.convert("RGB")))
    codes = np.asarray(image)
    if codes.dtype != np.uint8 or codes.ndim not in (2, 3):
        raise OSError(f"not an image: {codes.dtype} of shape {codes.shape}")
    if codes.ndim == 2:
        codes = codes[:, :, None]
    return srgb_to_linear(codes[:, :, :3] if codes.shape[2] >= 3 else np.repeat(codes[:, :, :1], 3, axis=2))
