"""Files of sweeps: what is read is what was written, and a sweep that was killed goes on where it was."""

from __future__ import annotations

import importlib.util
import json
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import miplight as ml
from miplight.study_journal import Journal

GRID = {"preset": ["brute-force", "default"], "light_samples": [4], "seed": range(3)}
KEPT = ["point", "preset", "camera", "lights", "repeat", "error", "image_hash", "fragments", "rays"]


@pytest.mark.parametrize("name", ["s.parquet", "s.csv", "s"])
def test_what_is_read_is_what_was_written(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, tmp_path: Path, name: str
) -> None:
    path, reference = tmp_path / "new" / name, np.ones((36, 48, 3), np.float32)
    places = {"lights": {"1e5": room.lights["lamp"]}, "camera": {"007": camera}}
    df = ml.study.sweep(room, None, {**GRID, **places}, reference, path=path, renderer=renderer)
    assert list(df["lights"].unique()) == ["1e5"]
    assert list(df["camera"].unique()) == ["007"]
    pd.testing.assert_frame_equal(ml.study.load(path), df, check_exact=True)
    assert [p.name for p in path.parent.iterdir()] == [name if name != "s" else "s.parquet"]
    again = ml.study.sweep(room, None, {**GRID, **places}, reference, path=path, renderer=renderer)
    pd.testing.assert_frame_equal(again, df, check_exact=True)


def test_more_of_the_same_is_added(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, tmp_path: Path
) -> None:
    path = tmp_path / "s.parquet"
    first = ml.study.sweep(room, camera, GRID, path=path, renderer=renderer, repeats=2)
    grid = {**GRID, "seed": [7, 0]}
    second = ml.study.sweep(room, camera, grid, path=path, renderer=renderer, repeats=3)
    assert list(second["seed"]) == [7, 7, 7, 0, 0, 0] * 2
    both = ml.study.load(path)
    assert len(both) == 12 + 2 * (3 + 1), "three repeats of a new seed, a third one of an old seed"
    old = second[(second["seed"] == 0) & (second["repeat"] < 2)][["point", "repeat", "ms"]]
    assert len(old.merge(first[["point", "repeat", "ms"]])) == 4, "what was there is not rendered again"


def test_a_line_cut_short_is_dropped(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, tmp_path: Path
) -> None:
    whole = ml.study.sweep(room, camera, GRID, renderer=renderer)
    path = tmp_path / "s.csv"
    rows = [json.dumps({k: v for k, v in row.items() if pd.notna(v)}) for row in whole.to_dict("records")]
    beside = tmp_path / "s.csv.rows"
    beside.write_text(rows[0] + "\n" + rows[1] + "\n" + '{"point": "half\n' + rows[2] + "\n" + rows[3][:100])
    assert list(ml.study.load(path)["seed"]) == [0, 1, 2]
    assert beside.read_text().endswith(rows[3][:100]), "reading changes nothing"
    df = ml.study.sweep(room, camera, GRID, path=path, renderer=renderer)
    pd.testing.assert_frame_equal(df[KEPT], whole[KEPT], check_exact=True)
    assert (df["ms"][:3] == whole["ms"][:3]).all()
    assert (df["ms"][3:] != whole["ms"][3:]).all()


def test_a_file_has_one_writer(tmp_path: Path) -> None:
    with Journal(tmp_path / "s.csv") as first:
        first.add({"point": "a", "repeat": 0})
        with pytest.raises(ml.SettingsError, match="another sweep is writing"):
            Journal(tmp_path / "s.csv")
    assert list(ml.study.load(tmp_path / "s.csv")["point"]) == ["a"]
    with Journal(tmp_path / "t.csv"):
        pass
    assert not list(tmp_path.glob("t.*")), "no rows, no file"


def test_files_that_are_something_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ml.SettingsError, match="the file of a sweep"):
        ml.study.load(tmp_path / "missing.csv")
    (tmp_path / "x.csv").write_text("a,b\n1,2\n")
    (tmp_path / "x.parquet").write_bytes(b"nothing of the kind")
    for name in ("x.csv", "x.parquet"):
        with pytest.raises(ml.SettingsError, match="no table of a sweep"):
            ml.study.load(tmp_path / name)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ml.SettingsError, match="Parquet needs pyarrow"):
        Journal(tmp_path / "y.parquet")
    with Journal(tmp_path / "y") as journal:
        journal.add({"point": "a", "repeat": 0})
    assert (tmp_path / "y.csv").is_file(), "without pyarrow a table is CSV"


SCRIPT = """
    import pickle, sys
    import miplight as ml

    if __name__ == "__main__":
        scene, camera, reference = pickle.loads(open(sys.argv[1], "rb").read())
        grid = {"preset": ["brute-force"], "light_samples": [4, 8, 16, 32], "seed": range(50)}
        ml.study.sweep(scene, camera, grid, reference, path=sys.argv[2], adapter=sys.argv[3])
"""


def _run(folder: Path, name: str, adapter: str) -> subprocess.Popen[bytes]:
    script = folder / "sweep.py"
    script.write_text(textwrap.dedent(SCRIPT))
    arguments = [str(path) for path in (script, folder / "place", folder / name)]
    return subprocess.Popen([sys.executable, "-W", "ignore", *arguments, adapter])


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


@pytest.mark.slow
def test_a_sweep_that_is_killed_ends_like_one_that_is_not(
    room: ml.Scene, camera: ml.Camera, tmp_path: Path, adapter: str
) -> None:
    view = camera.replace(width=16, height=12)
    place = room, view, np.ones((12, 16, 3), np.float32)
    (tmp_path / "place").write_bytes(pickle.dumps(place))
    assert _run(tmp_path, "whole.parquet", adapter).wait(120) == 0
    random = np.random.default_rng()
    beside, kills = tmp_path / "cut.parquet.rows", 0
    for part in sorted(random.integers(1, 190, 2)):
        # somewhere in the render that follows this many rows
        process = _run(tmp_path, "cut.parquet", adapter)
        while process.poll() is None and _lines(beside) < part:
            time.sleep(0.001)
        time.sleep(float(random.uniform(0, 0.01)))
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
            kills += 1
        process.wait(60)
        if process.returncode == 0:
            break
        assert part <= len(ml.study.load(tmp_path / "cut.parquet")) <= 200
    assert kills, "nothing was killed"
    assert _run(tmp_path, "cut.parquet", adapter).wait(120) == 0
    whole, cut = (ml.study.load(tmp_path / f"{name}.parquet") for name in ("whole", "cut"))
    assert len(whole) == 200
    assert whole["error"].isna().all()
    timed = [name for name in whole.columns if name.endswith("ms") or name.startswith("ms:")]
    pd.testing.assert_frame_equal(
        cut.drop(columns=timed), whole.drop(columns=timed)[cut.columns.drop(timed)], check_exact=True
    )
    assert not beside.exists()
