"""A miplight scene as a Mitsuba scene dictionary: the same triangles, normals, texels and lights.

Materials are `twosided` diffuse, or `twosided` Phong (`miplight.mitsuba.phong`) where they have a specular
part. A visible area light is a rectangle with a black surface; a two-sided one is
two of them a hair apart; an invisible one and any pinhole that Mitsuba's own sensor cannot express are
plugins of ours (`miplight.mitsuba.plugins`).
"""

from __future__ import annotations

import re
import warnings
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from miplight.errors import SceneError
from miplight.light import AreaLight
from miplight.spot import SpotLight
from miplight.validate import as_bool, as_choice, as_count, as_vector

from . import plugins, variant
from .meshes import mesh_object, world_positions

if TYPE_CHECKING:
    from miplight.camera import Camera
    from miplight.scene import Scene

__all__ = ["Pixel", "integrator_dict", "is_glossy", "scene_bounds", "to_dict"]

Pixel: TypeAlias = Literal["center", "box"]

# Distance between the two faces of a two-sided light, relative to its shorter edge: enough for float32 to
# tell them apart, and far below what can be seen. Shadow rays end 0.09 % of their length before the light, so
# it hides nothing.
_TWO_SIDED_GAP = 1e-4
# Clipping planes, relative to the distance of the farthest point: nothing that can be seen is cut off.
_NEAR, _FAR = 1e-5, 1.1


def to_dict(
    scene: Scene,
    camera: Camera | None = None,
    *,
    max_depth: int = 2,
    spp: int = 64,
    sampler: str = "independent",
    pixel: Pixel = "box",
    integrator: dict[str, Any] | None = None,
    anchor: ArrayLike | None = None,
    specular: bool = True,
) -> dict[str, Any]:
    """Describe a scene for ``mitsuba.load_dict``.

    The dictionary belongs to the Mitsuba variant that is active (an RGB one); if none is, the fastest usable
    one is made active and stays so.

    Parameters
    ----------
    scene : Scene
    camera : Camera or None, default None
        None leaves the sensor out.
    max_depth : int, default 2
        2 is direct light (Mitsuba's `direct`: light sampling only, or lights and materials by multiple
        importance sampling where a material has a specular part), 3 or more `path` with that many segments.
        `path` reflects by the whole material at every hit; `reference` can leave the specular part to the
        first one.
    spp : int, default 64
        Samples a pixel that the sensor's sampler is set to.
    sampler : str, default "independent"
        Mitsuba's name of the sampler; "multijitter" has far less noise.
    pixel : {"box", "center"}, default "box"
        Samples spread over the pixel, as Mitsuba's users know it, or all of them at its centre, where
        miplight shades it (then the sensor is a plugin of ours, and the box filter merely stores).
    integrator : dict or None
        Replaces the integrator that `max_depth` picks.
    anchor : array_like, (3,), or None
        Subtracted from all positions in float64, for scenes far from the origin.
    specular : bool, default True
        False leaves out the specular parts: all materials are diffuse, of the same albedo.

    Returns
    -------
    dict
        With the keys ``integrator``, ``sensor``, ``mesh<i>_<name>`` and ``light<i>_<name>``.

    Raises
    ------
    MiplightError
        If Mitsuba is missing or of another version.
    SceneError
        For a variant that is not RGB, and for bad arguments.
    """
    as_choice(pixel, "pixel", ("box", "center"))
    depth = as_count(max_depth, "max_depth", at_least=2)
    samples = as_count(spp, "spp")
    mi = _active_rgb()
    plugins.register(mi)
    weighted = as_bool(specular, "specular") and is_glossy(scene)
    origin = np.zeros(3) if anchor is None else as_vector(anchor, "anchor")
    result: dict[str, Any] = {"type": "scene", "integrator": integrator or integrator_dict(depth, weighted)}
    if camera is not None:
        result["sensor"] = _sensor(mi, scene, camera, samples, sampler, pixel, origin)
    for index, (name, mesh) in enumerate(scene.meshes.items()):
        shape = mesh_object(mi, name, mesh, origin, specular)
        if shape is not None:
            result[f"mesh{index}_{_safe(name)}"] = shape
    for index, (name, light) in enumerate(scene.lights.items()):
        for suffix, node in _light(mi, light, origin):
            result[f"light{index}_{_safe(name)}{suffix}"] = node
    return result


def integrator_dict(max_depth: int, weighted: bool) -> dict[str, Any]:
    """Pick `direct` for direct light, the path tracer without roulette for more.

    `weighted` samples lights and materials alike and weights the two, as the path tracer always does; else
    direct light samples the lights alone. The expected value is the same.
    """
    if max_depth == 2:
        return {"type": "direct", "emitter_samples": 1, "bsdf_samples": int(weighted)}
    return {"type": "path", "max_depth": max_depth, "rr_depth": max_depth + 1}


def is_glossy(scene: Scene) -> bool:
    """Whether any material has a specular part."""
    return any(bool(mesh.material.specular.any()) for mesh in scene.meshes.values())


def scene_bounds(scene: Scene) -> NDArray[np.float64]:
    """Box around all meshes and lights, world space: float64 of shape (2, 3); zeros for an empty scene."""
    points = [world_positions(mesh) for mesh in scene.meshes.values()]
    for light in scene.lights.values():
        if isinstance(light, AreaLight):
            corner, u, v = light.corner, light.edge_u, light.edge_v
            points.append(np.array([corner, corner + u, corner + v, corner + u + v]))
        else:
            points.append(light.position[None])
    finite = [array[np.isfinite(array).all(axis=1)] for array in points]
    finite = [array for array in finite if len(array)]
    if not finite:
        return np.zeros((2, 3))
    return np.array([np.min([a.min(0) for a in finite], axis=0), np.max([a.max(0) for a in finite], axis=0)])


def _active_rgb() -> Any:
    mi = variant.import_mitsuba()
    if mi.variant() is None:
        mi.set_variant(variant.pick_variant())
    if "rgb" not in mi.variant() or "polarized" in mi.variant():
        raise SceneError(
            f"the active Mitsuba variant is {mi.variant()!r}; allowed: llvm_ad_rgb, scalar_rgb, cuda_ad_rgb"
        )
    problem = variant.active_llvm_problem(mi)
    if problem:
        warnings.warn(
            f"{problem}: rendering may end the process; use scalar_rgb or a newer LLVM", stacklevel=3
        )
    return mi


def _safe(name: str) -> str:
    """A name as Mitsuba's dictionaries take it: no dots, no slashes."""
    return re.sub(r"[^0-9A-Za-z_-]", "_", name)


def _rgb(color: NDArray[np.float32]) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(c) for c in color]}


def _light(
    mi: Any, light: AreaLight | SpotLight, anchor: NDArray[np.float64]
) -> list[tuple[str, dict[str, Any]]]:
    if isinstance(light, SpotLight):
        return [("", _spot(mi, light, anchor))]
    if not light.visible:
        return [("", _invisible(mi, light, anchor))]
    if not light.two_sided:
        return [("", _rectangle(mi, light, anchor, 0.0, 1.0))]
    gap = _TWO_SIDED_GAP * float(min(np.linalg.norm(light.edge_u), np.linalg.norm(light.edge_v)))
    front = _rectangle(mi, light, anchor, 0.5 * gap, 1.0)
    return [("_front", front), ("_back", _rectangle(mi, light, anchor, -0.5 * gap, -1.0))]


def _rectangle(
    mi: Any, light: AreaLight, anchor: NDArray[np.float64], lift: float, side: float
) -> dict[str, Any]:
    """A black rectangle that emits on one side (`side` −1: the one away from cross(edge_u, edge_v))."""
    matrix = np.eye(4)
    normal = light.normal
    matrix[:3, 0], matrix[:3, 1] = 0.5 * light.edge_u, 0.5 * light.edge_v
    matrix[:3, 2] = side * 0.5 * np.sqrt(light.area) * normal
    matrix[:3, 3] = light.corner - anchor + 0.5 * (light.edge_u + light.edge_v) + lift * normal
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f(matrix),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
        "emitter": {"type": "area", "radiance": _radiance(mi, light)},
    }


def _invisible(mi: Any, light: AreaLight, anchor: NDArray[np.float64]) -> dict[str, Any]:
    return {
        "type": plugins.INVISIBLE_LIGHT,
        "corner": (light.corner - anchor).tolist(),
        "edge_u": light.edge_u.tolist(),
        "edge_v": light.edge_v.tolist(),
        "two_sided": light.two_sided,
        "radiance": _radiance(mi, light),
    }


def _radiance(mi: Any, light: AreaLight) -> dict[str, Any]:
    """Constant or image; Mitsuba's rectangle has row 0 at v = 0, ours at b = 1, so rows are flipped."""
    if not light.is_textured:
        return _rgb(light.radiance)
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.array(light.radiance[::-1])),
        "raw": True,
        "filter_type": "bilinear" if light.filter == "linear" else "nearest",
        "wrap_mode": "clamp",
    }


def _spot(mi: Any, light: SpotLight, anchor: NDArray[np.float64]) -> dict[str, Any]:
    """A spot whose beam is as wide as its cone: no falloff, a hard edge."""
    axis = light.direction
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = side, np.cross(axis, side), axis
    matrix[:3, 3] = light.position - anchor
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f(matrix),
        "intensity": _rgb(light.intensity),
        "cutoff_angle": light.cutoff,
        "beam_width": light.cutoff,
    }


def _sensor(
    mi: Any, scene: Scene, camera: Camera, spp: int, sampler: str, pixel: Pixel, anchor: NDArray[np.float64]
) -> dict[str, Any]:
    common = {
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": sampler, "sample_count": spp},
    }
    pose = np.array(camera.world_from_camera)
    pose[:3, 3] -= anchor
    (fx, _, cx), (_, fy, cy), _ = camera.K.tolist()
    if pixel == "center" or fx != fy:
        own = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "pixel_centre": pixel == "center"}
        return {"type": plugins.PINHOLE, "to_world": mi.ScalarTransform4f(pose), **own, **common}
    far = _FAR * _reach(scene, camera)
    return {
        "type": "perspective",
        # Mitsuba's camera looks down +Z with +X to the left
        "to_world": mi.ScalarTransform4f(pose @ np.diag([-1.0, 1.0, -1.0, 1.0])),
        "fov_axis": "x",
        "fov": float(np.degrees(2.0 * np.arctan(0.5 * camera.width / fx))),
        # … and shifts the picture, not the axis
        "principal_point_offset_x": 0.5 - cx / camera.width,
        "principal_point_offset_y": 0.5 - cy / camera.height,
        "near_clip": _NEAR * far,
        "far_clip": far,
        **common,
    }


def _reach(scene: Scene, camera: Camera) -> float:
    """Distance from the camera to the farthest corner of the scene, at least a little."""
    bounds = scene_bounds(scene)
    corners = np.array(np.meshgrid(*bounds.T)).reshape(3, -1).T
    reach = float(np.linalg.norm(corners - camera.origin, axis=1).max())
    return reach if reach > 0.0 else 1.0
