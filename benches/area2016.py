"""`make bench-area-2016`: what paper D's preset must show: each row with its bound, pass or FAIL.

    python benches/area2016.py --only table
    python benches/area2016.py --quick            # small pictures, few samples: does it run at all

The paper's Table 1 at its own size, 1024 × 768 with 64 light samples: the preset, the 3 × 3 test of paper C
with the same rays, levels, thresholds of geometry and one differing bit, and full resolution. Errors are
against Mitsuba (cached, `miplight.mitsuba.cache_folder`), times by the rules of `measure.frames`, all in one
run.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the scenes are shared with the tests


import measure
import miplight as ml
from bounds import Parts, Row, main, row
from tests.claim_scenes import CLAIMS, available

INSIDE = ml.Settings.preset("area-2016").replace(indirect="off")
AROUND = INSIDE.replace(
    refine="incremental",
    interleave=1,
    visibility_reuse="off",
    illumination_threshold=None,
    upsample="edge-aware",
)
"""The 3 × 3 test of paper C: all samples at every fragment, one bit in doubt splits it."""
FULL = ml.Settings.preset("brute-force").replace(light_samples=64, light_pattern="grid")
METHODS = {"preset": INSIDE, "3 × 3 test": AROUND, "full resolution": FULL}
SCENES = {"boxes": "room", "dragon_one": "scan", "sponza": "Sponza"}
ERRORS = {"dragon_one": (0.05, 0.02), "dragon_two": (0.07, 0.04)}
SPP = {"boxes": 1024, "dragon_one": 1024, "dragon_two": 1024, "sponza": 256}
VISIBILITY = ("light_bounds", "prove", "nodes", "fragment_list", "reuse", "sub_bits", "shadow")
SPLITTING = ("sub_fragments", "stop_guard", "incremental")
LIGHT = ("receivers", "interleaved", "sub_gather", "gather", "extra_samples")


def _size(options: argparse.Namespace) -> tuple[int, int]:
    return (64, 48) if options.quick else (1024, 768)


def _reference(name: str, options: argparse.Namespace) -> tuple[ml.Scene, ml.Camera, ml.mitsuba.Reference]:
    scene, camera = CLAIMS[name].build(*_size(options))
    spp = 16 if options.quick else SPP[name]
    return scene, camera, ml.mitsuba.reference(scene, camera, spp, part="direct")


def table(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Table 1: fragments, times and errors of the three methods in three scenes."""
    for name, place in SCENES.items():
        if name not in available():
            continue
        scene, camera, reference = _reference(name, options)
        found = {}
        for label, settings in METHODS.items():
            frame = renderer.render(scene, camera, settings)
            compared = ml.testing.compare(frame, reference)
            timed = measure.frames(renderer, scene, camera, settings)
            parts = [
                sum(ms for stage, ms in timed["stages"].items() if stage.removeprefix("direct/") in group)
                for group in (VISIBILITY + SPLITTING, LIGHT)
            ]
            found[label] = {
                "method": label,
                "fragments": frame.fragments.total,
                "extra": frame.fragments.extra,
                "visibility_ms": parts[0],
                "irradiance_ms": parts[1],
                "total_ms": timed["wall_ms"],
                "error": compared.relative_rmse,
                "median": compared.median,
            }
        yield from _compared(f"{place}", found, "{} × {}".format(*_size(options)))


def _compared(place: str, found: dict[str, Row], size: str) -> Iterator[Row]:
    own, around, full = (found[label] for label in METHODS)
    share = own["fragments"] / around["fragments"]
    yield row(
        "fragments, share of those of the 3 × 3 test", place, size, share, 0.65, methods=list(found.values())
    )
    yield row(
        "error over that of the 3 × 3 test", place, size, own["error"] / max(around["error"], 1e-6), 1.0
    )
    yield row(
        "times faster than the 3 × 3 test", place, size, around["total_ms"] / own["total_ms"], 1.6, True
    )
    yield row("times faster than full resolution", place, size, full["total_ms"] / own["total_ms"], 4.0, True)


def errors(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Direct light against Mitsuba with one light and with two."""
    size = "{} × {}".format(*_size(options))
    for name, (most, median) in ERRORS.items():
        if name in available():
            scene, camera, reference = _reference(name, options)
            result = ml.testing.compare(renderer.render(scene, camera, INSIDE), reference)
            yield row("error", name, size, result.relative_rmse, most, untrimmed=result.untrimmed)
            yield row("median error", name, size, result.median, median)


def dials(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """What each rule of the paper and each of ours does, one changed at a time; no bound."""
    changes: dict[str, dict[str, Any]] = {
        "preset": {},
        "paper's stops: stop_guard off": {"stop_guard": "off"},
        "samples of their own": {"sub_fragment_samples": "own"},
        "counts in place of changes": {"gradient_metric": "counts"},
        "no gradients": {"gradient_threshold": None},
        "no extra samples": {"extra_samples": "off"},
        "edge-aware in place of bases": {"upsample": "edge-aware"},
        "paper's bases": {"rbf_form": "paper"},
        "jittered samples": {"light_pattern": "jittered"},
    }
    name = "dragon_one" if "dragon_one" in available() else "boxes"
    scene, camera, reference = _reference(name, options)
    for label, change in changes.items():
        settings = INSIDE.replace(**change)
        frame = renderer.render(scene, camera, settings)
        error = ml.testing.compare(frame, reference).relative_rmse
        ms = measure.frames(renderer, scene, camera, settings)["wall_ms"]
        size = "{} × {}".format(*_size(options))
        yield row(
            f"error, {label}",
            name,
            size,
            error,
            1.0,
            ms=ms,
            fragments=frame.fragments.total,
            rays=frame.stats.rays,
        )


PARTS: Parts = {"table": table, "errors": errors, "dials": dials}


def _table_1(rows: list[Row]) -> str:
    """The paper's Table 1 for each scene, with the errors that it does not give, and what each dial does."""
    lines = [
        "",
        "| scene | method | fragments | extra | visibility ms | irradiance ms | total ms | error | median |",
    ]
    lines += ["|---|---|--:|--:|--:|--:|--:|--:|--:|"]
    for found in rows:
        for m in found.get("methods", ()):
            times = f"{m['visibility_ms']:.0f} | {m['irradiance_ms']:.0f} | {m['total_ms']:.0f}"
            counts = f"{m['fragments']:,} | {m['extra']:,}"
            errors = f"{m['error']:.4f} | {m['median']:.4f}"
            lines.append(f"| {found['scene']} | {m['method']} | {counts} | {times} | {errors} |")
    lines += ["", "| one change | fragments | rays | total ms | error |", "|---|--:|--:|--:|--:|"]
    for found in rows:
        if "ms" in found:
            lines.append(
                f"| {found['what'].removeprefix('error, ')} | {found['fragments']:,} | {found['rays']:,} "
                f"| {found['ms']:.0f} | {found['value']:.4f} |"
            )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main(PARTS, "area-2016", __doc__, _table_1))
