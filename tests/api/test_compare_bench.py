"""`benches/compare.py` flags what got slower or less accurate between two results, and nothing else."""

from __future__ import annotations

import copy
import importlib.util
import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

BENCHES = Path(__file__).resolve().parents[2] / "benches"
STORED = BENCHES / "results" / "llvmpipe-llvm-15-0-6-256-bits.json"
Edit = Callable[[dict[str, Any]], None]


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    # by its path: `compare` is a name that others may have, too
    spec = importlib.util.spec_from_file_location("miplight_bench_compare", BENCHES / "compare.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def stored() -> dict[str, Any]:
    return dict(json.loads(STORED.read_text()))


def _room(result: dict[str, Any]) -> dict[str, Any]:
    return next(row for row in result["rows"] if row["workload"] == "room")


def _nothing(result: dict[str, Any]) -> None:
    """Leave all as it was."""


def _slower(factor: float, *, mitsuba: bool) -> Edit:
    def edit(result: dict[str, Any]) -> None:
        for row in result["rows"]:
            for name in ("wall_ms", "still_ms", "light_only_ms"):
                if name in row:
                    row[name] *= factor
            row["stages"] = {name: factor * ms for name, ms in row["stages"].items()}
            for entry in row["mitsuba"] if mitsuba else ():
                entry["ms"] *= factor
        for rate in result["trace_rates"]:
            rate["rays_per_second"] /= factor

    return edit


def _set(name: str, factor: float, error: bool = False) -> Edit:
    def edit(result: dict[str, Any]) -> None:
        values = _room(result)["error"] if error else _room(result)
        values[name] *= factor

    return edit


def _gather(result: dict[str, Any]) -> None:
    row = _room(result)
    row["wall_ms"] += 40.0
    row["stages"]["direct/gather"] += 40.0


def _elsewhere(result: dict[str, Any]) -> None:
    _slower(9.0, mitsuba=False)(result)
    result["machine"] = "another"


def _elsewhere_and_worse(result: dict[str, Any]) -> None:
    _elsewhere(result)
    _set("relative_rmse", 1.3, error=True)(result)


def _settings(result: dict[str, Any]) -> None:
    row = _room(result)
    row["settings"]["light_samples"] = 1024
    row["settings"]["a_new_one"] = 3
    row["wall_ms"] *= 4.0


def _trace(result: dict[str, Any]) -> None:
    result["trace_rates"][0]["rays_per_second"] /= 1.5


def _run(bench: ModuleType, old: dict[str, Any], new: dict[str, Any], tmp_path: Path, *options: str) -> int:
    for name, result in (("old", old), ("new", new)):
        (tmp_path / f"{name}.json").write_text(json.dumps(result))
    return int(bench.main([str(tmp_path / "old.json"), str(tmp_path / "new.json"), *options]))


@pytest.mark.parametrize(
    ("edit", "worse", "says"),
    [
        (_nothing, 0, "drift of the machine: × 1.000"),
        (_set("wall_ms", 1.1), 0, "0 worse"),
        (_set("wall_ms", 1.2), 1, "× 1.200"),
        (_set("wall_ms", 0.8), 0, "1 better"),
        (_set("still_ms", 1.2), None, "still_ms"),
        (_gather, 1, "(direct/gather 17.97 → 57.97"),
        # slower altogether: by the machine, or by us
        (_slower(1.5, mitsuba=True), 0, "drift of the machine: × 1.500"),
        (_slower(1.5, mitsuba=False), None, "× 1.500"),
        (_set("relative_rmse", 1.04, error=True), 0, "0 worse"),
        (_set("relative_rmse", 1.06, error=True), 1, "relative_rmse"),
        (_set("median_relative_error", math.nan, error=True), 1, "nan"),
        (_elsewhere, 0, "times are not compared, the runs differ in machine"),
        (_elsewhere_and_worse, 1, "relative_rmse"),
        (_settings, 1, "settings: room, 128 × 128: light_samples 256 → 1024\n"),
        (_trace, 1, "ns a ray"),
        (lambda result: result["rows"].pop(0), 0, "left out: room, 128 × 128: only in the old run"),
        (
            lambda result: _room(result).update(triangles=7, wall_ms=1e9),
            0,
            "not the same scene, triangles 34 → 7",
        ),
    ],
)
def test_what_is_flagged(
    edit: Edit,
    worse: int | None,
    says: str,
    bench: ModuleType,
    stored: dict[str, Any],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    old, new = copy.deepcopy(stored), copy.deepcopy(stored)
    for result in (old, new):  # the stored run was made without
        _room(result)["still_ms"] = 20.0
    edit(new)
    code = _run(bench, old, new, tmp_path)
    out = capsys.readouterr().out
    assert says in out
    flagged = [line for line in out.splitlines() if line.startswith("WORSE")]
    assert code == int(bool(flagged))
    if worse is None:
        assert flagged
    else:
        assert len(flagged) == worse, out


def test_bands_can_be_chosen(bench: ModuleType, stored: dict[str, Any], tmp_path: Path) -> None:
    new = copy.deepcopy(stored)
    _set("wall_ms", 1.2)(new)
    _set("relative_rmse", 1.06, error=True)(new)
    assert _run(bench, stored, new, tmp_path) == 1
    assert _run(bench, stored, new, tmp_path, "--noise", "0.25") == 1, "the error is still worse"
    assert _run(bench, stored, new, tmp_path, "--noise", "0.25", "--error-noise", "0.1") == 0
    assert _run(bench, stored, new, tmp_path, "--least-ms", "99", "--least-error", "1") == 0


def test_what_cannot_be_compared(bench: ModuleType, stored: dict[str, Any], tmp_path: Path) -> None:
    other = copy.deepcopy(stored)
    for row in other["rows"]:
        row["size"] = [9, 9]
    assert _run(bench, stored, other, tmp_path) == 2
    assert bench.main([str(STORED), str(BENCHES / "results" / "claims.json")]) == 2
    assert bench.main([str(STORED), str(tmp_path / "missing.json")]) == 2
    (tmp_path / "cut.json").write_text(STORED.read_text()[:500])
    assert bench.main([str(tmp_path / "cut.json"), str(STORED)]) == 2


def test_it_runs_as_a_script(stored: dict[str, Any], tmp_path: Path) -> None:
    new = copy.deepcopy(stored)
    _gather(new)
    (tmp_path / "new.json").write_text(json.dumps(new))
    for path, code in ((STORED, 0), (tmp_path / "new.json", 1)):
        command = [sys.executable, str(BENCHES / "compare.py"), str(STORED), str(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == code, done.stdout + done.stderr
    wrong = subprocess.run(
        [*command, "--noise", "-1"], capture_output=True, text=True, timeout=60, check=False
    )
    assert wrong.returncode == 2
    assert "allowed" in wrong.stderr
