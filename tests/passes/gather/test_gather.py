"""`gather`: E += Σ V L A/N cosθ_s cosθ_l / d² over the samples of one light [NPW10 Eq. 2, corrected]."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gathering import Case, facing_up, gather, geometry_terms, random_case
from tests.passes.reference.lights import Area, Light, Spot, random_area, random_spot
from tests.passes.reference.polygons import contour
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within
from tests.passes.reference.structs import MISS

Array = NDArray[np.float64]

STEM = "passes/gather/gather"


def _irradiance(light: Light, case: Case) -> tuple[Array, Array]:
    """Irradiance a pixel, and the sum of what float32 may lose: of every term its share of roundings."""
    terms, far = geometry_terms(light, case)
    size = 1 / far**2
    if case.seen is not None:
        terms, size = terms * case.seen[case.live], size * case.seen[case.live]
    total = np.zeros((len(case.receivers), 3))
    loss = np.zeros((len(case.receivers), 3))
    pixels = case.receivers["pixel"][case.live]
    total[pixels] = terms @ case.radiance
    # cancellation in d: coordinates are up to ten times as large as the distance
    loss[pixels] = (size * (1 + 10 / far)) @ case.radiance * (40 + case.strata / 8) * ULP
    return total, loss


LIGHTS = ["one-sided", "two-sided", "picture", "spot"]


def _light(rng: np.random.Generator, kind: str) -> Light:
    if kind == "spot":
        return random_spot(rng)
    return random_area(rng, (3, 4) if kind == "picture" else None, two_sided=kind == "two-sided")


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("strata", [1, 37, 64])
@pytest.mark.parametrize("traced", [True, False])
def test_irradiance_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, kind: str, strata: int, traced: bool
) -> None:
    light = _light(rng, kind)
    lights: list[Light] = [random_area(rng), random_spot(rng), light]
    case = random_case(rng, light, 1500, strata, traced)
    found = gather(runner, STEM, lights, 2, case)
    expected, bound = _irradiance(light, case)
    assert_within(found, expected, bound, "irradiance")
    assert (expected.any(axis=1)).mean() > 0.05, "some receivers are lit"

    case.radiance = case.radiance * (1 + 1e-3)
    assert_not_within(found, _irradiance(light, case)[0], bound)
    if traced:
        assert case.seen is not None
        case.seen = ~case.seen
        assert_not_within(found, _irradiance(light, case)[0], bound)


def test_lights_add_up(runner: Runner, rng: np.random.Generator) -> None:
    """The pass adds to what is there; inactive receivers leave their pixel alone."""
    light = random_area(rng)
    case = random_case(rng, light, 300, 16)
    before = rng.uniform(0, 1, (300, 4)).astype(np.float32)
    found = gather(runner, STEM, [light], 0, case, before)
    alone = gather(runner, STEM, [light], 0, case)
    assert_within(found, before[:, :3] + alone.astype(np.float64), 2 * ULP * np.abs(found), "sums")
    idle = case.receivers["pixel"][case.receivers["pattern"] == MISS]
    assert (found[idle] == before[idle, :3]).all()


def test_a_square_light_above_a_floor_has_lambert_s_irradiance(
    runner: Runner, rng: np.random.Generator
) -> None:
    """The polygon's closed form; 64 × 64 samples err by less than (cell/distance)²/10."""
    light = Area(np.array([-0.5, 2, -0.5]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.full(3, 5.0))
    origins = rng.uniform(-3, 3, (400, 3)) * [1, 0, 1]
    side = 64
    middles = (np.arange(side) + 0.5) / side
    ab = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    radiance = np.broadcast_to(light.radiance * light.area / side**2, (side**2, 3))
    found = gather(runner, STEM, [light], 0, facing_up(origins, light.point(ab), radiance))
    corners = light.point(np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)]))
    expected = 5 * np.array([contour(np.array([0, 1.0, 0]), corners - origin) for origin in origins])
    assert_within(found, np.repeat(expected[:, None], 3, axis=1), 5e-5 * expected[:, None], "irradiance")
    assert_not_within(found[:, 0], expected * 1.001, 5e-5 * expected)


def test_the_edge_of_a_spot_is_hard(runner: Runner) -> None:
    """Two units under a spot of 30° the cone ends at 2·tan 30° = 1.1547."""
    light = Spot(np.array([0, 2.0, 0]), np.array([0, -1.0, 0]), np.ones(3), np.cos(np.radians(30)))
    edge = 2 * np.tan(np.radians(30))
    origins = np.array([(edge * (1 - 1e-4), 0, 0), (edge * (1 + 1e-4), 0, 0)])
    case = facing_up(origins, light.position, light.intensity[None])
    found = gather(runner, STEM, [light], 0, case)[:, 0]
    assert_within(found[0], np.cos(np.radians(30)) ** 3 / 4, 1e-4, "cos³/h² at the edge")
    assert found[1] == 0


def test_tiny_and_huge_distances_neither_overflow_nor_vanish(runner: Runner) -> None:
    """E scales as 1/s² when everything but the radiance is scaled by s."""
    for scale in (1e-12, 1e-4, 1e5, 1e12):
        light = Area(
            np.array([-0.5, 2, -0.5]) * scale, np.array([scale, 0, 0]), np.array([0, 0, scale]), np.ones(3)
        )
        case = facing_up(np.zeros((1, 3)), light.point(np.array([[0.5, 0.5]])), np.ones((1, 3)))
        found = gather(runner, STEM, [light], 0, case).astype(np.float64) * scale**2
        assert_within(found, np.full((1, 3), 0.25), 1e-6, f"scale {scale}")
