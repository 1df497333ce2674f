"""Tune the thresholds of a preset for time and error at once, with Optuna.

    python examples/tune_thresholds.py --trials 60
    python examples/tune_thresholds.py --trials 60 --storage sqlite:///tuning.db    # stops and goes on

Prints the settings on the front, writes them as JSON, and draws all trials beside the preset as it is.
"""

from __future__ import annotations

import argparse
import functools
import json
import warnings
from collections.abc import Sequence
from pathlib import Path

import optuna
from matplotlib.figure import Figure

import miplight as ml
from miplight import demo

COSTS = ("ms", "fragments", "rays")
EXACT = ml.Settings.preset("brute-force").replace(light_samples=1024, seed=7)


def suggested(trial: optuna.Trial, base: ml.Settings) -> ml.Settings:
    """Settings that Optuna would like to see tried."""
    trial.suggest_float("illumination_threshold", 0.01, 2.0, log=True)
    trial.suggest_int("bit_threshold", 1, 256, log=True)
    trial.suggest_float("depth_threshold", 0.005, 0.5, log=True)
    trial.suggest_float("normal_threshold", 0.05, 1.0, log=True)
    trial.suggest_int("coarsest_level", 2, 5)
    return ml.study.settings_of(trial, base)


def measured(
    trial: optuna.Trial,
    place: demo.Demo,
    reference: ml.Frame,
    base: ml.Settings,
    renderer: ml.Renderer,
    cost: str,
) -> tuple[float, float]:
    """Cost and error of a trial, measured as sweeps measure them; a render that fails prunes it."""
    settings = suggested(trial, base)
    table = ml.study.sweep(
        place.scene, place.camera, settings, reference.image, repeats=3, renderer=renderer, progress=False
    )
    row = ml.study.medians(table).iloc[0]
    if row["error"] is not None:
        raise optuna.TrialPruned(row["error"])
    for name in COSTS:
        trial.set_user_attr(name, float(row[name]))
    return float(row[cost]), float(row["relative_rmse"])


def as_it_is(base: ml.Settings, distributions: Sequence[str]) -> dict[str, object]:
    """The thresholds that a preset has, as a trial to begin with."""
    return {name: getattr(base, name) for name in distributions}


def draw(study: optuna.Study, cost: str, path: Path) -> None:
    """Draw cost and error of every trial; the front as a line, the preset as it is with a cross."""
    figure = Figure(figsize=(6, 4.2), layout="constrained")
    ax = figure.add_subplot()
    done = [trial for trial in study.trials if trial.state == optuna.trial.TrialState.COMPLETE]
    ax.scatter(*zip(*(trial.values for trial in done), strict=True), s=14, color="0.6", label="trials")
    front = sorted(trial.values for trial in study.best_trials)
    ax.plot(*zip(*front, strict=True), "o-", drawstyle="steps-post", label="front")
    ax.plot(*done[0].values, "rx", markersize=10, label="as the preset has them")
    ax.set(xlabel=f"time, {cost}" if cost == "ms" else cost, ylabel="relative RMSE", yscale="log")
    ax.legend()
    figure.savefig(path)


def main(arguments: Sequence[str] | None = None) -> optuna.Study:
    """Tune, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--preset", default="area-2010", choices=["area-2010", "area-2016"])
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--size", type=int, default=256, help="pixels along each side")
    parser.add_argument(
        "--cost", default="ms", choices=COSTS, help="fragments and rays are the same everywhere"
    )
    parser.add_argument("--storage", default=None, help="an Optuna storage, to stop and go on")
    parser.add_argument("--adapter", default="auto")
    parser.add_argument("--out", type=Path, default=Path("out/tuning"))
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", ml.SoftwareAdapterWarning)
    place = demo.spot_in_a_room(options.size, options.size)
    base = ml.Settings.preset(options.preset).replace(visibility="ray")
    study = optuna.create_study(
        study_name=f"{options.preset}, {options.size}, {options.cost}",
        storage=options.storage,
        load_if_exists=True,
        directions=["minimize", "minimize"],
    )
    done = sum(trial.state.is_finished() for trial in study.trials)
    # the same trials in every run from the start, and others than before when it goes on
    study.sampler = optuna.samplers.TPESampler(seed=len(study.trials), multivariate=True)
    if not study.trials:
        names = (
            "illumination_threshold",
            "bit_threshold",
            "depth_threshold",
            "normal_threshold",
            "coarsest_level",
        )
        study.enqueue_trial(as_it_is(base, names))
    with ml.Renderer(options.adapter) as renderer:
        reference = renderer.render(place.scene, place.camera, EXACT)
        reference.image  # noqa: B018 -- read before the renderer goes on
        run = functools.partial(
            measured, place=place, reference=reference, base=base, renderer=renderer, cost=options.cost
        )
        study.optimize(run, n_trials=max(0, options.trials - done))
    options.out.mkdir(parents=True, exist_ok=True)
    found = []
    for trial in sorted(study.best_trials, key=lambda trial: trial.values):
        settings = ml.study.settings_of(trial, base)
        found.append(
            {options.cost: trial.values[0], "relative_rmse": trial.values[1], "settings": settings.to_dict()}
        )
        changed = ", ".join(f"{name}={value:.3g}" for name, value in trial.params.items())
        print(f"{trial.values[0]:>10,.1f} {options.cost}  {trial.values[1]:.2%}  {changed}")
    (options.out / "front.json").write_text(json.dumps(found, indent=1) + "\n")
    draw(study, options.cost, options.out / "front.png")
    print(f"written: {(options.out / 'front.json').resolve()} and front.png")
    return study


if __name__ == "__main__":
    main()
