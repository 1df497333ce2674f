"""`make bench-virtual-lights`: what papers A and B must show: each row with its bound, pass or FAIL.

    python benches/virtual_lights.py --only transport
    python benches/virtual_lights.py --quick            # small pictures, few samples: does it run at all

A room with a scan under a spot. Errors are relative RMSE of indirect light, trimmed by 0.1 % as everywhere;
times by the rules of `measure.frames`, all in one run.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the scenes are shared with the tests


import measure
import miplight as ml
import virtual_light_curves as curves
from bounds import Parts, Row, main, row
from run import RESULTS
from tests.claim_scenes import available, scan_mesh
from virtual_light_curves import off
from virtual_light_plots import draw

TRIM = 0.001
PRESETS = ("splatting-2009", "radiosity-2009", "hierarchical-2009")
OUTPUTS = ("image", "indirect", "surface_mask", "fragments")


def place(size: int, triangles: int = 20_000) -> tuple[ml.Scene, ml.Camera]:
    """The room, a dragon or a bumpy ball of so many triangles in it, and a spot on both and two walls."""
    scene = ml.Scene.from_trimesh(ml.shapes.room(boxes=False))
    if triangles == 20_000 and "dragon_one" in available():
        body = scan_mesh("dragon_20k", 2.4, (0.1, 0.0, 0.0), 25.0)
    else:
        body = ml.shapes.displaced_sphere(triangles, radius=0.8, amplitude=0.5)
        body.apply_transform(trimesh.transformations.translation_matrix((0.2, 0.9, -0.1)))
    scene.add_mesh(body, name="scan", material=ml.Material((0.75, 0.7, 0.6)))
    spot = ml.SpotLight((-1.2, 2.6, 1.6), (0.2, 0.8, -0.6), intensity=(30.0, 26.0, 20.0), cutoff=30.0)
    scene.add_light(spot, name="spot")
    camera = ml.Camera.look_at((0, 1.5, 5.6), (0, 1.5, 4.6), fov_y=45, width=size, height=size)
    return scene, camera


def _shot(renderer: ml.Renderer, at: tuple[ml.Scene, ml.Camera], settings: ml.Settings) -> ml.Frame:
    frame = renderer.render(*at, settings, OUTPUTS)
    assert frame.indirect_fragments is not None  # read while it is there
    return frame


def _error(frame: ml.Frame, other: ml.Frame) -> float:
    return ml.metrics.relative_rmse(frame.indirect, other.indirect, mask=other.surface_mask, trim=TRIM)


def _fragments(frame: ml.Frame) -> int:
    assert frame.indirect_fragments is not None
    return frame.indirect_fragments.total


def errors(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """What eye and light clusters cost: B's Sec. 4, and its Fig. 9."""
    size = 96 if options.quick else 512
    at, settings = place(size), off("radiosity-2009")
    every = _shot(renderer, at, settings.replace(refine="none"))
    frame = _shot(renderer, at, settings)
    share = _fragments(frame) / size**2
    yield row("eye clusters, error", "room, scan", size, _error(frame, every), 0.03)
    yield row("eye clusters, fragments a pixel", "room, scan", size, share, 0.15)
    for metric in ("depth_threshold", "normal_threshold"):
        for threshold in (0.0, 0.02, 0.05, 0.1, 0.25, 1.0):
            frame = _shot(renderer, at, settings.replace(**{metric: threshold}))
            what = f"Fig. 9, {metric} {threshold:g}"
            yield row(what, "room, scan", size, _error(frame, every), None, share=_fragments(frame) / size**2)
    size = 48 if options.quick else 256
    at, settings = place(size), off("hierarchical-2009")
    pairs = 65_536 * size**2
    every = _shot(renderer, at, off("radiosity-2009", refine="none", indirect="gather", vpls=65_536))
    frame = _shot(renderer, at, settings)
    yield row("eye and light clusters, error", "room, scan", size, _error(frame, every), 0.06)
    fewer = pairs / frame.stats.light_evaluations
    yield row("times fewer pairs than 65,536 a pixel", "room, scan", size, fewer, 200, True)
    for threshold in (0.1, 0.05, 0.02, 0.01, 0.005):
        for most in (1024, 4096, 65_536):
            frame = _shot(
                renderer, at, settings.replace(refine="none", vpls=most, light_cut_threshold=threshold)
            )
            what = f"Fig. 13, threshold {threshold:g}, at most {most}"
            fewer = pairs / frame.stats.light_evaluations
            yield row(what, "room, scan", size, _error(frame, every), None, fewer=fewer)


def _ms(timed: dict[str, Any], *stages: str) -> float:
    wanted = {f"indirect/{stage}" for stage in stages}
    return float(sum(ms for stage, ms in timed["stages"].items() if stage in wanted))


REFINE = ("pyramid", "one_pass", "iterative", "fragment_list", "fragment_receivers")


def transport(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Gather against splats, one pass against a list, fragments against pixels: B's Table 1."""
    size = 64 if options.quick else 1024
    at, settings = place(size), off("radiosity-2009", indirect="gather", vpls=256, form_factor="point")
    gather = measure.frames(renderer, *at, settings)
    ways = {way: settings.replace(refine=way) for way in ("one-pass", "iterative")}
    refining = measure.least(renderer, *at, ways, REFINE)
    thousand = settings.replace(vpls=1024)
    fragments, pixels = (
        measure.frames(renderer, *at, thousand.replace(refine=refine)) for refine in ("one-pass", "none")
    )
    splat = measure.frames(renderer, *at, settings.replace(indirect="splat"))
    times = _ms(splat, "vpl_splat") / _ms(gather, "vpl_gather")
    yield row("gather, times faster than splats, 256 lights", "room, scan", size, times, 5, True)
    over = refining["one-pass"] / refining["iterative"]
    yield row("one-pass refinement over the list", "room, scan", size, over, 1.0)
    stages = _ms(fragments, *REFINE, "vpl_gather", "edge_aware")
    times = _ms(pixels, "receivers", "vpl_gather") / stages
    yield row("refine, gather, upsample: times faster", "room, scan", size, times, 8, True)
    times = pixels["wall_ms"] / fragments["wall_ms"]
    yield row("whole frame: times faster, 1,024 lights", "room, scan", size, times, 8, True)


def bounce(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Against Mitsuba's one bounce."""
    size, spp = (32, 16) if options.quick else (256, 4096)
    at = place(size)
    reference = ml.mitsuba.reference(*at, spp, max_depth=3, part="indirect")
    for name in PRESETS:
        for visible in ("off", "on"):
            settings = ml.Settings.preset(name).replace(direct="off", indirect_visibility=visible)
            result = ml.testing.compare(renderer.render(*at, settings, OUTPUTS), reference)
            bounded = (name, visible) == ("hierarchical-2009", "on")
            bound = (0.15, 0.08, 0.05) if bounded else (None, None, None)
            what = f"{name}, visibility {visible}"
            yield row(
                f"{what}: error", "room, scan", size, result.relative_rmse, bound[0], noise=result.noise
            )
            yield row(f"{what}: median", "room, scan", size, result.median, bound[1])
            yield row(f"{what}: |energy|", "room, scan", size, abs(result.energy), bound[2])


def complexity(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """6,000 and 400,000 triangles in one view: everything but rays and surfaces."""
    size = 64 if options.quick else 512
    light: dict[str, list[float]] = {name: [] for name in PRESETS}
    for triangles in (6_000, 400_000):
        at = place(size, triangles)
        for name in PRESETS:
            timed = measure.frames(renderer, *at, off(name))["stages"]
            rays = ("geometry/", "rsm_", "upload", "host")
            light[name].append(sum(ms for stage, ms in timed.items() if not any(r in stage for r in rays)))
    for name, (few, many) in light.items():
        yield row("400 k over 6 k triangles, time", name, size, many / few, 1.5)


def coherence(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Flicker while the spot moves, beyond that of very many lights: B's Figs. 5 and 6."""
    size, steps = (48, 3) if options.quick else (192, 12)
    scene, camera = place(size)
    ways = {
        "grid of 256": off("radiosity-2009", indirect="gather", vpls=256),
        "grid of 1,024": off("radiosity-2009", indirect="gather", vpls=1024),
        "clusters": off("radiosity-2009"),
        "cut": off("hierarchical-2009"),
    }
    ways = {name: settings.replace(refine="none") for name, settings in ways.items()}
    ways["reference"] = off("hierarchical-2009", refine="none", light_cut_threshold=0.002)
    films: dict[str, list[Any]] = {name: [] for name in ways}
    for step in range(steps):
        scene.lights["spot"].target = (0.2 + 0.01 * step, 0.8, -0.6)
        for name, settings in ways.items():
            films[name].append(np.array(renderer.render(scene, camera, settings, OUTPUTS).indirect))
    for name in list(ways)[:-1]:
        moved = ml.metrics.flicker(films[name], films["reference"])
        yield row(f"flicker, {name}", "room, scan", size, moved, None)


def _side(options: argparse.Namespace, side: int) -> int:
    return 64 if options.quick else side


def _figures(rows: list[Row]) -> str:
    draw(rows, RESULTS / "virtual-lights.png")
    return "\n![The papers' figures](virtual-lights.png)\n"


PARTS: Parts = {
    "errors": errors,
    "transport": transport,
    "bounce": bounce,
    "complexity": complexity,
    "coherence": coherence,
    "stages": lambda renderer, options: curves.stages(renderer, place(_side(options, 1024)), options),
    "resolutions": lambda renderer, options: curves.resolutions(
        renderer, place(_side(options, 512)), options
    ),
    "dials": lambda renderer, options: curves.dials(renderer, place(_side(options, 512)), options),
    "limited": lambda renderer, options: curves.limited(renderer, place(_side(options, 512))),
    "path": lambda renderer, options: curves.path(renderer, place(_side(options, 512)), options),
}

if __name__ == "__main__":
    sys.exit(main(PARTS, "virtual-lights", __doc__, _figures))
