"""One bounce by points that gather against Mitsuba's."""

from __future__ import annotations

import pytest

import miplight as ml
from tests.mitsuba.reference_scenes import STORED, load

pytestmark = pytest.mark.mitsuba

POINTS = ml.Settings.preset("default").replace(direct="off", indirect="final-gather")
# indirect light is 0.32 and 0.25 of all light there: together with exact direct light 3 % of it
BOUNDS = {"one_bounce_indirect": 0.09, "spot_indirect": 0.12}


@pytest.mark.parametrize("reference", BOUNDS)
def test_a_room_with_a_scan_has_the_light_of_one_bounce(renderer: ml.Renderer, reference: str) -> None:
    stored, place = load(reference), STORED[reference].build()
    found = ml.testing.compare(renderer.render(*place, POINTS), stored)
    print(f"{reference}: {found}")
    assert abs(found.energy) < 0.02
    assert found.relative_rmse < BOUNDS[reference]
    # negative control: where points hold without end their light is smeared
    smeared = ml.testing.compare(renderer.render(*place, POINTS.replace(gather_reach=20.0)), stored)
    assert smeared.relative_rmse > 1.5 * found.relative_rmse
