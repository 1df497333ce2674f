"""How a time is taken: warm, moving, in the middle of five."""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np

import miplight as ml

OUTPUTS = ("image", "fragments")
WARM_UP = 2
FRAMES = 5
LONG_S = 5.0  # a frame that takes longer is measured once


def _moved(camera: ml.Camera, step: int) -> ml.Camera:
    """A little to the side, by a ten-thousandth of what lies between the eye and the origin, or so."""
    pose = np.array(camera.world_from_camera)
    reach = max(float(np.linalg.norm(pose[:3, 3])), 1.0)
    pose[:3, 3] += pose[:3, 0] * reach * 1e-4 * step
    return camera.replace(world_from_camera=pose)


def _dim(scene: ml.Scene, step: int) -> None:
    """Change every light's radiance by a thousandth."""
    factor = 1.001 if step % 2 else 1 / 1.001
    for light in scene.lights.values():
        if isinstance(light, ml.AreaLight):
            light.radiance = light.radiance * np.float32(factor)
        else:
            light.intensity = light.intensity * np.float32(factor)


def _render(renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings) -> Any:
    start = time.perf_counter()
    frame = renderer.render(scene, camera, settings, OUTPUTS)
    return 1000.0 * (time.perf_counter() - start), frame.stats


def frames(
    renderer: ml.Renderer,
    scene: ml.Scene,
    camera: ml.Camera,
    settings: ml.Settings,
    *,
    move: bool = True,
    light: bool = True,
) -> dict[str, Any]:
    """Median wall time, and the passes of the frame in the middle.

    Parameters
    ----------
    renderer, scene, camera, settings
        What is rendered; the scene's lights end as they were, to a few roundings.
    move, light
        Whether the camera and the lights change before each frame: both by default, so that nothing of the
        last frame can be returned.

    Returns
    -------
    dict
        wall_ms, frames (how many were measured), stages {pass: ms}, rays, light_evaluations, rebuilt.
    """
    taken: list[tuple[float, ml.Stats]] = []
    step, wanted = 0, FRAMES
    while len(taken) < WARM_UP + wanted:
        step += 1
        if light:
            _dim(scene, step)
        taken.append(_render(renderer, scene, _moved(camera, step) if move else camera, settings))
        if taken[-1][0] > 1000.0 * LONG_S:
            wanted = 1
    if light and step % 2:
        _dim(scene, step + 1)
    measured = taken[WARM_UP:]
    middle = statistics.median_low([wall for wall, _ in measured])
    stats = next(stats for wall, stats in measured if wall == middle)
    return {
        "wall_ms": middle,
        "frames": len(measured),
        "total_ms": stats.total_ms,
        "stages": stats.stages,
        "rays": stats.rays,
        "light_evaluations": stats.light_evaluations,
        "rebuilt": stats.rebuilt,
    }


def least(
    renderer: ml.Renderer,
    scene: ml.Scene,
    camera: ml.Camera,
    ways: dict[str, ml.Settings],
    stages: tuple[str, ...],
    repeats: int = 15,
) -> dict[str, float]:
    """Least time of some stages together, named without their group, of ways that take turns."""
    found = {name: float("inf") for name in ways}
    for step in range(WARM_UP + repeats):
        for name, settings in ways.items():
            _dim(scene, step)
            _, stats = _render(renderer, scene, _moved(camera, step), settings)
            ms = sum(ms for stage, ms in stats.stages.items() if stage.partition("/")[2] in stages)
            found[name] = min(found[name], ms)
    return found


def _traces(stage: str) -> bool:
    """Whether the pass traces rays; steps through voxels are none."""
    return stage.endswith(("/trace", "/shadow", "_trace", "_shadow")) and not stage.endswith("/voxel_shadow")


def rays_per_second(row: dict[str, Any]) -> float:
    """Rays of all kinds by the time of the passes that trace."""
    tracing = sum(ms for name, ms in row["stages"].items() if _traces(name))
    return float(row["rays"] / (tracing / 1000.0)) if tracing > 0 else 0.0
