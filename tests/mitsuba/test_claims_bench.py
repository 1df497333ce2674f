"""`benches/claims.py` runs, says what is broken, and finds Mitsuba's time between two counts of samples."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import miplight as ml
from tests.claim_scenes import CLAIMS, Bounds, available

pytestmark = pytest.mark.mitsuba

BENCHES = Path(__file__).parents[2] / "benches"


@pytest.fixture
def benches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the modules of the benches importable, as they are when one of them is run."""
    monkeypatch.syspath_prepend(str(BENCHES))


def test_a_small_run() -> None:
    command = [sys.executable, str(BENCHES / "claims.py"), "--only", "boxes", "half_unlit", "--sizes", "24"]
    command += ["--reference-spp", "16", "--each", "light_samples=4 seed=1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode in (0, 1), done.stderr
    head, *rows = done.stdout.splitlines()[1:]
    assert head.split()[:3] == ["scene", "size", "RMSE"]
    assert [row.split()[0] for row in rows] == ["boxes", "light_samples=4", "half_unlit", "light_samples=4"]
    assert all("pass" in row or "FAIL" in row for row in rows)
    assert done.returncode == int(any("FAIL" in row for row in rows))
    unknown = subprocess.run([*command[:3], "box"], capture_output=True, text=True, timeout=60, check=False)
    assert unknown.returncode == 2
    assert "unknown: box; allowed: " in unknown.stderr


@pytest.mark.usefixtures("benches")
def test_a_row_is_judged_by_every_bound() -> None:
    import claims

    bounds = Bounds(0.02, 0.006, shadow_rays=0)
    good = {"size": 256, "relative_rmse": 0.019, "median": 0.005, "rays_a_pixel": 20.0, "faster": 1.6}
    good |= {"shadow_rays": 0, "fragments_a_pixel": 0.3}
    assert claims.broken(good, bounds) == []
    worse: dict[str, Any] = {"relative_rmse": 0.021, "median": 0.007, "rays_a_pixel": 21.0, "faster": 1.4}
    worse |= {"shadow_rays": 3, "fragments_a_pixel": float("nan")}
    for name, value in worse.items():
        (found,) = claims.broken(good | {name: value}, bounds)
        assert found.startswith(name)
    assert claims.broken(good | {"size": 1024, "faster": 5.0}, bounds) == ["faster 5.00 < 6"]
    assert claims.broken(good | {"size": 512, "faster": 2.0, "median": 1.0}, bounds) == ["faster 2.00 < 2.5"]


@pytest.mark.usefixtures("benches")
def test_the_time_to_an_error_lies_between_two_counts() -> None:
    import mitsuba_at_error

    scene, camera = CLAIMS["boxes"].build(24, 24)
    reference = ml.mitsuba.reference(scene, camera, 4096, part="direct")
    mask = reference.mean.max(axis=-1) > 0
    peer = mitsuba_at_error.Peer(scene, camera)
    errors = [
        ml.metrics.relative_rmse(peer.picture("light", n), reference, mask=mask, trim=0.001) for n in (16, 64)
    ]
    assert errors[1] < 0.7 * errors[0]
    between = peer.time_to(float(np.sqrt(errors[0] * errors[1])), reference, mask)
    assert between["bound"] == "="
    (low, fast, _), (high, slow, _) = between["points"]
    assert low < high
    assert min(fast, slow) <= between["ms"] <= max(fast, slow)
    assert peer.time_to(10.0, reference, mask)["bound"] == "<"
    assert peer.time_to(1e-9, reference, mask)["bound"] == ">"


def test_scans_are_left_out_where_there_is_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MIPLIGHT_SCENES", raising=False)
    assert set(available()) == {name for name, claim in CLAIMS.items() if not claim.needs_scenes}
    with pytest.raises(FileNotFoundError, match="MIPLIGHT_SCENES"):
        CLAIMS["dragon_one"].build(8, 8)
    monkeypatch.setenv("MIPLIGHT_SCENES", "anywhere")
    assert set(available()) == set(CLAIMS)
