"""`make bench-area`: what paper C's preset must show, in one table: each row with its bound, pass or FAIL.

    python benches/area2010.py --only reuse glossy
    python benches/area2010.py --quick            # small pictures, few samples: does it run at all

Errors are against Mitsuba (cached, `miplight.mitsuba.cache_folder`) or brute force; times by the rules of
`measure.frames`, all in one run. Rays are those of a second frame, whose G-buffer is kept.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the scenes are shared with the tests


import measure
import miplight as ml
from bounds import Parts, Row, main, row
from tests.claim_scenes import CLAIMS, available
from tests.mitsuba.reference_scenes import glossy_floor, load

AREA = ml.Settings.preset("area-2010")
RAYS = AREA.replace(visibility="ray")
BRUTE = ml.Settings.preset("brute-force").replace(light_samples=256)
SCENES = ("dragon_one", "sphere_one", "nefertiti")
Timed = list[tuple[float, float]]
"""Milliseconds and error of each of some settings."""


def _scenes(options: argparse.Namespace) -> list[str]:
    return [name for name in SCENES if name in available()][: 1 if options.quick else None]


def reuse(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Rays and error of incremental visibility against the naive query, same fragments and interleave."""
    size = 64 if options.quick else 512
    for name in _scenes(options):
        scene, camera = CLAIMS[name].build(size, size)
        found = []
        for settings in (RAYS, RAYS.replace(visibility_reuse="off")):
            renderer.render(scene, camera, settings)
            frame = renderer.render(scene, camera, settings)
            found.append((frame.stats.rays, frame.image, frame.surface_mask))
        (rays, image, mask), (naive, wanted, _) = found
        error = ml.metrics.relative_rmse(image, wanted, mask=mask, trim=0.001)
        yield row("rays, share of the naive query", name, size, rays / naive, 0.15)
        yield row("error against the naive query", name, size, error, 0.015)


def errors(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Direct light against Mitsuba, with rays and with voxels."""
    for size in (32,) if options.quick else (256, 512):
        for name in _scenes(options):
            scene, camera = CLAIMS[name].build(size, size)
            spp = 16 if options.quick else max(256, CLAIMS[name].spp * 256**2 // size**2)
            reference = ml.mitsuba.reference(scene, camera, spp, part="direct")
            for settings, label, bounds in ((RAYS, "rays", (0.05, 0.02)), (AREA, "voxels", (0.12, 0.06))):
                result = ml.testing.compare(renderer.render(scene, camera, settings), reference)
                yield row(
                    f"error, {label}", name, size, result.relative_rmse, bounds[0], untrimmed=result.untrimmed
                )
                yield row(f"median error, {label}", name, size, result.median, bounds[1])


def voxels(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Error of voxels against rays by their resolution; no bound, the figure of the paper."""
    size = 32 if options.quick else 256
    scene, camera = CLAIMS[SCENES[0]].build(size, size)
    wanted = renderer.render(scene, camera, RAYS, outputs=("direct",)).direct
    table = ml.study.voxel_sweep(scene, camera, settings=AREA, reference=wanted, renderer=renderer)
    for found in table.to_dict("records"):
        label = f"voxels {found['voxel_resolution']} × {found['voxel_slices']} against rays"
        yield row(label, SCENES[0], size, found["relative_rmse"], 1.0, ms=found["ms"])


FINER = RAYS.replace(interleave=1)
CHEAPER = ml.Settings.preset("default").replace(light_samples=16)
"""Both ways to an equal error: the preset with more care, and the default with less."""
CAREFUL = (
    AREA,
    RAYS,
    FINER,
    FINER.replace(illumination_threshold=0.05, bit_threshold=32),
    FINER.replace(illumination_threshold=0.03, bit_threshold=16),
    FINER.replace(illumination_threshold=0.03, bit_threshold=16, visibility_reuse="off"),
)
CARELESS = (ml.Settings.preset("default"), CHEAPER, CHEAPER.replace(finest_level=1))


def _measured(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings, wanted: ml.Frame
) -> tuple[float, float]:
    """Milliseconds of a frame, and its error."""
    image = renderer.render(scene, camera, settings, outputs=("image",)).image
    error = ml.metrics.relative_rmse(image, wanted.image, mask=wanted.surface_mask, trim=0.001)
    return measure.frames(renderer, scene, camera, settings)["wall_ms"], error


def times(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """Frames against brute force with as many samples, and the default against the preset at equal error."""
    size = 64 if options.quick else 1024
    for name in _scenes(options):
        scene, camera = CLAIMS[name].build(size, size)
        exact = BRUTE.replace(light_samples=1024)
        wanted = renderer.render(scene, camera, exact, outputs=("image", "surface_mask"))

        brute_ms = measure.frames(renderer, scene, camera, BRUTE)["wall_ms"]
        presets, defaults = (
            [_measured(renderer, scene, camera, each, wanted) for each in all_]
            for all_ in (CAREFUL, CARELESS)
        )
        for label, (ms, error) in zip(("voxels", "rays"), presets, strict=False):
            ratio = brute_ms / ms
            yield row(
                f"times faster than brute force, {label}", name, size, ratio, 6.0, True, ms=ms, error=error
            )
        yield from _equal(name, size, presets, defaults)


def _equal(name: str, size: int, presets: Timed, defaults: Timed) -> Iterator[Row]:
    """How much faster the default is than the preset: at the preset's error, and at the default's own."""
    for label, (ms, error) in zip(("voxels", "rays"), presets, strict=False):
        quickest = min((t for t, e in defaults if e <= error), default=float("inf"))
        yield row(f"default at the error of {label}: faster", name, size, ms / quickest, 2.0, True)
    ms, error = defaults[0]
    quickest = min((t for t, e in presets if e <= error), default=float("inf"))
    yield row("default at its own error: faster", name, size, quickest / ms, 2.0, True, ms=ms, error=error)


def glossy(renderer: ml.Renderer, options: argparse.Namespace) -> Iterator[Row]:
    """A glossy floor under a light with a picture, against the stored references."""
    for shadowed in (False, True):
        for exponent in (50,) if options.quick else (10, 50, 200, 1000):
            name = f"glossy_{'shadowed' if shadowed else 'floor'}_{exponent}"
            scene, camera = glossy_floor(exponent, shadowed, 96)
            reference = load(name)
            for label, settings, bound in (("area-2010", RAYS, 0.10), ("default", "default", 0.04)):
                frame = renderer.render(scene, camera, settings, outputs=("direct", "surface_mask"))
                error = ml.metrics.relative_rmse(
                    frame.direct, reference.mean, mask=frame.surface_mask, trim=0.001
                )
                yield row(f"glossy, {label}", name, 96, error, bound)


PARTS: Parts = {
    "reuse": reuse,
    "errors": errors,
    "voxels": voxels,
    "times": times,
    "glossy": glossy,
}

if __name__ == "__main__":
    sys.exit(main(PARTS, "area-2010", __doc__))
