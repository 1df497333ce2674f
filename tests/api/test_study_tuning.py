"""Settings of rows of sweeps, of trials and of dicts; the example that tunes thresholds."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import optuna
import pandas as pd
import pytest

import miplight as ml

GRID: list[Any] = [
    {"preset": ["brute-force", "area-2010"], "light_samples": [16, 64]},
    # text, a choice, None where a number may be, a switch
    {"preset": "area-2010", "depth_threshold": [None, 0.125], "specular": "off", "visibility": "ray"},
    ml.Settings(light_samples=9, seed=2**32 - 1),
]


@pytest.fixture(scope="module")
def swept(adapter: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    scene = ml.Scene.from_trimesh(ml.shapes.bare_floor())
    scene.add_light(ml.AreaLight((-0.5, 2.5, -0.5), (1, 0, 0), (0, 0, 1), radiance=(8.0, 8.0, 8.0)))
    view = ml.Camera.look_at((0, 1.6, 6), (0, 0.5, 0), fov_y=45, width=24, height=16)
    path = tmp_path_factory.mktemp("swept") / "table.csv"
    return ml.study.sweep(scene, view, GRID, path=path, adapter=adapter), path


def _wanted() -> list[ml.Settings]:
    area = ml.Settings.preset("area-2010")
    sizes = [ml.Settings.preset(p).replace(light_samples=n) for p in GRID[0]["preset"] for n in (16, 64)]
    more = [area.replace(depth_threshold=d, specular="off", visibility="ray") for d in (None, 0.125)]
    return [*sizes, *more, GRID[2]]


def test_a_row_gives_the_settings_that_were_rendered(swept: tuple[Any, Path]) -> None:
    df, path = swept
    for table in (df, ml.study.load(path), ml.study.medians(df)):
        rows = [row for _, row in table.iterrows()]
        for given in (rows, [row.to_dict() for row in rows], list(table.itertuples())):
            found = [ml.study.settings_of(row) for row in given]
            assert found == _wanted()
            assert [s._base for s in found] == [s._base for s in _wanted()]


def test_a_row_s_settings_give_the_same_bits(swept: tuple[Any, Path]) -> None:
    """A table that is told apart from one whose rows were mixed up."""
    df, _ = swept
    found = [ml.study.settings_of(row).to_dict() for _, row in df.iterrows()]
    wanted = [settings.to_dict() for settings in _wanted()]
    assert found == wanted
    assert found != wanted[1:] + wanted[:1]


def test_gaps_and_floats_of_tables() -> None:
    row = pd.Series(
        {"preset": "area-2010", "light_samples": 64.0, "bit_threshold": np.nan, "interleave": pd.NA}
    )
    found = ml.study.settings_of(row)
    assert (found.light_samples, type(found.light_samples)) == (64, int)
    assert found.bit_threshold is None, "a gap is None where None is allowed"
    assert found.interleave == 2, "and the preset's value where it is not"
    assert ml.study.settings_of(row.drop("preset"), "area-2010") == found
    numbers = pd.DataFrame({"light_samples": [4, 9], "supersample": [1, 2], "ms": [1.5, 2.5]}).iloc[1]
    assert numbers.dtype == np.float64
    wanted = ml.Settings.preset("default").replace(light_samples=9, supersample=2)
    assert ml.study.settings_of(numbers) == wanted


def test_trials_and_dicts_change_a_base() -> None:
    base = ml.Settings.preset("area-2010").replace(seed=5)
    values = {"bit_threshold": np.int64(32), "illumination_threshold": np.float32(0.25), "specular": False}
    wanted = base.replace(bit_threshold=32, illumination_threshold=0.25, specular="off")
    for given in (values, SimpleNamespace(params=values)):
        assert ml.study.settings_of(given, base) == wanted
        assert ml.study.settings_of(given, base)._base == "area-2010"
    assert ml.study.settings_of({}) == ml.Settings.preset("default")
    assert ml.study.settings_of({}, "brute-force") == ml.Settings.preset("brute-force")
    assert ml.study.settings_of({"preset": "area-2016"}, base) == ml.Settings.preset("area-2016")


def test_trials_of_optuna() -> None:
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    seen: list[ml.Settings] = []

    def objective(trial: optuna.Trial) -> float:
        trial.suggest_categorical("preset", ["area-2010"])
        trial.suggest_int("bit_threshold", 1, 128, log=True)
        trial.suggest_float("illumination_threshold", 0.01, 1.0, log=True)
        trial.suggest_categorical("visibility", ["ray", "voxel"])
        trial.suggest_categorical("depth_threshold", [None, 0.1])
        seen.append(ml.study.settings_of(trial))
        return float(seen[-1].illumination_threshold)

    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    study.optimize(objective, n_trials=5)
    assert [ml.study.settings_of(trial) for trial in study.trials] == seen
    best = ml.study.settings_of(study.best_trial)
    assert best.illumination_threshold == min(s.illumination_threshold for s in seen) == study.best_value
    assert len(set(seen)) == 5


@pytest.mark.parametrize(
    ("given", "base", "says"),
    [
        ({"bit_treshold": 4}, None, "did you mean 'bit_threshold'"),
        ({"preset": "area-210"}, None, "did you mean 'area-2010'"),
        ({"light_samples": 4.5}, None, "light_samples"),
        ({"light_samples": float("nan")}, None, "light_samples"),
        ({"light_samples": -1}, None, "-1"),
        ({}, "area", "did you mean"),
        (SimpleNamespace(params={"nonesuch": 1}), None, "nonesuch"),
        (pd.Series({"ms": 4.0}), None, "none of the settings"),
        (pd.DataFrame({"light_samples": [4]}), None, "one row of it"),
        (5, None, "row_or_trial is 5"),
        (None, None, "row_or_trial is None"),
    ],
)
def test_what_gives_no_settings(given: Any, base: Any, says: str) -> None:
    with pytest.raises(ml.SettingsError, match=says):
        ml.study.settings_of(given, base)
