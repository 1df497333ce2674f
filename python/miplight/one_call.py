"""The one-call render: meshes, a camera and lights in, a frame out."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .camera import Camera
from .frame import Frame
from .light import AreaLight
from .renderer import DEFAULT_OUTPUTS, Renderer, camera_from_matrix
from .scene import Scene
from .settings import Settings, as_settings
from .spot import SpotLight
from .validate import as_numbers, fail

_shared: dict[tuple[int, str], Renderer] = {}
_shared_lock = threading.Lock()


def render(
    meshes: Any,
    camera: Camera | ArrayLike,
    lights: Any = None,
    settings: Settings | str | None = "default",
    outputs: Iterable[str] = DEFAULT_OUTPUTS,
    keep: Iterable[str] = (),
    *,
    fov_y: float | None = None,
    size: tuple[int, int] | None = None,
    adapter: str = "auto",
) -> Frame:
    """Render meshes lit by lights, in one call.

    The renderer behind it is kept for the next call; `Renderer` gives more control.

    Parameters
    ----------
    meshes
        A `trimesh.Trimesh`, a `trimesh.Scene`, a list of them, or a `Scene` (whose own lights shine too).
    camera
        `Camera`, or a (4, 4) `world_from_camera`, which needs `fov_y` and `size`.
    lights
        (N, 12) floats, a row per light: corner, edge_u, edge_v, radiance (W·sr⁻¹·m⁻²); or an `AreaLight`,
        a `SpotLight`, or a list of them. None for no more lights than a `Scene` has.
    settings
        `Settings`, the name of a preset, or None for the default.
    outputs, keep
        As for `Renderer.render`.
    fov_y
        Vertical field of view, degrees, for a (4, 4) camera.
    size
        (width, height) in pixels, for a (4, 4) camera.
    adapter
        As for `Renderer`.

    Returns
    -------
    Frame

    Raises
    ------
    SceneError, SettingsError, DeviceError
        As for `Renderer.render`.
    """
    knobs = as_settings(settings)
    if isinstance(camera, Camera):
        for name, value in (("fov_y", fov_y), ("size", size)):
            if value is not None:
                fail(name, value, "None, because the camera has its own")
    else:
        camera = camera_from_matrix(camera, fov_y, size)
    scene = meshes.copy() if isinstance(meshes, Scene) else Scene.from_trimesh(meshes)
    for light in as_lights(lights):
        scene.add_light(light)
    return _renderer(adapter).render(scene, camera, knobs, outputs, keep)


def as_lights(lights: Any) -> list[AreaLight | SpotLight]:
    """Lights from (N, 12) floats, a light, a list of lights, or None.

    Raises
    ------
    SceneError
        If they are none of these.
    """
    allowed = "numbers of shape (N, 12) (corner, edge_u, edge_v, radiance), lights, or None"
    if lights is None:
        return []
    if isinstance(lights, (AreaLight, SpotLight)):
        return [lights]
    if isinstance(lights, (list, tuple)) and all(isinstance(x, (AreaLight, SpotLight)) for x in lights):
        return list(lights)
    rows = as_numbers(lights, "lights", allowed)
    if rows.ndim != 2 or rows.shape[1] != 12:
        fail("lights", rows, allowed)
    # an integer array has integer radiance, which is refused with a hint; plain lists may hold whole numbers
    table = rows.astype(np.float64) if isinstance(lights, (list, tuple)) else rows
    return [AreaLight(row[0:3], row[3:6], row[6:9], radiance=row[9:12]) for row in table]


def _renderer(adapter: str) -> Renderer:
    # one for each process: a device does not survive a fork
    key = (os.getpid(), adapter)
    with _shared_lock:
        if key not in _shared:
            _shared[key] = Renderer(adapter)
        return _shared[key]
