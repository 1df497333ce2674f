"""`make bench`: measures passes, errors, rays and Mitsuba in one run, and writes benches/results.

Each claim that the tables allow is a ratio of two of their numbers: they come from one run on one machine.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import re
import subprocess
import warnings
from pathlib import Path
from typing import Any

import measure
import miplight as ml
import mitsuba_timing
import tables
import trace_rates
import workloads

RESULTS = Path(__file__).parent / "results"
REFERENCE_SPP = 1024  # each half; multijittered, and the halves cancel what noise is left


def _commit() -> str:
    done = subprocess.run(
        ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def about(renderer: ml.Renderer) -> dict[str, Any]:
    about = renderer.adapter
    return {
        "adapter": about["name"],
        "driver": about["driver"],
        "backend": about["backend"],
        "trace": about["trace"],
        "commit": _commit(),
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "version": ml.__version__,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}",
    }


def _errors(frame: ml.Frame, work: workloads.Workload, spp: int) -> dict[str, float]:
    reference = ml.mitsuba.reference(work.scene, work.camera, spp=spp, max_depth=work.max_depth)
    image, mask = frame.image, frame.surface_mask
    return {
        "relative_rmse": ml.metrics.relative_rmse(image, reference, mask=mask, trim=0.001),
        "relative_rmse_untrimmed": ml.metrics.relative_rmse(image, reference, mask=mask),
        "median_relative_error": ml.metrics.median_relative_error(image, reference, mask=mask),
    }


def _row(renderer: ml.Renderer, work: workloads.Workload, options: argparse.Namespace) -> dict[str, Any]:
    camera = work.camera
    row: dict[str, Any] = {
        "workload": work.name,
        "size": [camera.width, camera.height],
        "triangles": sum(mesh.triangles for mesh in work.scene.report.meshes.values()),
        "lights": len(work.scene.lights),
        "settings": work.settings.to_dict(),
    }
    row |= measure.frames(renderer, work.scene, camera, work.settings)
    row["rays_per_second"] = measure.rays_per_second(row)
    job = (renderer, work.scene, camera, work.settings)
    if not options.fast:
        row["still_ms"] = measure.frames(*job, move=False, light=False)["wall_ms"]
        row["light_only_ms"] = measure.frames(*job, move=False)["wall_ms"]
    if options.mitsuba:
        frame = renderer.render(work.scene, camera, work.settings)
        spp = options.reference_spp
        row["error"] = _errors(frame, work, spp)
        row["mitsuba"] = mitsuba_timing.sweep(work.scene, camera, work.max_depth, frame.light_mask, spp)
        row["mitsuba_to_our_error_ms"] = mitsuba_timing.time_to_error(
            row["mitsuba"], row["error"]["relative_rmse"]
        )
    return row


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--adapter", default="auto")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--only", nargs="*", choices=sorted(workloads.ALL), default=list(workloads.ALL))
    parser.add_argument("--reference-spp", type=int, default=REFERENCE_SPP)
    parser.add_argument("--no-mitsuba", dest="mitsuba", action="store_false")
    parser.add_argument("--no-trace", dest="trace", action="store_false")
    parser.add_argument("--fast", action="store_true", help="no still and light-only frames")
    options = parser.parse_args()
    warnings.simplefilter("ignore", ml.SoftwareAdapterWarning)
    with ml.Renderer(options.adapter) as renderer:
        result: dict[str, Any] = about(renderer)
        print(f"{result['adapter']}, {result['trace']} rays, {result['commit']}", flush=True)
        result["rows"] = []
        for name in options.only:
            row = _row(renderer, workloads.ALL[name](options.size), options)
            result["rows"].append(row)
            print(tables.line(row), flush=True)
    result["trace_rates"] = trace_rates.measure(options.adapter, options.mitsuba) if options.trace else []
    RESULTS.mkdir(parents=True, exist_ok=True)
    stem = re.sub(r"[^a-z0-9]+", "-", result["adapter"].lower()).strip("-")
    (RESULTS / f"{stem}.json").write_text(json.dumps(result, indent=1) + "\n")
    (RESULTS / f"{stem}.md").write_text(tables.markdown(result))
    print(f"written: {RESULTS / stem}.json and .md")


if __name__ == "__main__":
    main()
