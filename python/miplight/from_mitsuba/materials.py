"""Mitsuba BSDFs as materials, diffuse but for our own Phong; it resolves presets, spectra and images."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miplight.color import srgb_to_linear
from miplight.errors import SceneError
from miplight.material import Material
from miplight.mitsuba.phong import DEFAULT_SHININESS, PHONG

from .nodes import Document, Node

__all__ = ["Surface", "surface_of"]

# Plugins that wrap others: what is inside is taken, and this is said of the rest.
_WRAPPERS = {
    "twosided": "",
    "bumpmap": "its bump map is not used",
    "normalmap": "its normal map is not used",
    "mask": "its opacity is not used",
}
_GLASS = frozenset({"dielectric", "thindielectric", "roughdielectric", "null"})
_ONE_SIDED = "reflects on both sides here, on its front alone in the file"


@dataclasses.dataclass
class Surface:
    """What a BSDF becomes: a material, notes on what was changed, or nothing at all."""

    material: Material = dataclasses.field(default_factory=Material)
    notes: list[str] = dataclasses.field(default_factory=list)
    left_out: bool = False
    color_attribute: str = ""
    to_uv: NDArray[np.float64] = dataclasses.field(default_factory=lambda: np.eye(3))

    @property
    def is_black(self) -> bool:
        """Whether it reflects nothing."""
        if self.color_attribute:
            return False
        return not self.material.albedo.any() and not self.material.specular.any()


def surface_of(document: Document, shape: Node) -> Surface:
    """Convert the BSDF of a shape; Mitsuba's default, grey 0.5, if it has none.

    Raises
    ------
    SceneError
        For a BSDF that has no counterpart.
    """
    bsdfs = shape.children("BSDF")
    if not bsdfs:
        return Surface(Material(), [_ONE_SIDED])
    node, notes, two_sided = bsdfs[0], [], False
    while node.plugin in _WRAPPERS:
        inner = node.children("BSDF")
        if not inner:
            raise SceneError(f"bsdf is {node.plugin!r} without another inside; allowed: one that has one")
        two_sided |= node.plugin == "twosided"
        if _WRAPPERS[node.plugin]:
            notes.append(_WRAPPERS[node.plugin])
        if node.plugin == "twosided" and len(inner) > 1:
            notes.append("the BSDF of its back is not used")
        node = inner[0]
    if node.plugin in _GLASS:
        return Surface(notes=[f"left out so that light passes ({node.plugin})"], left_out=True)
    convert = _CONVERT.get(node.plugin)
    if convert is None:
        raise SceneError(
            f"bsdf is {node.plugin!r}; allowed: {', '.join(sorted({*_CONVERT, *_WRAPPERS, *_GLASS}))}"
        )
    surface = convert(document, node)
    surface.notes = [*notes, *surface.notes]
    if not two_sided and not surface.is_black:
        surface.notes.append(_ONE_SIDED)
    return surface


def _diffuse(document: Document, node: Node) -> Surface:
    return _read(document, node, "reflectance")


def _phong(document: Document, node: Node) -> Surface:
    """Take back what `to_dict` writes for a material with a specular part."""
    surface = _read(document, node, "diffuse_reflectance")
    specular = _parameters(document, node).get("specular_reflectance.value")
    if specular is None:
        raise SceneError(f"specular_reflectance of {PHONG!r} is a texture; allowed: a colour")
    lobe = np.broadcast_to(np.asarray(specular, dtype=np.float32), 3)
    shininess = float(node.get("shininess", DEFAULT_SHININESS))
    surface.material = surface.material.replace(specular=lobe, shininess=shininess)
    return surface


def _plastic(document: Document, node: Node) -> Surface:
    """Give the base the albedo that it has under its coat: loss on the way in, trapping on the way out."""
    surface = _read(document, node, "diffuse_reflectance")
    eta = float(_parameters(document, node)["eta"])
    outside, inside = _mean_fresnel(eta), _mean_fresnel(1.0 / eta)
    base = surface.material.albedo.astype(np.float64)
    # Mitsuba's linear form takes the light that the coat holds back to be lost to no colour
    trapped = inside * (base if node.get("nonlinear", False) else 1.0)
    albedo = base * (1.0 - outside) * (1.0 - inside) / (1.0 - trapped)
    surface.material = surface.material.replace(albedo=np.clip(albedo, 0.0, 1.0).astype(np.float32))
    surface.notes.append(f"its gloss is not used ({node.plugin})")
    return surface


def _conductor(document: Document, node: Node) -> Surface:
    """Metals keep their reflectance at normal incidence, as glTF's base colour does, but scatter it."""
    parameters = _parameters(document, node)
    scale = np.asarray(parameters.get("specular_reflectance.value", 1.0), dtype=np.float64)
    if node.get("material") == "none":
        fresnel = np.ones(3)
    else:
        eta, k = (np.asarray(parameters[f"{name}.value"], dtype=np.float64) for name in ("eta", "k"))
        fresnel = ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
    albedo = np.clip(np.broadcast_to(fresnel * scale, 3), 0.0, 1.0).astype(np.float32)
    return Surface(
        Material(albedo), [f"its mirror reflection is scattered as from a diffuse surface ({node.plugin})"]
    )


def _principled(document: Document, node: Node) -> Surface:
    surface = _read(document, node, "base_color")
    surface.notes.append("its base colour alone is used (principled)")
    return surface


_CONVERT = {
    "diffuse": _diffuse,
    "plastic": _plastic,
    "roughplastic": _plastic,
    "conductor": _conductor,
    "roughconductor": _conductor,
    "principled": _principled,
    PHONG: _phong,
}


def _mean_fresnel(eta: float) -> float:
    """Reflectance of a smooth dielectric boundary for diffuse light: ∫ F(θ) 2 cosθ sinθ dθ."""
    node, weight = np.polynomial.legendre.leggauss(256)
    cos_i = 0.5 * (node + 1.0)
    sin2_t = (1.0 - cos_i**2) / eta**2
    cos_t = np.sqrt(np.maximum(1.0 - sin2_t, 0.0))
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    crossed = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    reflectance = np.where(sin2_t < 1.0, 0.5 * (parallel**2 + crossed**2), 1.0)
    return float(np.sum(weight * reflectance * cos_i))


def _parameters(document: Document, node: Node) -> dict[str, Any]:
    return dict(document.mi.traverse(document.instantiate(node.as_dict())))


def _read(document: Document, node: Node, name: str) -> Surface:
    """Read one reflectance: a colour, an image or a vertex attribute; of anything else the mean colour."""
    texture = node.get(name)
    plugin = texture.plugin if isinstance(texture, Node) else ""
    if plugin == "mesh_attribute":
        attribute = str(texture.get("name", ""))
        if not attribute.startswith("vertex_"):
            raise SceneError(f"mesh_attribute is {attribute!r}; allowed: a vertex attribute, vertex_…")
        return Surface(Material((1.0, 1.0, 1.0)), color_attribute=attribute)
    parameters = _parameters(document, node)
    if f"{name}.data" in parameters and plugin == "bitmap":
        return _bitmap(texture, parameters, name)
    value = parameters.get(f"{name}.value")
    if value is None:
        raise SceneError(f"{name} is a {plugin!r} texture; allowed: a colour, a bitmap, a mesh_attribute")
    return Surface(*_clipped(np.broadcast_to(np.asarray(value, dtype=np.float64), 3)))


def _bitmap(texture: Node, parameters: dict[str, Any], name: str) -> Surface:
    """Read an image as linear RGB. Mitsuba keeps 8-bit images encoded, others linear."""
    texels = np.array(parameters[f"{name}.data"])
    if texels.dtype == np.uint8:
        raw = bool(texture.get("raw", False))
        texels = texels.astype(np.float32) / 255.0 if raw else srgb_to_linear(texels[..., :3])
    if texels.ndim == 2:
        texels = texels[..., None]
    channels = texels[..., :3] if texels.shape[-1] >= 3 else texels[..., :1]
    albedo = np.broadcast_to(channels, (*channels.shape[:2], 3)).astype(np.float32)
    material, notes = _clipped(albedo)
    if texture.get("filter_type", "bilinear") != "bilinear":
        notes.append("its image is interpolated here, not in the file")
    if texture.get("wrap_mode", "repeat") != "repeat":
        notes.append("its image is repeated here, not in the file")
    to_uv = (
        np.array(parameters[f"{name}.to_uv"].matrix, dtype=np.float64)
        if f"{name}.to_uv" in parameters
        else np.eye(3)
    )
    return Surface(material, notes, to_uv=to_uv)


def _clipped(albedo: NDArray[Any]) -> tuple[Material, list[str]]:
    clipped = np.clip(albedo, 0.0, 1.0).astype(np.float32)
    notes = [] if np.allclose(clipped, albedo, atol=1e-6) else ["its reflectance was clipped to [0, 1]"]
    return Material(clipped), notes
