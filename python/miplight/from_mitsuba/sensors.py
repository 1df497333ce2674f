"""Mitsuba sensors as pinhole cameras."""

from __future__ import annotations

import math
import re

import numpy as np

from miplight.camera import Camera
from miplight.errors import SceneError

from .nodes import Document, Node

__all__ = ["camera_of"]

# Mitsuba's defaults
_FILM_SIZE = (768, 576)
_FOCAL_LENGTH = "50mm"
_FILM_DIAGONAL_35MM = math.hypot(36.0, 24.0)


def camera_of(document: Document, node: Node) -> Camera:
    """Convert a perspective sensor, with its crop and its principal point.

    Raises
    ------
    SceneError
        For another sensor, a pose that is scaled or mirrored, or a field of view that makes no sense.
    """
    if node.plugin not in ("perspective", "thinlens"):
        raise SceneError(f"sensor is {node.plugin!r}; allowed: perspective, thinlens")
    name = node.id or node.plugin
    if node.plugin == "thinlens":
        document.note("its lens became a pinhole", name)
    films = node.children("Film")
    film = films[0] if films else None

    def size(key: str, default: int) -> int:
        return int(film.get(key, default)) if film is not None else default

    width, height = size("width", _FILM_SIZE[0]), size("height", _FILM_SIZE[1])
    if width < 1 or height < 1:
        raise SceneError(f"film is {width} x {height}; allowed: at least one pixel")
    focal = _focal_in_pixels(node, width, height)
    # Mitsuba's offset shifts the picture: the principal point moves the other way
    cx = width * (0.5 - float(node.get("principal_point_offset_x", 0.0))) - size("crop_offset_x", 0)
    cy = height * (0.5 - float(node.get("principal_point_offset_y", 0.0))) - size("crop_offset_y", 0)
    # Mitsuba's camera looks down +Z with +X to the left
    world_from_camera = node.matrix() @ np.diag([-1.0, 1.0, -1.0, 1.0])
    columns, rows = size("crop_width", width), size("crop_height", height)
    if cx == 0.5 * columns and cy == 0.5 * rows:
        fov_y = math.degrees(2.0 * math.atan(0.5 * rows / focal))
        return Camera(world_from_camera, fov_y, columns, rows)
    K = [[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]]
    return Camera.from_intrinsics(K, world_from_camera, columns, rows)


def _focal_in_pixels(node: Node, width: int, height: int) -> float:
    """Focal length in pixels, from the field of view along its axis or a 35 mm focal length."""
    fov, length = node.get("fov"), node.get("focal_length")
    axis = str(node.get("fov_axis", "x"))
    if fov is None:
        text = str(length if length is not None else _FOCAL_LENGTH)
        match = re.fullmatch(r"([0-9.]+)\s*(?:mm)?", text.strip())
        if match is None or float(match.group(1)) <= 0.0:
            raise SceneError(f"focal_length is {text!r}; allowed: millimetres, such as '50mm'")
        fov = math.degrees(2.0 * math.atan(0.5 * _FILM_DIAGONAL_35MM / float(match.group(1))))
        axis = "diagonal"
    extents = {
        "x": width,
        "y": height,
        "diagonal": math.hypot(width, height),
        "smaller": min(width, height),
        "larger": max(width, height),
    }
    if axis not in extents:
        raise SceneError(f"fov_axis is {axis!r}; allowed: {', '.join(extents)}")
    angle = float(fov)
    if not 0.0 < angle < 180.0:
        raise SceneError(f"fov is {angle}; allowed: above 0 and below 180 degrees")
    return 0.5 * extents[axis] / math.tan(0.5 * math.radians(angle))
