"""Indirect light from a propagation volume against Mitsuba's one bounce."""

from __future__ import annotations

import pytest

import miplight as ml
from tests.mitsuba.reference_scenes import STORED, load

pytestmark = pytest.mark.mitsuba

LPV = ml.Settings(direct="off", indirect="lpv")


@pytest.mark.parametrize("reference", ["spot_indirect", "one_bounce_indirect"])
def test_a_room_with_a_scan_has_the_energy_of_one_bounce(renderer: ml.Renderer, reference: str) -> None:
    """Within 25 %; as the literature propagates the light stays where it was reflected."""
    stored, place = load(reference), STORED[reference].build()
    errors = {}
    for name, settings in {
        "default": LPV,
        "coarse": LPV.replace(lpv_resolution=16, lpv_iterations=48),
        "fine": LPV.replace(lpv_resolution=32, lpv_iterations=80),
        "preset": ml.Settings.preset("area-2016").replace(direct="off"),
        "together": LPV.replace(lpv_transport="together"),
        "faces": LPV.replace(lpv_transport="faces"),
        "paper": LPV.replace(lpv_injection="paper"),
    }.items():
        errors[name] = ml.testing.compare(renderer.render(*place, settings), stored)
        print(f"{reference} {name}: {errors[name]}")
    for name in ("default", "coarse", "fine", "preset", "together"):
        assert abs(errors[name].energy) < 0.25, name
        assert errors[name].relative_rmse < 0.55, name
    assert errors["default"].relative_rmse < (0.4 if reference == "spot_indirect" else 0.22)
    assert errors["default"].relative_rmse < 0.85 * errors["together"].relative_rmse, (
        "sides that do not light themselves"
    )
    assert errors["faces"].relative_rmse > 1.0
    # negative control: what division by the number of samples leaves depends on the grid
    if reference == "spot_indirect":
        assert errors["paper"].energy > 0.35
