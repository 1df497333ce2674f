"""`make bench-claims`: each claim about direct light in one row, with what it promises, and pass or FAIL.

    python benches/claims.py --only dragon_one --sizes 256 --settings light_samples=64
    python benches/claims.py --only dragon_one --each direct_estimator=samples "light_samples=16 seed=1"

Errors are against references of Mitsuba that are kept on disk (`miplight.mitsuba.cache_folder`), so that a
second run is quick. Times of both are measured in this run, by the rules of `measure.frames`. At 256 and 512
the peer is Mitsuba at its best; at 1024 it is the preset "brute-force" with 256 samples.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import pickle
import sys
import warnings
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the scenes are shared with the tests

import numpy as np

import claim_tables
import measure
import miplight as ml
from mitsuba_at_error import Peer
from tests.claim_scenes import CLAIMS, Bounds, available

ROOT = Path(__file__).resolve().parents[1]
LARGE = 1024  # from here on the peer is brute force
BRUTE = ml.Settings.preset("brute-force").replace(light_samples=256)
FASTER_THAN_BRUTE = 6.0
LARGE_ROOMS = 3
# the default without one of its ideas at a time
IDEAS = (
    "shadow_proofs=off",
    "penumbra_filter=off",
    "visibility_reuse=off",
    "light_pattern=grid",
    "refine=none",
    "refine=none direct_estimator=samples",
)


def _settings(options: argparse.Namespace, change: str = "") -> ml.Settings:
    changes: dict[str, Any] = {}
    for word in [*options.settings, *change.split()]:
        name, _, value = word.partition("=")
        try:
            changes[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            changes[name] = value
    return ml.Settings.preset(options.preset).replace(**changes)


def _reference(scene: ml.Scene, camera: ml.Camera, name: str, asked: int) -> ml.mitsuba.Reference:
    """As many samples a picture, whatever its size: the halves cancel the noise that is left in the RMSE."""
    spp = asked or max(256, CLAIMS[name].spp * 256**2 // (camera.width * camera.height))
    return ml.mitsuba.reference(scene, camera, spp, part="direct")


def _costs(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings
) -> dict[str, Any]:
    """Rays, evaluations and fragments a pixel that sees a surface."""
    off = settings.replace(direct="off")
    # a still frame does not trace again what each pixel sees: those rays are counted apart
    first, still = (renderer.render(scene, camera, off).stats.rays for _ in range(2))
    frame = renderer.render(scene, camera, settings)
    pixels = max(int(frame.surface_mask.sum()), 1)
    fragments, shadow_rays = frame.fragments, frame.stats.rays - still
    return {
        "surface_pixels": pixels,
        "rays_a_pixel": (shadow_rays + max(first, camera.width * camera.height)) / pixels,
        "shadow_rays": shadow_rays,
        "light_evaluations": frame.stats.light_evaluations,
        "fragments": fragments.total,
        "fragments_a_pixel": fragments.total / pixels,
        "counts": list(fragments.counts),
        "skipped": frame.stats.skipped,
        "empty": frame.stats.empty,
    }


def _errors(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings, options: Any, name: str
) -> tuple[dict[str, float], ml.mitsuba.Reference, Any]:
    reference = _reference(scene, camera, name, options.reference_spp)
    frame = renderer.render(scene, camera, settings)
    result = ml.testing.compare(frame, reference)
    if options.pictures:
        folder = ROOT / "out" / "claims" / f"{name}_{camera.width}"
        ml.testing.write_pictures(result, folder)
        claim_tables.write_maps(frame, folder)
    errors = {
        "relative_rmse": result.relative_rmse,
        "untrimmed": result.untrimmed,
        "median": result.median,
        "energy": result.energy,
    }
    return errors, reference, frame.surface_mask


def _row(
    renderer: ml.Renderer, name: str, size: int, options: argparse.Namespace, change: str = ""
) -> dict[str, Any]:
    scene, camera = CLAIMS[name].build(size, size)
    settings = _settings(options, change)
    row: dict[str, Any] = {"scene": name, "size": size, "change": change, "settings": settings.to_dict()}
    row |= _costs(renderer, scene, camera, settings)
    if size < LARGE:
        found, reference, mask = _errors(renderer, scene, camera, settings, options, name)
        row |= found
    # measuring changes the lights by a few roundings, and what is kept on disk goes by their bits
    moving = pickle.loads(pickle.dumps(scene))
    if options.times:
        times = measure.frames(renderer, moving, camera, settings)
        row |= {key: times[key] for key in ("wall_ms", "total_ms", "stages", "frames")}
    if options.times and options.peer:
        if size < LARGE:
            row["peer"] = Peer(scene, camera, options.sampler).time_to(row["relative_rmse"], reference, mask)
        else:
            brute = measure.frames(renderer, moving, camera, BRUTE)
            row["peer"] = {"ms": brute["wall_ms"], "bound": "=", "integrator": "brute-force"}
        row["faster"] = row["peer"]["ms"] / row["wall_ms"]
    row["broken"] = broken(row, CLAIMS[name].bounds)
    return row


def broken(row: dict[str, Any], bounds: Bounds) -> list[str]:
    """Which promises a row does not keep."""
    at_most = {"relative_rmse": bounds.relative_rmse}
    if row["size"] <= 256:  # a median has all of the reference's noise, which is larger at larger sizes
        at_most["median"] = bounds.median
    at_most |= {"rays_a_pixel": bounds.rays_a_pixel, "shadow_rays": bounds.shadow_rays}
    at_most["fragments_a_pixel"] = bounds.fragments_a_pixel
    failed = [
        f"{name} {row[name]:.4g} > {bound:g}"
        for name, bound in at_most.items()
        if bound is not None and name in row and not row[name] <= bound
    ]
    large = FASTER_THAN_BRUTE if row["size"] >= LARGE else 0.0
    wanted = bounds.faster.get(row["size"], large) if bounds.faster else 0.0
    if "faster" in row and not row["faster"] >= wanted:
        failed.append(f"faster {row['faster']:.2f} < {wanted:g}")
    return failed


def compare_sizes(row: dict[str, Any], earlier: list[dict[str, Any]]) -> None:
    """More pixels must not mean as many fragments for each of them."""
    bound = CLAIMS[row["scene"]].bounds.fragments_a_pixel
    same = [r for r in earlier if (r["scene"], r["change"]) == (row["scene"], row["change"])]
    for other in same if bound is not None else []:
        if other["size"] < row["size"] and other["fragments_a_pixel"] <= row["fragments_a_pixel"]:
            row["broken"].append(f"fragments_a_pixel not below {other['fragments_a_pixel']:.3f}")


def _names(size: int, options: argparse.Namespace) -> list[str]:
    """What was asked for; else all at 256, and at larger sizes the rooms, by which speed is judged."""
    if options.only:
        return list(options.only)
    rooms = [name for name in available() if CLAIMS[name].bounds.faster]
    return available() if size <= 256 else rooms if size < LARGE else rooms[:LARGE_ROOMS]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help=f"scenes: {', '.join(CLAIMS)}")
    parser.add_argument("--sizes", nargs="*", type=int, default=[256])
    parser.add_argument("--preset", default="default")
    parser.add_argument("--settings", nargs="*", default=[], metavar="NAME=VALUE")
    parser.add_argument(
        "--each", nargs="*", default=[], metavar="CHANGE", help="a row more for each 'NAME=VALUE …' alone"
    )
    parser.add_argument("--ideas", action="store_true", help="the same for the ideas of the default")
    parser.add_argument("--adapter", default="auto")
    parser.add_argument("--sampler", default="multijitter", help="Mitsuba's; its own default is independent")
    parser.add_argument("--reference-spp", type=int, default=0, help="0: as tests/claim_scenes.py says")
    parser.add_argument(
        "--no-peer", dest="peer", action="store_false", help="do not time Mitsuba or brute force"
    )
    parser.add_argument("--no-times", dest="times", action="store_false", help="errors and counts only")
    parser.add_argument("--stages", action="store_true", help="the passes of each frame below its row")
    parser.add_argument(
        "--pictures", action="store_true", help="image, reference, error, levels to out/claims"
    )
    parser.add_argument("--write", action="store_true", help="benches/results/claims.json and .md")
    options = parser.parse_args()
    options.each += IDEAS if options.ideas else ()
    unknown = sorted(set(options.only) - set(CLAIMS))
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; allowed: {', '.join(CLAIMS)}")
    return options


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = _options()
    warnings.simplefilter("ignore", ml.SoftwareAdapterWarning)
    np.seterr(all="ignore")
    rows: list[dict[str, Any]] = []
    with ml.Renderer(options.adapter) as renderer:
        load = os.getloadavg()[0]
        print(f"{renderer.adapter['name']}, {renderer.adapter['trace']} rays, load {load:.1f}")
        print(claim_tables.HEAD, flush=True)
        for size in options.sizes:
            for name in _names(size, options):
                for change in ["", *options.each]:
                    row = _row(renderer, name, size, options, change)
                    compare_sizes(row, rows)
                    rows.append(row)
                    print(claim_tables.line(rows[-1]), flush=True)
                    if options.stages and "stages" in rows[-1]:
                        print(claim_tables.stages(rows[-1]), flush=True)
    if options.write:
        results = ROOT / "benches" / "results"
        (results / "claims.json").write_text(json.dumps(rows, indent=1) + "\n")
        (results / "claims.md").write_text(claim_tables.markdown(rows))
    return int(any(row["broken"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
