"""Mitsuba emitters: area on a parallelogram, and spot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from miplight.errors import SceneError
from miplight.light import AreaLight
from miplight.spot import SpotLight

from .materials import surface_of
from .nodes import Document, Node
from .shapes import Triangles, triangles_of

if TYPE_CHECKING:
    from miplight.scene import Scene

__all__ = ["add_area_light", "add_spot"]

# Four points are a parallelogram when the fourth is where the other three say, within this part of its size.
_SLACK = 1e-4


def add_area_light(document: Document, scene: Scene, node: Node) -> None:
    """Add a shape that emits, if it is a parallelogram.

    Raises
    ------
    SceneError
        For another shape or emitter.
    """
    emitter = node.children("Emitter")[0]
    if emitter.plugin != "area":
        raise SceneError(f"emitter is {emitter.plugin!r}; allowed: area")
    name = document.free_name(node, "light", [*scene.meshes, *scene.lights])
    shape = (
        triangles_of(document, node, name)
        if node.plugin in ("rectangle", "obj", "ply", "serialized")
        else None
    )
    if shape is None:
        raise SceneError(
            f"an area emitter is on a {node.plugin!r}; allowed: a rectangle or a mesh of two triangles"
        )
    radiance, linear = _radiance(document, emitter)
    corner, edge_u, edge_v, swapped = _parallelogram(node, shape)
    if radiance.ndim == 3:
        if node.plugin != "rectangle":
            raise SceneError("a textured area emitter is on a mesh; allowed: on a rectangle")
        if swapped:
            radiance = radiance.transpose(1, 0, 2)
        # Mitsuba's row 0 is at v = 0, ours at b = 1
        radiance = np.ascontiguousarray(radiance[::-1])
    if not surface_of(document, node).is_black:
        document.note("its surface reflects in the file, and is black here", name)
    light = AreaLight(corner, edge_u, edge_v, radiance, filter="linear" if linear else "nearest")
    scene.add_light(light, name=name)


def add_spot(document: Document, scene: Scene, node: Node) -> None:
    """Add a spot emitter, with a hard edge at its cutoff.

    Raises
    ------
    SceneError
        For a cone wider than 80 degrees or a projected texture.
    """
    if node.get("texture") is not None:
        raise SceneError("the spot projects a texture; allowed: none")
    name = document.free_name(node, "spot", [*scene.meshes, *scene.lights])
    matrix = node.matrix()
    parameters = dict(document.mi.traverse(document.instantiate(node.as_dict("to_world"))))
    cutoff, beam = float(parameters["cutoff_angle"]), float(parameters["beam_width"])
    intensity = np.broadcast_to(np.asarray(parameters["intensity.value"], dtype=np.float64), 3)
    if beam < cutoff:
        document.note("its beam falls off towards the cutoff in the file, and ends there at once here", name)
    position = matrix[:3, 3]
    scene.add_light(SpotLight(position, position + matrix[:3, 2], intensity, cutoff), name=name)


def _radiance(document: Document, emitter: Node) -> tuple[NDArray[np.float64], bool]:
    """Emitted radiance, (3,) or (h, w, 3) with row 0 at v = 0, and whether it is interpolated."""
    parameters: dict[str, Any] = dict(document.mi.traverse(document.instantiate(emitter.as_dict())))
    texture = emitter.get("radiance")
    if "radiance.value" in parameters:
        return np.broadcast_to(np.asarray(parameters["radiance.value"], dtype=np.float64), 3), False
    if not isinstance(texture, Node) or texture.plugin != "bitmap":
        raise SceneError("radiance is a texture that is no bitmap; allowed: a colour or a bitmap")
    texels = np.array(parameters["radiance.data"])
    if texels.dtype == np.uint8:
        raise SceneError("radiance is an 8-bit image; allowed: a float image, such as EXR")
    if not np.allclose(np.array(parameters["radiance.to_uv"].matrix), np.eye(3)):
        raise SceneError("radiance is a bitmap with a to_uv transform; allowed: none")
    texels = texels.astype(np.float64).reshape(*texels.shape[:2], -1)
    channels = texels[..., :3] if texels.shape[-1] >= 3 else texels[..., :1]
    linear = texture.get("filter_type", "bilinear") == "bilinear"
    return np.broadcast_to(channels, (*channels.shape[:2], 3)), linear


def _parallelogram(
    node: Node, shape: Triangles
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], bool]:
    """Corner and edges in world space, ordered so that cross(edge_u, edge_v) is the side that emits.

    The last value says whether the edges were exchanged for it.
    """
    if node.plugin == "rectangle":
        # its corners stay where its image is upright: u from the first to the second, v to the fourth
        corners, normal = shape.positions, np.array([0.0, 0.0, 1.0])
    else:
        corners, normal = _four_corners(shape)
    matrix = node.matrix()
    world = corners @ matrix[:3, :3].T + matrix[:3, 3]
    side = np.linalg.inv(matrix[:3, :3]).T @ normal
    if node.get("flip_normals", False):
        side = -side
    corner, edge_u, edge_v = world[0], world[1] - world[0], world[3] - world[0]
    swapped = bool(np.dot(np.cross(edge_u, edge_v), side) < 0.0)
    return (corner, edge_v, edge_u, swapped) if swapped else (corner, edge_u, edge_v, swapped)


def _four_corners(shape: Triangles) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Four corners in order around, and the normal of the side that emits, in object space."""
    points, index = np.unique(shape.positions[shape.triangles.ravel()], axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    if len(faces) != 2 or len(points) != 4:
        raise SceneError(
            f"an area emitter is on a mesh of {len(faces)} triangles; allowed: a parallelogram of two"
        )
    first, second = faces
    shared = np.intersect1d(first, second)
    if len(shared) != 2:
        raise SceneError("an area emitter is on two triangles that share no edge; allowed: a parallelogram")
    # start at the corner of the first triangle that the second lacks, and go around as the first is wound
    alone = int(np.setdiff1d(first, second)[0])
    start = int(np.flatnonzero(first == alone)[0])
    opposite = int(np.setdiff1d(second, first)[0])
    order = [alone, int(first[(start + 1) % 3]), opposite, int(first[(start + 2) % 3])]
    corners = points[order]
    size = np.ptp(points, axis=0).max()
    if np.abs(corners[0] + corners[2] - corners[1] - corners[3]).max() > _SLACK * size:
        raise SceneError(f"an area emitter is on the quad {corners.tolist()}; allowed: a parallelogram")
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    if shape.normals is not None and np.dot(shape.normals.mean(axis=0), normal) < 0.0:
        normal = -normal  # Mitsuba emits on the side of the shading normal
    return corners, normal
