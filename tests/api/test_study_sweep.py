"""Sweeps: a row is what a render says, failures are rows, nothing is used again, nothing grows."""

from __future__ import annotations

import hashlib
import io
import resource
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import miplight as ml
from miplight import study_rows, study_sweep

BRUTE = ml.Settings.preset("brute-force").replace(light_samples=16)
GRID = {"preset": ["brute-force", "area-2010"], "light_samples": [16, 64]}


def test_a_row_is_what_a_render_says(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    reference = renderer.render(room, camera, BRUTE.replace(light_samples=256)).image.copy()
    df = ml.study.sweep(room, camera, GRID, reference, renderer=renderer)
    assert len(df) == 4
    for _, row in df.iterrows():
        settings = ml.Settings.preset(row["preset"]).replace(light_samples=row["light_samples"])
        frame = renderer.render(room, camera, settings)
        found = ml.testing.compare(frame, reference)
        assert row["error"] is None
        for name in ("relative_rmse", "untrimmed", "median", "energy"):
            assert row[name] == getattr(found, name)
        assert row["image_hash"] == hashlib.sha256(frame.image.tobytes()).hexdigest()[:32]
        assert row["fragments"] == frame.fragments.total
        assert row["rays"] >= frame.stats.rays, "a still frame does not trace again what pixels see"
        assert row["light_evaluations"] == frame.stats.light_evaluations
        assert pd.isna(row["indirect_fragments"])
        assert row["adapter"] == renderer.adapter["name"]
        assert row["driver"] == renderer.adapter["driver"]
        assert row["version"] == ml.__version__
        assert (row["width"], row["height"], row["repeat"]) == (48, 36, 0)
        for name, value in frame.settings.to_dict().items():
            assert row[name] == value or (value is None and pd.isna(row[name])), name
        stages = row.filter(like="ms:").dropna()
        assert set(frame.stats.stages) <= {name.removeprefix("ms:") for name in stages.index}
        assert 0.9 * row["total_ms"] <= stages.sum() <= row["total_ms"] * 1.1
        assert row["ms"] >= row["total_ms"]


def test_nothing_is_left_from_the_frame_before(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    """Each repeat draws what pixels see, and gives the same bits; nothing is built for a mere value."""
    renderer.render(room, camera, BRUTE)
    still = renderer.render(room, camera, BRUTE)
    left_out = [name for name in still.stats.skipped if name.startswith("geometry")]
    assert left_out, "a still frame leaves something out"
    df = ml.study.sweep(
        room, camera, {"preset": "brute-force", "light_samples": [4, 8, 16]}, repeats=2, renderer=renderer
    )
    assert (df["repeat"] == [0, 1] * 3).all()
    for name in left_out:
        if f"ms:{name}" in df.columns:
            assert df[f"ms:{name}"].notna().all()
    assert any(f"ms:{name}" in df.columns for name in left_out)
    assert (df["rebuilt"] == "").all()
    assert (df.groupby("point")["image_hash"].nunique() == 1).all()
    assert df["image_hash"].nunique() == 3


def test_warm_ups_are_thrown_away(room: ml.Scene, camera: ml.Camera, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[Any, ...]] = []
    inner = ml.Renderer.render

    def render(self: Any, scene: Any, view: Any, settings: Any, outputs: Any) -> ml.Frame:
        seen.append((view == camera, settings.direct))
        return inner(self, scene, view, settings, outputs)

    monkeypatch.setattr(ml.Renderer, "render", render)
    aside, measured = (False, "off"), (True, "on")
    ml.study.sweep(room, camera, BRUTE, repeats=2)
    assert seen == [measured, aside, measured, aside, measured]
    seen.clear()
    ml.study.sweep(room, camera, BRUTE)
    assert seen == [aside, measured]


def test_failures_are_rows(
    room: ml.Scene, camera: ml.Camera, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    inner = ml.Renderer.render
    made: list[Any] = []
    broken = {8: ml.SettingsError("no eights"), 32: ml.DeviceError("lost")}

    def render(self: Any, scene: Any, view: Any, settings: Any, outputs: Any) -> ml.Frame:
        made.append(self)
        if settings.light_samples in broken:
            raise broken[settings.light_samples]
        return inner(self, scene, view, settings, outputs)

    monkeypatch.setattr(ml.Renderer, "render", render)
    grid = {"preset": "brute-force", "light_samples": [4, 8, 16, 32, 64]}
    df = ml.study.sweep(room, camera, grid, repeats=2, path=tmp_path / "s.csv")
    told = df.drop_duplicates("point")["error"].tolist()
    assert told == [None, "SettingsError: no eights", None, "DeviceError: lost", None]
    assert (df["error"].isna() == df["ms"].notna()).all()
    assert (df["error"].isna() == (df["image_hash"] != "")).all()
    assert len(df) == 10
    assert len(set(map(id, made))) == 2, "a renderer whose adapter was lost is made anew"
    broken.clear()
    kept = ml.study.sweep(room, camera, grid, repeats=2, path=tmp_path / "s.csv")
    pd.testing.assert_frame_equal(kept, df, check_exact=True)
    again = ml.study.sweep(room, camera, grid, repeats=2, path=tmp_path / "s.csv", retry=True)
    assert again["error"].isna().all()
    good = df["error"].isna()
    pd.testing.assert_frame_equal(again[good][df.columns], df[good], check_exact=True)


def test_an_error_that_cannot_be_had_leaves_the_times(renderer: ml.Renderer, room: ml.Scene) -> None:
    away = ml.Camera.look_at((0, 1, 6), (0, 1, 9), width=24, height=16)
    df = ml.study.sweep(room, away, BRUTE, np.ones((16, 24, 3), np.float32), renderer=renderer)
    assert "mask" in df["error"][0]
    assert df["ms"][0] > 0
    assert np.isnan(df["relative_rmse"][0])


def test_ctrl_c_stops_and_leaves_what_was_done(
    room: ml.Scene, camera: ml.Camera, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    inner = study_rows.Renders._measured

    def measured(self: Any, point: Any, repeat: int) -> Any:
        if point.settings.light_samples == 16:
            raise KeyboardInterrupt
        return inner(self, point, repeat)

    grid = {"preset": "brute-force", "light_samples": [4, 8, 16, 32]}
    with monkeypatch.context() as patch:
        patch.setattr(study_rows.Renders, "_measured", measured)
        with pytest.raises(KeyboardInterrupt):
            ml.study.sweep(room, camera, grid, path=tmp_path / "s")
    before = ml.study.load(tmp_path / "s")
    assert list(before["light_samples"]) == [4, 8]
    after = ml.study.sweep(room, camera, grid, path=tmp_path / "s")
    assert list(after["light_samples"]) == [4, 8, 16, 32]
    pd.testing.assert_frame_equal(after[:2], before, check_exact=True)


def test_memory_does_not_grow(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    def megabytes() -> float:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20

    if not Path("/proc/self/statm").exists():
        pytest.skip("no /proc on this system")
    view = camera.replace(width=192, height=144)
    grid = {"preset": "brute-force", "light_samples": [4], "seed": range(150)}
    ml.study.sweep(room, view, grid, renderer=renderer)
    before = megabytes()
    df = ml.study.sweep(room, view, {**grid, "seed": range(1000, 1300)}, renderer=renderer)
    assert len(df) == 300
    frame = 192 * 144 * 12 / 2**20
    grown = megabytes() - before
    assert grown < 0.1 * 300 * frame, f"{grown:.1f} MiB; 300 images are {300 * frame:.0f} MiB"


def test_progress_is_a_line_with_the_time_left() -> None:
    stream = io.StringIO()
    with study_sweep._Progress(4, 2, True, stream) as bar:
        bar._start -= 90.0
        bar.step()
        bar.step()
    lines = [line.strip() for line in stream.getvalue().split("\r")[1:]]
    assert lines[0] == "2 of 4 renders, 50%"
    assert lines[1] == "3 of 4 renders, 75%, 1:30 left"
    assert lines[2] == "4 of 4 renders, 100%"
    assert study_sweep._clock(3725) == "1:02:05"
    with study_sweep._Progress(4, 2, None, stream := io.StringIO()) as bar:
        bar.step()
    assert not stream.getvalue(), "nothing where there is no terminal"


def test_an_empty_list_is_an_empty_table(room: ml.Scene, camera: ml.Camera) -> None:
    df = ml.study.sweep(room, camera, [])
    assert df.empty
    assert {"error", "ms", "fragments", "rays", "light_samples"} <= set(df.columns)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"repeats": 0}, "repeats is 0"),
        ({"client": 5}, "client is 5"),
        ({"path": "x.txt"}, "'x.txt'; allowed: a file name that ends in .parquet or .csv"),
        ({"adapter": "nonesuch"}, "nonesuch"),
        ({"scene": 3}, "scene is 3"),
        ({"camera": 3}, "camera is 3"),
        ({"reference": np.ones((3, 3, 3))}, "reference is an array"),
        ({"client": 5, "renderer": 3}, "renderer is 3; allowed: None with a client"),
    ],
)
def test_slips(room: ml.Scene, camera: ml.Camera, change: dict[str, Any], says: str) -> None:
    with pytest.raises(ml.MiplightError, match=says):
        ml.study.sweep(**{"scene": room, "camera": camera, "grid": BRUTE, **change})
