"""Examples and the page about studies run as they are, with less to render."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import optuna
import pytest
from matplotlib import pyplot as plt

import miplight as ml

ROOT = Path(__file__).resolve().parent.parent.parent
THRESHOLDS = {
    "illumination_threshold",
    "bit_threshold",
    "depth_threshold",
    "normal_threshold",
    "coarsest_level",
}


def _example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def _quiet() -> None:
    optuna.logging.set_verbosity(optuna.logging.ERROR)


# Optuna says of what it calls experimental that it is
@pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")
def test_tuning_finds_a_front_and_goes_on(tmp_path: Path, adapter: str) -> None:
    example = _example("tune_thresholds")
    out, storage = tmp_path / "out", f"sqlite:///{tmp_path}/tuning.db"
    common = ("--size", "32", "--cost", "fragments", "--storage", storage, "--adapter", adapter)
    first = example.main([*common, "--out", str(out), "--trials", "2"]).trials
    study = example.main([*common, "--out", str(out), "--trials", "6"])
    assert len(study.trials) == 6
    assert [t.values for t in study.trials[:2]] == [t.values for t in first]
    base = ml.Settings.preset("area-2010").replace(visibility="ray")
    assert set(study.trials[0].params) == THRESHOLDS
    assert ml.study.settings_of(study.trials[0], base) == base, "the preset as it is comes first"
    assert len({ml.study.settings_of(trial, base) for trial in study.trials}) == 6, "none is tried twice"
    found = json.loads((out / "front.json").read_text())
    values = [(row["fragments"], row["relative_rmse"]) for row in found]
    assert values == sorted(values)
    assert sorted((e for _, e in values), reverse=True) == [e for _, e in values]
    all_values = [tuple(trial.values) for trial in study.trials]
    for fragments, error in set(all_values) - set(values):
        assert any(f <= fragments and e <= error for f, e in values), "left out, and nothing beats it"
    assert (out / "front.png").stat().st_size > 1000


def test_a_front_s_settings_render_what_was_measured(
    tmp_path: Path, adapter: str, renderer: ml.Renderer
) -> None:
    example = _example("tune_thresholds")
    example.main(
        ["--size", "32", "--cost", "rays", "--trials", "3", "--out", str(tmp_path), "--adapter", adapter]
    )
    place = example.demo.spot_in_a_room(32, 32)
    reference = renderer.render(place.scene, place.camera, example.EXACT).image.copy()
    for row in json.loads((tmp_path / "front.json").read_text()):
        settings = ml.Settings.from_dict(row["settings"])
        frame = renderer.render(place.scene, place.camera, settings)
        assert ml.testing.compare(frame, reference).relative_rmse == row["relative_rmse"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
def test_the_page_about_studies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    text = (ROOT / "docs/studies.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 4
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    small = {
        "width=256, height=256": "width=24, height=24",
        "n_trials=20": "n_trials=2",
        "repeats=3": "repeats=2",
    }
    for block in blocks:
        for large, little in small.items():
            block = block.replace(large, little)
        exec(block, names)
    plt.close("all")
    assert names["settings"] in set(map(ml.study.settings_of, names["table"].iloc))
    assert list(names["again"]["image_hash"][::3]) == list(names["table"]["image_hash"][::2])
    assert (tmp_path / "sweep.csv").is_file()
    for example in re.findall(r"\]\(\.\./(examples/\w+\.py)\)", text):
        assert (ROOT / example).is_file()


def test_jobs_of_slurm_are_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    asked: dict[str, Any] = {}

    class Cluster:
        """Stands in for dask-jobqueue's, which needs SLURM."""

        def __init__(self, **options: Any) -> None:
            asked.update(options)

        def scale(self, jobs: int) -> None:
            asked["jobs"] = jobs

    monkeypatch.setitem(sys.modules, "dask_jobqueue", SimpleNamespace(SLURMCluster=Cluster))
    example = _example("sweep_on_slurm")
    options = {"local": 0, "partition": "gpu", "account": "me", "jobs": 3, "path": tmp_path / "sweep.csv"}
    assert isinstance(example.cluster_of(SimpleNamespace(**options)), Cluster)
    assert (asked["queue"], asked["account"], asked["jobs"]) == ("gpu", "me", 3)
    assert (asked["cores"], asked["processes"]) == (1, 1), "a worker renders one point at a time"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
def test_the_cluster_s_sweep_runs_here_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], adapter: str
) -> None:
    pytest.importorskip("distributed")
    example = _example("sweep_on_slurm")
    options = ["--local", "1", "--size", "16", "--path", str(tmp_path / "sweep.csv"), "--adapter", adapter]
    monkeypatch.setattr(example, "GRID", {"preset": "default", "light_samples": [16, 64]})
    table = example.main(options)
    assert table["error"].isna().all()
    assert "0 of them failed" in capsys.readouterr().out
    monkeypatch.setattr(example, "GRID", {"preset": "default", "light_samples": [16, 64, 256]})
    more = example.main(options)
    assert list(more["ms"][: len(table)]) == list(table["ms"]), "rows that were there are kept"
    assert len(more) == len(table) * 3 // 2
