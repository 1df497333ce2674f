"""Shared by all tests: the adapter, one renderer, a small room, and the rule that no skip is silent."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

import miplight as ml

os.environ.setdefault("MPLBACKEND", "Agg")  # no test opens a window

IN_CI = os.environ.get("CI", "").lower() in ("1", "true", "yes")
ALLOWED_SKIP = "MIPLIGHT_SCENES is not set"


def _must_fail(report: pytest.TestReport | pytest.CollectReport) -> bool:
    if not (IN_CI and report.skipped) or hasattr(report, "wasxfail"):
        return False
    return ALLOWED_SKIP not in str(report.longrepr)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """In CI, a skip other than the allowed one is a failure."""
    report = yield
    if _must_fail(report):
        report.outcome, report.longrepr = "failed", f"skipped, which CI does not allow: {report.longrepr}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The same for a module that skips itself as a whole."""
    report = yield
    if _must_fail(report):
        report.outcome, report.longrepr = "failed", f"skipped, which CI does not allow: {report.longrepr}"
    return report


@pytest.fixture(scope="session")
def adapter() -> str:
    """The adapter that tests render on: MIPLIGHT_ADAPTER, or what "auto" finds."""
    return os.environ.get("MIPLIGHT_ADAPTER", "auto")


@pytest.fixture(scope="session")
def renderer(adapter: str) -> Iterator[ml.Renderer]:
    """One renderer for the whole run; tests that need a fresh one make it."""
    with ml.Renderer(adapter) as shared:
        yield shared


@pytest.fixture(scope="session")
def scenes_folder() -> Path:
    """The folder of scenes that cannot be part of the repository; its absence is the one allowed skip."""
    folder = os.environ.get("MIPLIGHT_SCENES")
    if not folder:
        pytest.skip(ALLOWED_SKIP)
    path = Path(folder)
    assert path.is_dir(), f"MIPLIGHT_SCENES is {folder}, which is no folder"
    return path


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20090227)


@pytest.fixture
def room() -> ml.Scene:
    """A floor of 4 × 4 units with a box on it, under a light of 1 × 1 units."""
    scene = ml.Scene()
    floor = trimesh.Trimesh(
        [[-2, 0, -2], [-2, 0, 2], [2, 0, 2], [2, 0, -2]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    scene.add_mesh(floor, name="floor", material=ml.Material((0.7, 0.6, 0.5)), shading="flat")
    box = trimesh.creation.box((0.6, 0.8, 0.6))
    lift = np.eye(4)
    lift[1, 3] = 0.4
    scene.add_mesh(box, name="box", transform=lift, shading="flat")
    light = ml.AreaLight((-0.5, 2.5, -0.5), (1, 0, 0), (0, 0, 1), radiance=(8.0, 8.0, 8.0))
    scene.add_light(light, name="lamp")
    return scene


@pytest.fixture
def camera() -> ml.Camera:
    """A view of `room` in which the floor, the box, the light and the void are seen; 48 × 36 pixels."""
    return ml.Camera.look_at((0, 1.6, 6), (0, 1.2, 0), fov_y=45, width=48, height=36)


@pytest.fixture
def quick() -> ml.Settings:
    """Settings for tests that look at the surface of the package rather than at the light."""
    return ml.Settings.preset("brute-force").replace(light_samples=16)
