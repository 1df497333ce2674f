"""`gather_ratio`: E += E_polygon · Σ V L w / (L̄ Σ w), with w = cosθ_s cosθ_l / d² [HHM18]."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gathering import Case, facing_up, gather, geometry_terms, random_case
from tests.passes.reference.lights import Area, Light, random_area, random_spot
from tests.passes.reference.polygons import parallelogram_irradiance
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.reference.structs import MISS

Array = NDArray[np.float64]
STEM = "passes/gather/gather_ratio"
LIGHTS = ["one-sided", "two-sided", "picture"]


def _light(rng: np.random.Generator, kind: str) -> Area:
    return random_area(rng, (3, 4) if kind == "picture" else None, two_sided=kind == "two-sided")


def _case(rng: np.random.Generator, light: Area, count: int, strata: int, traced: bool) -> Case:
    """Samples that stand for equal parts of the light; those of a constant light all alike."""
    case = random_case(rng, light, count, strata, traced)
    if light.radiance.ndim == 1:
        case.radiance = np.broadcast_to(light.radiance * light.area / strata, (strata, 3)).copy()
    else:
        case.radiance = case.radiance * light.mean * light.area / strata
    case.radiance = case.radiance.astype(np.float32).astype(np.float64)
    return case


def _irradiance(light: Area, case: Case) -> tuple[Array, NDArray[np.bool_]]:
    """Irradiance a pixel, and whether some sample weighed enough for the ratio to be sure of."""
    r = case.receivers[case.live]
    terms, _ = geometry_terms(light, case)
    seen = np.ones(terms.shape, bool) if case.seen is None else case.seen[case.live]
    polygons = np.zeros(len(r))
    for i, one in enumerate(r):
        corner = light.corner - one["origin"].astype(np.float64)
        if light.two_sided or corner @ light.normal < 0:
            normals = (one[name].astype(np.float64) for name in ("normal_shade", "normal_geo"))
            polygons[i] = parallelogram_irradiance(*normals, corner, light.u, light.v)
    total = np.zeros((len(case.receivers), 3))
    sure = np.zeros(len(case.receivers), bool)
    weight = terms.sum(axis=1)
    whole = light.mean * light.area / case.strata * weight[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(weight[:, None] > 0, ((terms * seen) @ case.radiance) / whole, 1.0)
    total[r["pixel"]] = light.mean * polygons[:, None] * share
    # a sample at a horizon counts or not
    edge = np.abs(terms).max(axis=1) > 1e-4
    sure[r["pixel"]] = edge | (polygons == 0)
    return total, sure


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("strata", [1, 37, 64])
@pytest.mark.parametrize("traced", [True, False])
def test_irradiance_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, kind: str, strata: int, traced: bool
) -> None:
    light = _light(rng, kind)
    lights: list[Light] = [random_area(rng), random_spot(rng), light]
    case = _case(rng, light, 800, strata, traced)
    found = gather(runner, STEM, lights, 2, case)
    expected, sure = _irradiance(light, case)
    bound = 1e-4 * expected + 2e-5 * light.mean
    assert sure.mean() > 0.5
    assert (expected[sure].any(axis=1)).mean() > 0.05
    assert_within(found[sure], expected[sure], bound[sure], "irradiance")
    assert_not_within(found[sure], 1.01 * expected[sure], bound[sure])
    if traced:
        assert case.seen is not None
        case.seen = ~case.seen
        assert_not_within(found[sure], _irradiance(light, case)[0][sure], bound[sure])


@pytest.mark.parametrize("strata", [1, 64])
def test_what_sees_all_of_a_light_gets_its_exact_irradiance(
    runner: Runner, rng: np.random.Generator, strata: int
) -> None:
    """However few the samples, whether rays were asked or not."""
    light = Area(
        np.array([-0.5, 2, -0.5]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([5.0, 1, 2])
    )
    origins = rng.uniform(-3, 3, (300, 3)) * [1, 0.3, 1]
    radiance = np.broadcast_to(light.radiance * light.area / strata, (strata, 3))
    case = facing_up(origins, light.point(rng.uniform(size=(strata, 2))), radiance)
    up = np.array([0, 1.0, 0])
    exact = [parallelogram_irradiance(up, up, light.corner - o, light.u, light.v) for o in origins]
    expected = np.array(exact)[:, None] * light.radiance
    for seen in (None, np.ones((300, strata), bool)):
        case.seen = seen
        found = gather(runner, STEM, [light], 0, case)
        assert_within(found, expected, 1e-5 * expected.max(), "irradiance")
        assert_not_within(found, expected * 1.0001, 1e-5 * expected.max())
    case.seen = np.zeros((300, strata), bool)
    assert not gather(runner, STEM, [light], 0, case).any(), "where nothing is seen it is dark"


def test_a_sliver_that_no_sample_fell_into_counts_as_seen(runner: Runner) -> None:
    """A light that rises above the horizon by a little, its one sample below."""
    light = Area(
        np.array([2.0, -0.9, -0.5]), np.array([0, 0, 1.0]), np.array([0, 1.0, 0]), np.array([5.0, 1, 2])
    )
    case = facing_up(np.zeros((1, 3)), light.point(np.array([[0.5, 0.5]])), light.radiance[None] * light.area)
    case.seen = np.zeros((1, 1), bool)
    up = np.array([0, 1.0, 0])
    expected = light.radiance * parallelogram_irradiance(up, up, light.corner, light.u, light.v)
    assert expected.min() > 0
    found = gather(runner, STEM, [light], 0, case)[0]
    assert_within(found, expected, 1e-3 * expected + 4e-6 * light.radiance, "irradiance")
    assert_not_within(found, 0.9 * expected, 1e-3 * expected + 4e-6 * light.radiance)


def test_lights_add_up(runner: Runner, rng: np.random.Generator) -> None:
    light = random_area(rng)
    case = _case(rng, light, 300, 16, traced=True)
    before = rng.uniform(0, 1, (300, 4)).astype(np.float32)
    found = gather(runner, STEM, [light], 0, case, before)
    alone = gather(runner, STEM, [light], 0, case)
    assert_within(found, before[:, :3] + alone.astype(np.float64), 2.0**-23 * np.abs(found), "sums")
    idle = case.receivers["pixel"][case.receivers["pattern"] == MISS]
    assert (found[idle] == before[idle, :3]).all()


def test_a_channel_without_light_stays_dark(runner: Runner, rng: np.random.Generator) -> None:
    """No quotient of zeros: a light without blue, a picture that is black."""
    for radiance in (np.array([3.0, 1, 0]), np.zeros((2, 2, 3))):
        light = Area(np.array([-0.5, 2, -0.5]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), radiance)
        samples = np.broadcast_to(light.mean * light.area / 9, (9, 3))
        case = facing_up(
            rng.uniform(-1, 1, (50, 3)) * [1, 0, 1], light.point(rng.uniform(size=(9, 2))), samples
        )
        case.seen = rng.uniform(size=(50, 9)) < 0.5
        found = gather(runner, STEM, [light], 0, case)
        assert np.isfinite(found).all()
        assert (found[:, 2] == 0).all()
