"""One point on one light: without bias, and never refused where light could come from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.lights import Area, Light, Spot, random_area, random_spot, table
from tests.passes.reference.run import Runner, assert_not_within, assert_within

Array = NDArray[np.float64]
PLACES = 4096
CHOOSE = "import package::common::light::lights;\nimport package::common::light_choice::choose_light_point;"
WEIGH = (
    "import package::common::light::{light_at, lights};\nimport package::common::light_choice::light_weight;"
)


def _choose(
    runner: Runner, lights: list[Light], p: Array, n: Array, places: NDArray[np.float32]
) -> dict[str, NDArray[Any]]:
    body = f"""
    let c = choose_light_point({len(lights)}u, 3u, given[0].xyz, given[1].xyz, given[i].xyz);
    answer[2u * i] = vec4f(c.position, f32(c.index));
    answer[2u * i + 1u] = vec4f(c.radiance, f32(c.found));"""
    given = np.zeros((len(places) + 2, 4), np.float32)
    given[0, :3], given[1, :3], given[2:, :3] = p, n, places
    values = runner.function(CHOOSE, body, given, rows=2, lights=table(lights)).view(np.float32)[2:]
    return {
        "position": values[:, 0, :3],
        "index": values[:, 0, 3].astype(int),
        "radiance": values[:, 1, :3].astype(np.float64),
        "found": values[:, 1, 3] != 0,
    }


def _weights(runner: Runner, lights: list[Light], points: Array, normals: Array) -> NDArray[np.float32]:
    """Weight of every light at every point, (points, lights)."""
    given = np.zeros((2 * len(points), 4), np.float32)
    given[0::2, :3], given[1::2, :3] = points, normals
    body = f"""
    if i % 2u == 0u {{
        for (var k = 0u; k < {len(lights)}u; k++) {{
            answer[i * {len(lights)}u + k].x = light_weight(light_at(k), given[i].xyz, given[i + 1u].xyz);
        }}
    }}"""
    words = runner.function(WEIGH, body, given, rows=len(lights), lights=table(lights))
    return words.view(np.float32)[0::2, :, 0]


def _lights(rng: np.random.Generator) -> list[Light]:
    return [
        random_area(rng),
        random_area(rng, (3, 2), two_sided=True),
        random_spot(rng, 60),
        random_area(rng, (2, 2), linear=True),
        random_spot(rng, 30),
        random_area(rng),
    ]


def _sent(light: Light, p: Array, ab: Array) -> tuple[Array, Array]:
    """Points of the light and radiance · area · cosine at the light from there (a spot's: intensity)."""
    if isinstance(light, Spot):
        to = p - light.position
        inside = light.lights(to / np.linalg.norm(to))
        return np.broadcast_to(light.position, (len(ab), 3)), np.tile(light.intensity * inside, (len(ab), 1))
    points = light.point(ab)
    w = points - p
    w = w / np.linalg.norm(w, axis=1, keepdims=True)
    return points, light.emitted(ab) * (light.area * light.cosine(-w))[:, None]


@pytest.mark.parametrize("case", range(8))
def test_the_mean_over_the_choice_is_the_sum_over_the_lights(runner: Runner, case: int) -> None:
    """With the place on the light held, the third number's mean is exact: each light counts by its chance."""
    rng = np.random.default_rng(case)
    lights = _lights(rng)
    p, n = rng.normal(size=3) * 2, rng.normal(size=3)
    n /= np.linalg.norm(n)
    ab = rng.uniform(0.05, 0.95, 2).astype(np.float32)
    places = np.empty((PLACES, 3), np.float32)
    places[:, :2], places[:, 2] = ab, (np.arange(PLACES) + 0.5) / PLACES
    got = _choose(runner, lights, p, n, places)
    weights = _weights(runner, lights, p[None], n[None])[0].astype(np.float64)
    if not weights.any():
        assert not got["found"].any()
        return
    counted = 0
    for k, light in enumerate(lights):
        points, sent = _sent(light, p, ab[None].astype(np.float64))
        expected = sent[0] if weights[k] > 0 else np.zeros(3)
        mine = got["index"] == k
        mean = (got["radiance"] * (mine & got["found"])[:, None]).sum(axis=0) / PLACES
        # the cells of the third number round a light's chance to one of them at each end
        chance = weights[k] / weights.sum()
        bound = expected * (2 / (PLACES * chance) if chance else 0) + 1e-5 * expected.max()
        assert_within(mean, expected, bound + 1e-12, f"light {k}")
        if chance > 0.05 and expected.any():
            counted += 1
            assert_not_within(mean, 1.1 * expected, bound + 1e-12)
            assert_within(got["position"][mine], np.broadcast_to(points, (mine.sum(), 3)), 1e-5, "place")
    assert counted or not got["found"].any()


def test_weights_are_zero_only_where_nothing_can_arrive(runner: Runner, rng: np.random.Generator) -> None:
    """Against what 9 × 9 places of each light send to each point, its corners included."""
    lights = _lights(rng)
    points = rng.normal(size=(3000, 3)) * 2
    normals = rng.normal(size=(3000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    weights = _weights(runner, lights, points, normals)
    side = np.linspace(0, 1, 9)
    ab = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    refused = 0
    for k, light in enumerate(lights):
        for i in np.flatnonzero(weights[:, k] == 0):
            at, sent = _sent(light, points[i], ab)
            above = (at - points[i]) @ normals[i]
            arrives = np.clip(above, 0, None)[:, None] * sent
            assert arrives.max() <= 1e-4, f"light {k} would send {arrives.max()} to point {i}"
            refused += 1
    assert 500 < refused < weights.size - 500
    assert (weights >= 0).all()
    assert np.isfinite(weights).all()


def test_what_lies_below_the_horizon_or_behind_gets_no_sample(runner: Runner) -> None:
    """Hand cases: a lamp above a floor point, under it, turned away, two-sided."""
    u, v = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    above, below = np.array([-0.5, 2, -0.5]), np.array([-0.5, -2, -0.5])
    lights: list[Light] = [
        Area(above, u, v, np.ones(3)),
        Area(below, v, u, np.ones(3)),
        Area(above, v, u, np.ones(3)),
        Area(above, v, u, np.ones(3), two_sided=True),
        Spot(np.array([0, 2.0, 0]), np.array([0, -1.0, 0]), np.ones(3), 0.5),
        Spot(np.array([0, 2.0, 0]), np.array([0, 1.0, 0]), np.ones(3), 0.5),
        Spot(np.array([5.0, 2, 0]), np.array([0, -1.0, 0]), np.ones(3), 0.5),
    ]
    weights = _weights(runner, lights, np.zeros((1, 3)), np.array([[0, 1.0, 0]]))[0]
    assert ((weights > 0) == [True, False, False, True, True, False, False]).all()
    # a light that only just rises above the horizon with one corner is still worth a sample
    rising = Area(np.array([2.0, -1, 0]), np.array([0, 0, 1.0]), np.array([0, 1.01, 0]), np.ones(3))
    sunk = Area(np.array([2.0, -1, 0]), np.array([0, 0, 1.0]), np.array([0, 0.99, 0]), np.ones(3))
    found = _weights(runner, [rising, sunk], np.zeros((1, 3)), np.array([[0, 1.0, 0]]))[0]
    facing = rising.normal[0] < 0
    assert facing
    assert found[0] > 0
    assert found[1] == 0


def test_blue_lights_count(runner: Runner) -> None:
    """A light whose luminance is next to nothing is still chosen."""
    light = Area(
        np.array([-0.5, 2, -0.5]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([0, 0, 1e-6])
    )
    assert _weights(runner, [light], np.zeros((1, 3)), np.array([[0, 1.0, 0]]))[0, 0] > 0


def test_the_ends_of_the_third_number_choose_a_light_that_counts(
    runner: Runner, rng: np.random.Generator
) -> None:
    """0 and the last number below 1, with lights of no weight at both ends of the list."""
    u, v = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    dark = Area(np.array([-0.5, -2, -0.5]), u, v, np.ones(3))
    lamps: list[Light] = [
        Area(np.array([-0.5 + 0.1 * k, 2, -0.5]), u, v, rng.uniform(0.1, 9, 3)) for k in range(9)
    ]
    places = np.array([(0.5, 0.5, 0), (0.5, 0.5, 1 - 2.0**-24)], np.float32)
    got = _choose(runner, [dark, *lamps, dark], np.zeros(3), np.array([0, 1.0, 0]), places)
    assert got["found"].all()
    assert got["index"].tolist() == [1, 9]
