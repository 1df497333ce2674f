"""`vpl_grid`: virtual lights on a regular grid over reflective shadow maps [NW09 Sec. 3.1]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import VIRTUAL_LIGHT, VPL_GRID, record
from tests.passes.reference.virtual_lights import Array, grid_lights, random_texels

FIELDS = ("position", "normal", "area", "flux", "solid_angle", "radius", "spread", "thickness")


def _run(
    runner: Runner, texels: Array, across: int, first_map: int = 0, first_light: int = 0, wide: bool = False
) -> NDArray[Any]:
    maps, resolution = texels.shape[:2]
    count = (maps - first_map) * across**2
    params = record(
        VPL_GRID, resolution=resolution, across=across, first_map=first_map, first_light=first_light
    )
    before = np.zeros(first_light + count, VIRTUAL_LIGHT)
    before["extent"] = 77
    out = runner(
        "passes/lights/vpl_grid",
        64 * count if wide else count,
        entry="wide" if wide else "main",
        params=params,
        rsm_texels=texels.reshape(-1, 4).astype(np.float32),
        vpls=before,
    )
    found = read(out, "vpls", VIRTUAL_LIGHT)
    assert (found[:first_light]["extent"] == 77).all()
    return found[first_light:]


@pytest.mark.parametrize(("resolution", "across"), [(16, 4), (16, 16), (16, 5), (32, 1), (16, 12), (128, 1)])
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("wide", [False, True])
def test_lights_are_those_of_their_blocks(
    runner: Runner, rng: np.random.Generator, resolution: int, across: int, first: int, wide: bool
) -> None:
    texels = random_texels(rng, 3, resolution)
    found = _run(runner, texels, across, first, 5 * first, wide)
    expected = grid_lights(texels[first:], across, first)
    assert (found["block"] == expected["block"]).all()
    assert (found["extent"] == expected["extent"]).all()
    assert (expected["flux"].sum(1) > 0).mean() > 0.4
    for name in FIELDS:
        # sums row by row, and lengths of differences of numbers up to 3
        bound = 2 * resolution * ULP * np.abs(expected[name]) + 4e-6
        assert_within(found[name], expected[name], bound, name)
        if len(found) > 1 and np.ptp(expected[name], 0).max() > 0:  # a single texel has no spread
            assert_not_within(found[name], np.roll(expected[name], 1, 0), bound)


def test_nothing_is_lost(runner: Runner, rng: np.random.Generator) -> None:
    """However the map is divided, the lights have the flux, area and solid angle of all its texels."""
    texels = random_texels(rng, 2, 64)
    for across in (1, 7, 16, 64):
        found = _run(runner, texels, across)
        for name, total in (
            ("flux", texels[..., 2, :3].sum((0, 1, 2))),
            ("area", texels[..., 2, 3].sum()),
            ("solid_angle", texels[..., 1, 3].sum()),
        ):
            sums = found[name].astype(np.float64).sum(0)
            assert_within(sums, total, 130 * ULP * total, name)
            assert_not_within(sums, total * 1.001, 130 * ULP * total)


def test_the_ball_holds_the_block(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 1, 32)
    found = _run(runner, texels, 4)
    blocks = texels[0].reshape(4, 8, 4, 8, 3, 4).transpose(0, 2, 1, 3, 4, 5).reshape(16, 64, 3, 4)
    for light, block in zip(found, blocks, strict=True):
        lit = block[block[:, 2, :3].sum(1) > 0]
        away = np.linalg.norm(lit[:, 0, :3] - light["position"], axis=1)
        assert (away < light["radius"]).all()
        assert (np.linalg.norm(lit[:, 1, :3] - light["normal"], axis=1) <= light["spread"] + 1e-6).all()
        assert away.min() == 0, "it lies at one of its texels"


def test_a_dark_block_is_no_light(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 1, 16)
    texels[0, :8, :8, 2, :3] = 0
    found = _run(runner, texels, 2)
    assert (found["flux"][0] == 0).all()
    assert found["radius"][0] == 0
    assert_within(np.linalg.norm(found["normal"], axis=1), np.ones(4), 1e-6, "normals")
    assert (found["flux"][1:].sum(1) > 0).all()
    assert found["solid_angle"][0] > 0


def test_the_middle_texel_is_taken_where_it_has_flux(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 1, 16, dark=0.0)
    found = _run(runner, texels, 1)
    assert_within(found["position"][0], texels[0, 7, 7, 0, :3], 1e-7, "position")
    texels[0, 7, 7, 2, :3] = 0
    found = _run(runner, texels, 1)
    assert_within(found["position"][0], texels[0, 7, 8, 0, :3], 1e-7, "position")
