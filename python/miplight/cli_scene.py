"""What the command line renders: a file, with a camera and a light found for it where it has none."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from .camera import Camera
from .errors import SceneError
from .light import AreaLight
from .scene import Scene

__all__ = ["View", "load", "notes"]

# from the middle of what there is, in units of its size
_FROM_THE_FRONT = np.array([0.6, 0.5, 1.6])
_SIZE = (512, 512)
_FOV_Y = 40.0
_NOTES = 6  # of a file; `--verbose` has them all

Point = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class View:
    """From where a file is seen; what is None is taken from the file, or found.

    Parameters
    ----------
    camera
        Name of a camera of the file.
    size
        Width and height, pixels.
    origin, target
        Where the eye is and what it looks at, scene units; in place of a camera of the file.
    fov_y
        Vertical field of view, degrees.
    light
        Where a light is added, scene units.
    """

    camera: str | None = None
    size: tuple[int, int] | None = None
    origin: Point | None = None
    target: Point | None = None
    fov_y: float | None = None
    light: Point | None = None


def load(source: Path, view: View) -> tuple[Scene, Camera, list[str]]:
    """Read a file.

    Returns
    -------
    scene, camera
        What is rendered.
    added
        What the file did not have and was found for it, in words.

    Raises
    ------
    SceneError
        If it cannot be read, has nothing to look at, or has no camera of that name.
    """
    is_mitsuba = source.suffix.lower() == ".xml"
    scene = Scene.from_mitsuba(str(source)) if is_mitsuba else Scene.from_trimesh(source)
    if not scene.meshes:
        raise SceneError(f"{source} has no mesh; allowed: a file with triangles")
    camera, added = _view(scene, view)
    if view.light is not None:
        scene.add_light(_light(scene, view.light))
        added.append("a light")
    elif not scene.lights:
        scene.add_light(_light(scene, None))
        added.append("a light above it")
    return scene, camera, added


def notes(scene: Scene, everything: bool = False) -> list[str]:
    """What was dropped or is lit in another way than the file has it, a line each."""
    report = scene.report
    by_note: dict[str, list[str]] = {}
    for name, mesh in report.items():
        for note in mesh.notes:
            by_note.setdefault(note, []).append(name)
    lines = [f"{_listed(names)}: {note}" for note, names in by_note.items()]
    lines += report.notes
    if report.dropped:
        lines.append(f"{report.dropped:,} triangles without area or with a NaN were dropped")
    if everything or len(lines) <= _NOTES:
        return lines
    return [*lines[:_NOTES], f"{len(lines) - _NOTES} more; --verbose shows them"]


def _listed(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _view(scene: Scene, view: View) -> tuple[Camera, list[str]]:
    """A camera of the file, or one that looks at everything from the front."""
    placed = view.origin is not None or view.target is not None
    if view.camera is not None and placed:
        raise SceneError("--camera and --origin or --target were both given; allowed: one of the two")
    if view.camera is not None and view.camera not in scene.cameras:
        known = ", ".join(scene.cameras) or "none"
        raise SceneError(f"--camera is {view.camera!r}; the file has: {known}")
    if scene.cameras and not placed:
        camera = scene.cameras[view.camera or next(iter(scene.cameras))]
        width, height = view.size or (camera.width, camera.height)
        camera = camera.replace(width=width, height=height)
        return (camera if view.fov_y is None else camera.replace(fov_y=view.fov_y)), []
    bounds = scene.bounds
    if bounds is None:
        raise SceneError("the file has neither a camera nor a mesh")
    middle, extent = bounds.mean(axis=0), max(float((bounds[1] - bounds[0]).max()), 1e-30)
    target = middle if view.target is None else np.array(view.target)
    origin = middle + extent * _FROM_THE_FRONT if view.origin is None else np.array(view.origin)
    width, height = view.size or _SIZE
    # straight up or down there is no up
    up = (0.0, 1.0, 0.0) if np.abs((target - origin)[[0, 2]]).max() > 1e-6 * extent else (0.0, 0.0, -1.0)
    fov_y = _FOV_Y if view.fov_y is None else view.fov_y
    camera = Camera.look_at(origin, target, up=up, fov_y=fov_y, width=width, height=height)
    return camera, [] if placed else ["a camera in front of it"]


def _light(scene: Scene, place: Point | None) -> AreaLight:
    """A square light that shines down: over the scene and half as wide, or small about a point."""
    bounds = scene.bounds
    if bounds is None:
        raise SceneError("the file has no mesh")
    extent = max(float((bounds[1] - bounds[0]).max()), 1e-30)
    middle, half, radiance = bounds.mean(axis=0), 0.25 * extent, 12.0
    middle[1] = bounds[1, 1] + extent
    if place is not None:
        middle, half, radiance = np.array(place), 0.02 * extent, 200.0
    corner = middle - (half, 0.0, half)
    return AreaLight(corner, (2 * half, 0, 0), (0, 0, 2 * half), radiance=(radiance,) * 3, visible=False)
