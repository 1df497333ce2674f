"""Sweeps on a Dask cluster of two processes: the same rows as without, also when one of them is killed."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import miplight as ml
from miplight import study_rows, study_workers

distributed = pytest.importorskip("distributed")

GRID = {"preset": ["brute-force", "default"], "light_samples": [4, 16], "seed": range(3)}
# a cluster is slow to start and to stop, and threads of its own end after it
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    )
    with cluster, distributed.Client(cluster) as made:
        yield made


def _same(df: Any, expected: Any) -> None:
    """All but the times."""
    timed = [name for name in df.columns if name.endswith("ms") or name.startswith("ms:")]
    pd.testing.assert_frame_equal(
        df.drop(columns=timed), expected[df.columns].drop(columns=timed), check_exact=True
    )


def test_workers_give_the_same_rows(client: Any, room: ml.Scene, camera: ml.Camera, adapter: str) -> None:
    reference = np.ones((36, 48, 3), np.float32)
    here = ml.study.sweep(room, camera, GRID, reference, repeats=2, adapter=adapter)
    there = ml.study.sweep(room, camera, GRID, reference, 2, client, adapter=adapter)
    assert len(there) == 24
    assert there["error"].isna().all()
    _same(there, here)


def test_what_all_points_share_is_sent_once(
    client: Any, room: ml.Scene, camera: ml.Camera, adapter: str
) -> None:
    ml.study.sweep(room, camera, GRID, client=client, adapter=adapter)

    def kept() -> tuple[int, int]:
        return len(study_workers._kept), sum(r._renderer is not None for r in study_workers._kept.values())

    assert list(client.run(kept).values()) == [(1, 1)] * 2, "each worker has one renderer"
    deadline = time.monotonic() + 10
    while client.futures and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not client.futures, "nothing is left behind"


def test_failures_are_rows_there_too(client: Any, room: ml.Scene, camera: ml.Camera) -> None:
    df = ml.study.sweep(room, camera, GRID, client=client, adapter="nonesuch")
    assert len(df) == 12
    assert df["error"].str.startswith("DeviceError").all()


def test_a_worker_that_dies_loses_nothing(
    client: Any, room: ml.Scene, camera: ml.Camera, adapter: str, tmp_path: Path
) -> None:
    grid = {"preset": "brute-force", "light_samples": [4, 16], "seed": range(60)}
    here = ml.study.sweep(room, camera, grid, adapter=adapter)
    victim = sorted(client.run(os.getpid).values())[0]
    beside, killed = tmp_path / "s.csv.rows", threading.Event()

    def kill() -> None:
        while not beside.exists() or beside.read_bytes().count(b"\n") < 30:
            time.sleep(0.001)
        os.kill(victim, signal.SIGKILL)
        killed.set()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    there = ml.study.sweep(room, camera, grid, client=client, path=tmp_path / "s.csv", adapter=adapter)
    killer.join(10)
    assert killed.is_set()
    assert victim not in client.run(os.getpid).values()
    assert len(there) == 120
    _same(there, here)
    assert len(ml.study.load(tmp_path / "s.csv")) == 120, "nothing is there twice"


def test_a_point_that_kills_workers_is_a_row(
    client: Any, room: ml.Scene, camera: ml.Camera, adapter: str
) -> None:
    def deadly() -> None:
        inner = study_rows.Renders.rows

        def rows(self: Any, point: Any, repeats: Any) -> Any:
            if point.settings.seed == 1:
                os.kill(os.getpid(), signal.SIGKILL)
            return inner(self, point, repeats)

        study_rows.Renders.rows = rows  # type: ignore[method-assign]

    class Deadly(distributed.WorkerPlugin):  # type: ignore[misc, name-defined]
        def setup(self, worker: Any) -> None:
            del worker
            deadly()

    client.register_plugin(Deadly(), name="deadly")
    try:
        grid = {"preset": "brute-force", "light_samples": 4, "seed": range(4)}
        df = ml.study.sweep(room, camera, grid, client=client, adapter=adapter)
    finally:
        client.unregister_worker_plugin("deadly")
    assert list(df["error"].notna()) == [False, True, False, False]
    assert df["error"][1].startswith("KilledWorker")


def test_only_a_client_is_one(room: ml.Scene, camera: ml.Camera, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ml.SettingsError, match="client is 5; allowed: a dask.distributed.Client"):
        ml.study.sweep(room, camera, "brute-force", client=5)
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ml.SettingsError, match="client needs Dask"):
        ml.study.sweep(room, camera, "brute-force", client=5)
