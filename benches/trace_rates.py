"""Rays per second of both forms of the trace, and of Mitsuba's Embree, as renders need them.

Coherent rays are the shadow rays of direct light; hemisphere rays are those of a final gather. Mitsuba's
direct light traces two rays a sample.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh

import miplight as ml
from miplight.one_call import as_lights

TRIANGLES = (1_000, 10_000, 100_000)
SIZE = 256
SAMPLES = {"native": 256, "wgsl": 16}  # of the light; the slow form gets fewer
GATHER_RAYS = {"native": 64, "wgsl": 4}
MITSUBA_SAMPLES = 256


def _room(triangles: int) -> tuple[ml.Scene, ml.Camera]:
    place = ml.shapes.room(boxes=False)
    scene = ml.Scene.from_trimesh(place)
    lift = trimesh.transformations.translation_matrix((0.0, 1.2, 0.0))
    scene.add_mesh(ml.shapes.displaced_sphere(triangles), name="sphere", transform=lift)
    for light in as_lights(place.metadata["lights"]):
        scene.add_light(light)
    return scene, ml.Camera.look_at(**place.metadata["view"], width=SIZE, height=SIZE)


def _best(renderer: ml.Renderer, job: tuple[ml.Scene, ml.Camera], settings: ml.Settings, stage: str) -> Any:
    """The frame with the shortest `stage` of three, after one that warms up."""
    frames = [renderer.render(*job, settings) for _ in range(4)][1:]
    return min(frames, key=lambda frame: frame.stats.stages[stage])


def _rates_of(form: str, adapter: str) -> Iterator[dict[str, Any]]:
    with ml.Renderer(adapter, trace=form) as renderer:
        for triangles in TRIANGLES:
            job = _room(triangles)
            direct = ml.Settings(light_samples=SAMPLES[form])
            frame = _best(renderer, job, direct, "direct/shadow")
            shadow = frame.stats.rays - SIZE * SIZE  # all but the primary rays
            yield _rate("shadow", triangles, form, shadow, frame.stats.stages["direct/shadow"])
            gather = ml.Settings(direct="off", indirect="final-gather", gather_rays=GATHER_RAYS[form])
            frame = _best(renderer, job, gather, "indirect/trace")
            rays = int(np.count_nonzero(frame.surface_mask)) * GATHER_RAYS[form]
            yield _rate("hemisphere", triangles, form, rays, frame.stats.stages["indirect/trace"])


def _rate(kind: str, triangles: int, form: str, rays: int, ms: float) -> dict[str, Any]:
    return {
        "kind": kind,
        "triangles": triangles,
        "form": form,
        "rays": rays,
        "ms": ms,
        "rays_per_second": rays / (ms / 1000.0),
    }


def _mitsuba_rates() -> Iterator[dict[str, Any]]:
    for triangles in TRIANGLES:
        scene, camera = _room(triangles)
        with ml.mitsuba.activate() as mi:
            loaded = mi.load_dict(ml.mitsuba.to_dict(scene, camera, max_depth=2))
            times = []
            for seed in range(4):
                start = time.perf_counter()
                np.array(mi.render(loaded, spp=MITSUBA_SAMPLES, seed=seed))
                times.append(1000.0 * (time.perf_counter() - start))
        rays = 2 * SIZE * SIZE * MITSUBA_SAMPLES
        yield _rate("primary and shadow", triangles, "Mitsuba", rays, min(times[1:]))


def measure(adapter: str, mitsuba: bool) -> list[dict[str, Any]]:
    """One row for each kind of ray, mesh size and form.

    Parameters
    ----------
    adapter
        As for `miplight.Renderer`; the native form is left out where the adapter is no software.
    mitsuba
        Whether Mitsuba is measured as well.
    """
    with ml.Renderer(adapter) as renderer:
        forms = ["native", "wgsl"] if renderer.adapter["software"] else ["wgsl"]
    rows = [row for form in forms for row in _rates_of(form, adapter)]
    return rows + (list(_mitsuba_rates()) if mitsuba else [])
