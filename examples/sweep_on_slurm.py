"""A sweep on a cluster that SLURM runs: each job is one worker with one GPU.

    python examples/sweep_on_slurm.py --jobs 8 --partition gpu
    python examples/sweep_on_slurm.py --local 2             # the same on this machine, to try it

Run it where it may wait for long, as in a job of its own. Started again it renders what is missing.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import distributed

import miplight as ml
from miplight import demo

GRID = [
    {"preset": ["brute-force", "default", "area-2016"], "light_samples": [16, 64, 256]},
    {
        "preset": "area-2010",
        "visibility": ["voxel", "ray"],
        "illumination_threshold": [0.05, 0.1, 0.2, 0.4],
        "bit_threshold": [16, 64, 128],
    },
]
EXACT = ml.Settings.preset("brute-force").replace(light_samples=1024, seed=7)


def cluster_of(options: argparse.Namespace) -> Any:
    """Workers with one thread each: a worker renders one point at a time."""
    if options.local:
        return distributed.LocalCluster(
            n_workers=options.local, threads_per_worker=1, dashboard_address=None, silence_logs=50
        )
    from dask_jobqueue import SLURMCluster  # pip install dask-jobqueue

    cluster = SLURMCluster(
        queue=options.partition,
        account=options.account,
        cores=1,
        processes=1,
        job_cpu=4,
        memory="8GB",
        walltime="02:00:00",
        job_extra_directives=["--gres=gpu:1"],
        log_directory=str(options.path.parent / "logs"),
        # what a job's shell needs before Python starts
        job_script_prologue=["export OMP_NUM_THREADS=4"],
    )
    cluster.scale(jobs=options.jobs)
    return cluster


def main(arguments: Sequence[str] | None = None) -> Any:
    """Render what is missing of the sweep, and print what nothing beats."""
    parser = argparse.ArgumentParser(description="A sweep on a cluster.")
    parser.add_argument("--path", type=Path, default=Path("out/sweep.csv"))
    parser.add_argument("--size", type=int, default=512, help="pixels along each side")
    parser.add_argument("--jobs", type=int, default=8)
    parser.add_argument("--partition", default=None)
    parser.add_argument("--account", default=None)
    parser.add_argument(
        "--adapter", default=None, help='of the workers: "gpu" by default, "auto" with --local'
    )
    parser.add_argument("--local", type=int, default=0, metavar="N", help="N workers on this machine instead")
    options = parser.parse_args(arguments)
    options.path.parent.mkdir(parents=True, exist_ok=True)
    adapter = options.adapter or ("auto" if options.local else "gpu")
    place = demo.spot_in_a_room(options.size, options.size)
    # the node that this runs on may have no GPU
    with ml.Renderer() as renderer:
        reference = renderer.render(place.scene, place.camera, EXACT).image
    with cluster_of(options) as cluster, distributed.Client(cluster) as client:
        table = ml.study.sweep(
            place.scene, place.camera, GRID, reference, 3, client, path=options.path, adapter=adapter
        )
    failed = table["error"].notna().sum()
    print(f"{len(table)} rows in {options.path}, {failed} of them failed")
    columns = ["preset", "light_samples", "visibility", "ms", "relative_rmse", "adapter"]
    print(ml.study.pareto(ml.study.medians(table))[columns].to_string(index=False))
    return table


if __name__ == "__main__":
    main()
