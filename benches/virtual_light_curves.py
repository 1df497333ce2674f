"""Times of papers A's and B's presets by what they depend on: their tables and figures of frame rates."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import scipy.spatial

import measure
import miplight as ml
from bounds import Row, row
from tests.claim_scenes import CLAIMS, available

GROUPS = {
    "maps": ("rsm_rays", "rsm_trace", "rsm_tree", "vpl_grid", "vpl_clusters"),
    "pyramid": ("pyramid",),
    "stencil": ("one_pass", "iterative", "fragment_list", "fragment_receivers"),
    "transport": ("vpl_gather", "vpl_splat", "light_cut"),
    "upsampling": ("edge_aware",),
}
"""Stages as [NSW09 Table 1] has them; direct light and the rest are what is left."""
PATH = 12
"""Places of the light along its path."""

Place = tuple[ml.Scene, ml.Camera]


def off(name: str, **changes: Any) -> ml.Settings:
    """A preset without direct light and without occlusion, as in the papers."""
    return ml.Settings.preset(name).replace(direct="off", indirect_visibility="off", **changes)


def _groups(timed: dict[str, Any]) -> dict[str, float]:
    found = {
        group: sum(ms for stage, ms in timed["stages"].items() if stage.partition("/")[2] in stages)
        for group, stages in GROUPS.items()
    }
    return found | {"direct and the rest": timed["wall_ms"] - sum(found.values())}


def stages(renderer: ml.Renderer, place: Place, options: argparse.Namespace) -> Iterator[Row]:
    """B's Table 1: what each stage takes with 256 virtual lights, gathered and splatted; milliseconds."""
    size = place[1].width
    places = {"room, scan": place}
    if "sponza" in available():
        side = 64 if options.quick else 1024
        places["Sponza"] = CLAIMS["sponza"].build(side, side)
    ways = {
        "gather": ml.Settings.preset("radiosity-2009").replace(indirect="gather", vpls=256),
        "splats": ml.Settings.preset("splatting-2009"),
    }
    for scene, at in places.items():
        for way, settings in ways.items():
            timed = measure.frames(renderer, *at, settings)
            for group, ms in _groups(timed).items():
                yield row(f"Table 1, {way}: {group}, ms", scene, size, ms, None)


def resolutions(renderer: ml.Renderer, place: Place, options: argparse.Namespace) -> Iterator[Row]:
    """A's Table 1 and Fig. 8: frames by resolution and by number of virtual lights; milliseconds."""
    scene, camera = place
    for size in (32, 64) if options.quick else (256, 512, 1024, 2048):
        at = camera.replace(width=size, height=size)
        for name in ("splatting-2009", "radiosity-2009", "hierarchical-2009"):
            ms = measure.frames(renderer, scene, at, off(name))["wall_ms"]
            yield row(f"A Table 1, {name}, ms", "room, scan", size, ms, None)
    for count in (16, 64) if options.quick else (16, 64, 256, 1024):
        for way in ("splat", "gather"):
            settings = off("splatting-2009", indirect=way, vpls=count)
            ms = measure.frames(renderer, scene, camera, settings)["wall_ms"]
            yield row(
                f"A Fig. 8, {way}, {count} lights, ms", "room, scan", camera.width, ms, None, lights=count
            )


def dials(renderer: ml.Renderer, place: Place, options: argparse.Namespace) -> Iterator[Row]:
    """B's Figs. 11 and 12: coarsest clusters by threshold, deepest cut by threshold; milliseconds."""
    size = place[1].width
    sides = (4, 8) if options.quick else (4, 8, 16)
    for side in sides:
        for threshold in (0.02, 0.1, 0.25, 1.0):
            changes = {"cluster_depth_threshold": threshold, "cluster_normal_threshold": 2 * threshold}
            timed = measure.frames(renderer, *place, off("radiosity-2009", coarsest_vpls=side**2, **changes))
            what = f"Fig. 11, from {side} x {side} clusters, threshold {threshold:g}, ms"
            yield row(what, "room, scan", size, timed["wall_ms"], None, pairs=timed["light_evaluations"])
    for most in (32, 64, 128, 256):
        for threshold in (0.02, 0.1, 0.5):
            settings = off("hierarchical-2009", vpls=most**2, light_cut_threshold=threshold)
            timed = measure.frames(renderer, *place, settings)
            what = f"Fig. 12, down to {most} x {most}, threshold {threshold:g}, ms"
            yield row(what, "room, scan", size, timed["wall_ms"], None, pairs=timed["light_evaluations"])


def _radius(places: Any, lights: Any, pairs: float) -> float:
    """Radius within which the places have so many pairs with the lights."""
    tree, low, high = scipy.spatial.cKDTree(places), 0.0, 1e3
    for _ in range(40):
        middle = (low + high) / 2
        count = tree.query_ball_point(lights, middle, return_length=True).sum()
        low, high = (middle, high) if count < pairs else (low, middle)
    return high


def limited(renderer: ml.Renderer, place: Place) -> Iterator[Row]:
    """B's Fig. 8: splats of limited reach at every pixel [DS06], and at fragments, with as many pairs."""
    size = place[1].width
    every = off("splatting-2009", refine="none")
    full = renderer.render(*place, every, ("indirect", "position", "surface_mask"), ("rsm", "virtual_lights"))
    fragments = off("splatting-2009", refine="one-pass", coarsest_level=3, normal_threshold=0.1)
    assert full.virtual_lights is not None
    lights = full.virtual_lights.lights
    assert lights is not None
    pairs = renderer.render(*place, fragments, ("indirect",)).stats.light_evaluations
    seen = full.surface_mask
    lit = lights["position"][lights["flux"].sum(axis=1) > 0]
    radius = _radius(full.position[seen], lit, pairs)
    ways = {"at fragments": fragments, f"within {radius:.2g}": every.replace(vpl_radius=radius)}
    for what, settings in ways.items():
        found = renderer.render(*place, settings, ("indirect",)).indirect
        error = ml.metrics.relative_rmse(found, full.indirect, mask=seen, trim=0.001)
        ms = measure.frames(renderer, *place, settings)["wall_ms"]
        yield row(f"Fig. 8, splats {what}, error", "room, scan", size, error, None, pairs=pairs)
        yield row(f"Fig. 8, splats {what}, ms", "room, scan", size, ms, None)


def path(renderer: ml.Renderer, place: Place, options: argparse.Namespace) -> Iterator[Row]:
    """B's Fig. 10: frames while the light moves; milliseconds."""
    scene, camera = place
    ways = {"clusters down to 64 x 64": off("radiosity-2009")}
    for threshold in (0.02, 0.1, 0.5):
        ways[f"cut, threshold {threshold:g}"] = off("hierarchical-2009", light_cut_threshold=threshold)
    spot = scene.lights["spot"]
    assert isinstance(spot, ml.SpotLight)
    aim = spot.target
    for step in range(3 if options.quick else PATH):
        spot.target = (0.9 - 0.15 * step, 0.6, -0.6)
        for name, settings in ways.items():
            ms = measure.frames(renderer, scene, camera, settings)["wall_ms"]
            yield row(f"Fig. 10, {name}, step {step}, ms", "room, scan", camera.width, ms, None, step=step)
    spot.target = aim
