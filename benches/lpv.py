"""`make bench-lpv`: what propagation volumes cost and how near they come; each row with its bound, if any.

    python benches/lpv.py --only resolutions
    python benches/lpv.py --quick            # small pictures, few samples: does it run at all

A room with a scan under an area light, and under a spot: indirect light alone, against Mitsuba's one bounce
as the tests have it stored, 128 × 128. Errors are relative RMSE, trimmed by 0.1 % as everywhere. Frames take
the time of `measure.frames`; those of a second and more are measured once, after one that is thrown away.
Cells and the places of samples are kept while nothing moves: what they cost is under stages.

At equal time, each other method has the setting nearest in time to the default volume, with occlusion,
because volumes have it. They cost by the pixel and volumes by the cell, so that a larger picture is there,
too. Cascades are against a final gather of 512 rays in the room that is seen, alone.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the scenes are shared with the tests


import measure
import miplight as ml
from bounds import Parts, Row, main, row
from tests.claim_scenes import far_rooms
from tests.mitsuba.reference_scenes import STORED, load

LPV = ml.Settings(direct="off", indirect="lpv")
PLACES = {"one_bounce_indirect": "area light", "spot_indirect": "spot"}
BOUNDS = {"one_bounce_indirect": (0.22, 0.1), "spot_indirect": (0.4, 0.1)}
"""Error and |energy| of the default: those of the tests and half of what they allow."""
OUTPUTS = ("image", "indirect", "surface_mask")
KEPT = ("surface_samples", "blockers", "blockers_trace")
LONG_MS = 1000.0
RESOLUTIONS = {16: 48, 24: 64, 32: 80, 48: 128}
"""Cells along the longest edge, and steps in which light crosses them."""
ITERATIONS = (4, 8, 16, 32, 64, 128)
SAMPLES = (256, 1024, 4096, 16_384, 65_536)
LARGE = 384


def _preset(name: str, **changes: Any) -> ml.Settings:
    return ml.Settings.preset(name).replace(direct="off", indirect_visibility="on", **changes)


LADDERS: dict[str, dict[str, ml.Settings]] = {
    "final-gather": {
        f"{rays} rays": ml.Settings(direct="off", indirect="final-gather", gather_rays=rays)
        for rays in (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)
    },
    "splatting-2009": {
        f"{vpls:,} lights": _preset("splatting-2009", vpls=vpls) for vpls in (64, 256, 1024, 4096, 16_384)
    },
    "radiosity-2009": {
        f"up to {vpls:,} lights": _preset("radiosity-2009", vpls=vpls, cluster_normal_threshold=0.5 / step)
        for vpls, step in ((1024, 1), (4096, 1), (16_384, 2), (65_536, 4), (65_536, 64))
    },
    "hierarchical-2009": {
        f"threshold {threshold:g}": _preset("hierarchical-2009", light_cut_threshold=threshold)
        for threshold in (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
    },
}
"""Settings of each method, cheapest first."""

Place = tuple[ml.Scene, ml.Camera]


def _places(options: argparse.Namespace) -> Iterator[tuple[str, Place, Any]]:
    """Name, scene and camera, Mitsuba's one bounce."""
    for name in PLACES:
        scene, camera = STORED[name].build()
        if options.quick:
            at = scene, camera.replace(width=32, height=32)
            yield name, at, ml.mitsuba.reference(*at, 16, max_depth=3, part="indirect")
        else:
            yield name, (scene, camera), load(name)


def _once(renderer: ml.Renderer, at: Place, settings: ml.Settings) -> tuple[ml.Frame, float]:
    """A frame and its time, without what is kept while nothing moves."""
    start = time.perf_counter()
    frame = renderer.render(*at, settings, OUTPUTS)
    ms = 1000.0 * (time.perf_counter() - start)
    made = sum(ms for stage, ms in frame.stats.stages.items() if stage.partition("/")[2] in KEPT)
    return frame, ms - made


def _measured(renderer: ml.Renderer, at: Place, settings: ml.Settings) -> tuple[ml.Frame, float]:
    frame, ms = _once(renderer, at, settings)
    if ms < LONG_MS:
        return frame, float(measure.frames(renderer, *at, settings)["wall_ms"])
    return frame, _once(renderer, at, settings)[1] if ms < 5 * LONG_MS else ms


def _row(
    what: str, name: str, found: tuple[ml.Frame, float], reference: Any, bound: float | None = None
) -> Row:
    frame, ms = found
    compared = ml.testing.compare(frame, reference)
    more: dict[str, Any] = {
        "ms": ms,
        "median": compared.median,
        "energy": compared.energy,
        "noise": compared.noise,
    }
    return row(what, PLACES[name], frame.width, compared.relative_rmse, bound, **more)


def stages(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Error and energy of the default, and each stage of a frame before which a mesh moved."""
    for name, at, reference in _places(options):
        error, energy = (None, None) if options.quick else BOUNDS[name]
        found = _row("default", name, _measured(renderer, at, LPV), reference, error)
        yield found
        yield row("default, |energy|", PLACES[name], at[1].width, abs(found["energy"]), energy)
        scene, camera = at
        moved = scene.meshes["scan"].transform.copy()
        moved[0, 3] += 1e-3
        scene.set_transform("scan", moved)
        timed = renderer.render(scene, camera, LPV, OUTPUTS).stats.stages
        for stage, ms in timed.items():
            group, _, stem = stage.partition("/")
            if group == "indirect":
                yield row(f"stage {stem}, ms", PLACES[name], camera.width, ms, None)


def _changed(
    renderer: ml.Renderer, options: argparse.Namespace, ways: dict[str, ml.Settings]
) -> Iterator[Row]:
    for name, at, reference in _places(options):
        for what, settings in ways.items():
            yield _row(what, name, _measured(renderer, at, settings), reference)


def resolutions(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Error by resolution, with as many steps as light needs."""
    most = 16 if options.quick else 48
    ways = {
        f"{cells} cells, {steps} steps": LPV.replace(lpv_resolution=cells, lpv_iterations=steps)
        for cells, steps in RESOLUTIONS.items()
        if cells <= most
    }
    yield from _changed(renderer, options, ways)


def iterations(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Error by steps."""
    ways = {f"{steps} steps": LPV.replace(lpv_iterations=steps) for steps in ITERATIONS}
    yield from _changed(renderer, options, dict(list(ways.items())[:2]) if options.quick else ways)


def samples(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Error by surface samples."""
    ways = {f"{count:,} samples": LPV.replace(lpv_samples=count) for count in SAMPLES}
    yield from _changed(renderer, options, dict(list(ways.items())[:2]) if options.quick else ways)


def transports(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Error of the three ways in which light goes on."""
    ways = {f"transport {way}": LPV.replace(lpv_transport=way) for way in ("sides", "together", "faces")}
    yield from _changed(renderer, options, ways)


def _equal(
    renderer: ml.Renderer, name: str, at: Place, reference: Any, steps: int | None = None
) -> Iterator[Row]:
    """The default, and each method at the setting nearest to it in time."""
    own = _measured(renderer, at, LPV)
    yield _row("equal time: lpv", name, own, reference)
    together = _measured(renderer, at, LPV.replace(lpv_transport="together"))
    yield _row("a third of it: lpv, together", name, together, reference)
    for method, ladder in LADDERS.items():
        nearest, apart = "", math.inf
        for label, settings in list(ladder.items())[:steps]:
            _once(renderer, at, settings)  # pipelines and buffers
            ms = _once(renderer, at, settings)[1]
            if abs(math.log(ms / own[1])) < apart:
                nearest, apart = label, abs(math.log(ms / own[1]))
            if ms > own[1]:
                break
        yield _row(
            f"equal time: {method}, {nearest}", name, _measured(renderer, at, ladder[nearest]), reference
        )


def methods(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Every method at equal time, small."""
    for name, at, reference in _places(options):
        yield from _equal(renderer, name, at, reference, 2 if options.quick else None)


def larger(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """The same with nine times the pixels."""
    size, spp = (48, 16) if options.quick else (LARGE, 512)
    for name in PLACES:
        scene, camera = STORED[name].build()
        at = scene, camera.replace(width=size, height=size)
        reference = ml.mitsuba.reference(*at, spp, max_depth=3, part="indirect")
        yield from _equal(renderer, name, at, reference, 2 if options.quick else None)


def cascades(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Two rooms far apart, one of them seen: volumes inside of others, and more cells."""
    size = 32 if options.quick else 96
    ways = {"": {}, "48 cells, 128 steps": {"lpv_resolution": 48, "lpv_iterations": 128}}
    ways |= {f"{count} cascades": {"lpv_cascades": count} for count in (2, 3, 4)}
    gather = ml.Settings(direct="off", indirect="final-gather", gather_rays=512)
    truth = renderer.render(*far_rooms(0, size), gather, OUTPUTS)
    for apart in (20,) if options.quick else (20, 60):
        at = far_rooms(apart, size)
        for label, changes in list(ways.items())[:: 2 if options.quick else 1]:
            frame, ms = _measured(renderer, at, LPV.replace(**changes))
            compared = ml.testing.compare(frame.indirect, truth.indirect, mask=truth.surface_mask)
            more: dict[str, Any] = {"ms": ms, "median": compared.median, "energy": compared.energy}
            what = f"rooms {apart} apart" + (f", {label}" if label else "")
            yield row(what, "far rooms", size, compared.relative_rmse, None, **more)


PARTS: Parts = {
    "stages": stages,
    "resolutions": resolutions,
    "iterations": iterations,
    "samples": samples,
    "transports": transports,
    "methods": methods,
    "larger": larger,
    "cascades": cascades,
}


def _table(rows: list[Row]) -> str:
    """Time, error, median and energy of every setting."""
    lines = [
        "",
        "| settings | scene | size | ms | error | median | energy |",
        "|---|---|--:|--:|--:|--:|--:|",
    ]
    for found in rows:
        if "ms" in found:
            numbers = f"{found['value']:.3f} | {found['median']:.3f} | {found['energy']:+.3f}"
            where = f"{found['scene']} | {found['size']} | {found['ms']:.0f}"
            lines.append(f"| {found['what']} | {where} | {numbers} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main(PARTS, "lpv", __doc__, _table))
