"""`make bench-one-bounce`: direct light and one bounce by the default, against Mitsuba and the other methods.

    python benches/one_bounce.py --sizes 256 --only dragon_one

Errors are of the whole picture, against references of Mitsuba that are kept on disk; all times are of this
run, by the rules of `measure.frames`. The peer is Mitsuba's path tracer with `multijitter`, its time to the
same error interpolated between two counts of samples.
"""

from __future__ import annotations

import argparse
import json
import pickle
import sys
import warnings
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the scenes are shared with the tests

import measure
import miplight as ml
from mitsuba_at_error import Peer
from tests.claim_scenes import CLAIMS, available
from tests.mitsuba.reference_scenes import hard_spot

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benches" / "results"
PATH = {"path": {"type": "path", "max_depth": 3, "rr_depth": 100}}
DEFAULT = ml.Settings.preset("default").replace(indirect="final-gather")
FASTER = {256: 5.0, 512: 12.0}
RMSE, MEDIAN = 0.03, 0.02
SAMPLES = 2048 * 256**2
"""Of a reference picture, whatever its size."""
EQUAL_SIZE = 256

Place = tuple[ml.Scene, ml.Camera]


def _methods() -> dict[str, ml.Settings]:
    """Every way to one bounce, direct light by the default's but where a preset has its own."""
    every = ml.Settings.preset("default").replace(indirect="final-gather", refine="none", coarsest_level=0)
    points = {f"points, {n} rays": DEFAULT.replace(gather_rays=n) for n in (16, 32, 64, 128, 256)}
    pixels = {f"every pixel, {n} rays": every.replace(gather_rays=n) for n in (4, 16, 64)}
    direct = ml.Settings.preset("default")
    volume = {
        f"lpv, {n} cells": direct.replace(indirect="lpv", lpv_resolution=n, lpv_iterations=3 * n)
        for n in (16, 24)
    }
    lights = {
        f"{name}, light only indirect": ml.Settings.preset(name).replace(direct="off")
        for name in ("splatting-2009", "radiosity-2009", "hierarchical-2009")
    }
    return points | pixels | volume | lights


def _place(name: str, size: int) -> Place:
    if name != "spot":
        scene, camera = CLAIMS[name].build(size, size)
        return scene, camera
    scene, camera = hard_spot()
    return scene, ml.Camera(camera.world_from_camera, camera.fov_y, size, size)


def _reference(place: Place, part: Any = "total") -> ml.mitsuba.Reference:
    scene, camera = place
    spp = SAMPLES // (camera.width * camera.height)
    return ml.mitsuba.reference(scene, camera, spp, max_depth=3, part=part)


def _measured(renderer: ml.Renderer, place: Place, settings: ml.Settings, reference: Any) -> dict[str, Any]:
    scene, camera = place
    frame = renderer.render(scene, camera, settings)
    result = ml.testing.compare(frame, reference)
    # measuring changes the lights by a few roundings, and what is kept on disk goes by their bits
    times = measure.frames(renderer, pickle.loads(pickle.dumps(scene)), camera, settings)
    pixels = max(int(frame.surface_mask.sum()), 1)
    return {
        "relative_rmse": result.relative_rmse,
        "untrimmed": result.untrimmed,
        "median": result.median,
        "energy": result.energy,
        "rays_a_pixel": times["rays"] / pixels,
        **{key: times[key] for key in ("wall_ms", "stages", "frames")},
    }


def _row(renderer: ml.Renderer, name: str, size: int, peer: bool) -> dict[str, Any]:
    place = _place(name, size)
    reference = _reference(place)
    row = {"scene": name, "size": size, **_measured(renderer, place, DEFAULT, reference)}
    if peer:
        mask = renderer.render(*place, DEFAULT).surface_mask
        row["peer"] = Peer(*place, integrators=PATH).time_to(row["relative_rmse"], reference, mask)
        row["faster"] = row["peer"]["ms"] / row["wall_ms"]
    bounds = {"relative_rmse": RMSE, "median": MEDIAN}
    row["broken"] = [f"{key} {row[key]:.4f} > {most:g}" for key, most in bounds.items() if row[key] > most]
    if peer and row["faster"] < FASTER.get(size, 0.0):
        row["broken"].append(f"faster {row['faster']:.1f} < {FASTER[size]:g}")
    print(_line(row), flush=True)
    return row


def _line(row: dict[str, Any]) -> str:
    peer = row.get("peer", {"ms": float("nan"), "bound": ""})
    cells = [
        row["scene"],
        row["size"],
        f"{100 * row['relative_rmse']:.2f} %",
        f"{100 * row['median']:.2f} %",
        f"{100 * row['energy']:+.1f} %",
        f"{row['rays_a_pixel']:.1f}",
        f"{row['wall_ms']:.0f}",
        f"{peer['bound'].replace('=', '')}{peer['ms']:.0f}",
        f"{row.get('faster', float('nan')):.1f}",
        "; ".join(row["broken"]) or "pass",
    ]
    return f"| {' | '.join(map(str, cells))} |"


def _equal_time(renderer: ml.Renderer, name: str) -> list[dict[str, Any]]:
    """Error and time of each method; presets with direct light of their own by their indirect part."""
    place = _place(name, EQUAL_SIZE)
    total, indirect = _reference(place), _reference(place, "indirect")
    mask = renderer.render(*place, DEFAULT).surface_mask
    share = float(indirect.mean[mask].mean() / total.mean[mask].mean())
    rows = []
    for method, settings in _methods().items():
        alone = settings.to_dict()["direct"] == "off"
        found = _measured(renderer, place, settings, indirect if alone else total)
        if alone:
            found["relative_rmse"] *= share
            found["median"] *= share
        rows.append({"scene": name, "method": method, **found})
        print(_method_line(rows[-1]), flush=True)
    return rows


def _method_line(row: dict[str, Any]) -> str:
    return (
        f"| {row['method']} | {100 * row['relative_rmse']:.2f} % | {100 * row['median']:.2f} % "
        f"| {row['wall_ms']:.0f} | {row['rays_a_pixel']:.1f} |"
    )


def _table(rows: list[dict[str, Any]], methods: list[dict[str, Any]], adapter: str) -> str:
    columns = (
        "scene | size | relative RMSE | median | energy | rays a pixel | ms | Mitsuba, ms | times faster"
    )
    where = f"{methods[0]['scene'] if methods else '-'}, {EQUAL_SIZE} x {EQUAL_SIZE}"
    other = "| method | relative RMSE | median | ms | rays a pixel |"
    return "\n".join(
        [
            "# Direct light and one bounce",
            "",
            f"`make bench-one-bounce` on {adapter}, {ml.__version__}.",
            f"Bounds: relative RMSE {RMSE:g}, median {MEDIAN:g} (with the noise of the reference in it);",
            "5 times faster than Mitsuba (`multijitter`) at equal error at 256 x 256, 12 times at 512 x 512.",
            "",
            f"| {columns} | |",
            "|---|" + "--:|" * 8 + "---|",
            *map(_line, rows),
            "",
            f"All methods on {where}; errors of the whole picture, presets with direct light of their own by",
            "their indirect part alone:",
            "",
            other,
            "|---|" + "--:|" * 4,
            *map(_method_line, methods),
            "",
        ]
    )


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--sizes", nargs="*", type=int, default=[256, 512])
    parser.add_argument("--adapter", default="auto")
    parser.add_argument("--no-peer", dest="peer", action="store_false")
    parser.add_argument("--no-methods", dest="methods", action="store_false")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    names = [name for name in ("dragon_one", "dragon_two", "spot") if name == "spot" or name in available()]
    names = [name for name in names if not options.only or name in options.only]
    with ml.Renderer(options.adapter) as renderer:
        rows = [_row(renderer, name, size, options.peer) for size in options.sizes for name in names]
        methods = _equal_time(renderer, names[0]) if options.methods else []
        adapter = renderer.adapter["name"]
    if options.write:
        (RESULTS / "one-bounce.json").write_text(json.dumps({"rows": rows, "methods": methods}, indent=1))
        (RESULTS / "one-bounce.md").write_text(_table(rows, methods, adapter))
    return int(any(row["broken"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
