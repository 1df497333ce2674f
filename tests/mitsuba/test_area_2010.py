"""The preset `area-2010` with rays against Mitsuba's direct light."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

import miplight as ml
from miplight.testing import Comparison
from tests.mitsuba.reference_scenes import STORED, load

pytestmark = pytest.mark.mitsuba

MatchReference = Callable[..., Comparison]

AREA = ml.Settings.preset("area-2010").replace(visibility="ray")
ROOM = {"relative_rmse": 0.05, "median": 0.02, "energy": 0.005}
BOUNDS: dict[str, dict[str, float]] = {
    "one_light": ROOM,
    "two_lights": ROOM,
    "textured_light": ROOM,
    "hard_spot": ROOM,
    "far_near": ROOM,
    "ribbon_video": ROOM,
    # 3.4 % at 256 x 256; here nodes are twice as far apart on the scan, and reuse misses more between them
    "dragon_two": {**ROOM, "relative_rmse": 0.08},
    "dragon_card": {**ROOM, "relative_rmse": 0.07},
    # without reuse 5.8 %
    "cluttered": {"relative_rmse": 0.25, "energy": 0.02},
}


@pytest.mark.parametrize("name", list(BOUNDS))
def test_direct_light(
    renderer: ml.Renderer, match_reference: MatchReference, name: str, request: pytest.FixtureRequest
) -> None:
    if STORED[name].needs_scenes:
        request.getfixturevalue("scenes_folder")
    reference = load(name)
    scene, camera = STORED[name].build()
    frame = renderer.render(scene, camera, AREA)
    print(f"{name}: {match_reference(frame, reference, **BOUNDS[name])}")
    dim = np.float32(1 / 1.4)
    darker = dataclasses.replace(reference, mean=reference.mean * dim, halves=reference.halves * dim)
    with pytest.raises(AssertionError):  # negative control
        ml.testing.assert_matches(frame, darker, relative_rmse=BOUNDS[name]["relative_rmse"])


@pytest.mark.parametrize("name", ["dragon_two", "dragon_card", "cluttered"])
def test_without_reuse_hard_places_come_close(
    renderer: ml.Renderer, match_reference: MatchReference, name: str, request: pytest.FixtureRequest
) -> None:
    """What is missing above is what reuse takes for granted."""
    if STORED[name].needs_scenes:
        request.getfixturevalue("scenes_folder")
    scene, camera = STORED[name].build()
    frame = renderer.render(scene, camera, AREA.replace(visibility_reuse="off"))
    bounds = {"relative_rmse": 0.065 if name == "cluttered" else 0.03, "median": 0.02, "energy": 0.003}
    print(f"{name}: {match_reference(frame, load(name), **bounds)}")
