"""Indirect light from virtual lights against Mitsuba's one bounce."""

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
BOUNDS = {"relative_rmse": 0.15, "median": 0.08, "energy": 0.05}
PRESETS = ("splatting-2009", "radiosity-2009", "hierarchical-2009")


def _visible(name: str) -> ml.Settings:
    return ml.Settings.preset(name).replace(direct="off", indirect_visibility="on")


@pytest.mark.parametrize("reference", ["spot_indirect", "one_bounce_indirect"])
@pytest.mark.parametrize("form", ["disc", "quad"])
def test_a_cut_with_visibility(
    renderer: ml.Renderer, match_reference: MatchReference, reference: str, form: str
) -> None:
    stored = load(reference)
    frame = renderer.render(
        *STORED[reference].build(), _visible("hierarchical-2009").replace(form_factor=form)
    )
    print(f"{reference} {form}: {match_reference(frame, stored, **BOUNDS)}")
    dim = np.float32(1 / 1.3)
    darker = dataclasses.replace(stored, mean=stored.mean * dim, halves=stored.halves * dim)
    with pytest.raises(AssertionError):  # negative control
        ml.testing.assert_matches(frame, darker, **BOUNDS)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("reference", ["spot_indirect", "one_bounce_indirect"])
def test_every_preset_lights_with_every_light(renderer: ml.Renderer, reference: str, name: str) -> None:
    """With visibility each has the energy of one bounce; without, as in the papers, too much."""
    stored = load(reference)
    place = STORED[reference].build()
    on = ml.testing.compare(renderer.render(*place, _visible(name)), stored)
    off = ml.testing.compare(
        renderer.render(*place, _visible(name).replace(indirect_visibility="off")), stored
    )
    print(f"{reference} {name}: on {on}, off {off}")
    # 256 points are spikes in corners, and 8 % of this light
    rmse, energy = (0.55, 0.13) if name == "splatting-2009" else (0.2, 0.1)
    assert abs(on.energy) < energy
    assert on.relative_rmse < rmse
    assert off.energy > on.energy + 0.03
