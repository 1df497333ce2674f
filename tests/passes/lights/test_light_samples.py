"""`light_samples`: one point a stratum and pattern, and the mean radiance of each stratum times its area."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.hashing import random4
from tests.passes.reference.lights import Area, Light, random_area, random_spot, table
from tests.passes.reference.pictures import stratum_means
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIGHT_SAMPLES, record

STEM = "passes/lights/light_samples"
GRIDS = [(1, 1), (4, 4), (16, 16), (7, 3), (8, 12), (4, 6), (1, 13), (64, 64)]


def cells(strata_u: int, strata_v: int) -> NDArray[np.int64]:
    """Cell (u, v) of each stratum: blocks of 4 × 4 one after the other where they fit, else row by row."""
    u, v = np.meshgrid(np.arange(strata_u), np.arange(strata_v))
    grid = np.stack([u, v], axis=-1)
    if strata_u % 4 == 0 and strata_v % 4 == 0:
        blocks = grid.reshape(strata_v // 4, 4, strata_u // 4, 4, 2).transpose(0, 2, 1, 3, 4)
        return blocks.reshape(-1, 2)
    return grid.reshape(-1, 2)


def dealt(strata_u: int, strata_v: int) -> NDArray[np.int64]:
    """Cell (u, v) of each stratum of four sets, set after set: each has one of every 2 × 2 cells [KH01]."""
    u, v = np.meshgrid(np.arange(strata_u), np.arange(strata_v))
    grid = np.stack([u, v], axis=-1)
    sets = [grid[down::2, right::2].reshape(-1, 2) for down in (0, 1) for right in (0, 1)]
    return np.concatenate(sets)


def _params(light: int, grid: tuple[int, int], **more: Any) -> NDArray[Any]:
    values = {"patterns": 1, "t_max": 0.9999, **more}
    return record(LIGHT_SAMPLES, light=light, strata_u=grid[0], strata_v=grid[1], **values)


def _points(runner: Runner, lights: list[Light], params: NDArray[Any]) -> NDArray[np.float32]:
    p = {name: int(params[name][0]) for name in ("strata_u", "strata_v", "patterns")}
    count = p["strata_u"] * p["strata_v"]
    blank = np.full((p["patterns"] * count, 4), np.nan, np.float32)
    out = runner(STEM, len(blank), entry="points", params=params, lights=table(lights), light_points=blank)
    return read(out, "light_points", np.float32, p["patterns"], count, 4)


def _radiance(
    runner: Runner, lights: list[Light], number: int, grid: tuple[int, int], classes: int = 1
) -> NDArray[np.float32]:
    count = grid[0] * grid[1]
    out = runner(
        STEM,
        count,
        entry="radiance",
        groups=True,
        params=_params(number, grid, classes=classes),
        lights=table(lights),
        light_radiance=np.full((count, 4), np.nan, np.float32),
    )
    return read(out, "light_radiance", np.float32, count, 4)[:, :3]


def _where(light: Area, ab: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of the light, and the rounding that computing them in float32 may cost."""
    size = np.abs(light.corner) + np.abs(light.u) + np.abs(light.v)
    return light.point(ab), 8 * ULP * np.broadcast_to(size, (*ab.shape[:-1], 3))


@pytest.mark.parametrize("grid", GRIDS)
def test_the_grid_has_the_middle_of_every_cell(
    runner: Runner, rng: np.random.Generator, grid: tuple[int, int]
) -> None:
    light = random_area(rng)
    points = _points(runner, [random_spot(rng), light], _params(1, grid))
    ab = (cells(*grid) + 0.5) / np.array(grid)
    expected, bound = _where(light, ab)
    assert_within(points[0, :, :3], expected, bound, "points")
    assert (points[..., 3] == np.float32(0.9999)).all()
    assert_not_within(points[0, :, :3], expected + 0.01 * light.u / grid[0], bound)


@pytest.mark.parametrize("grid", GRIDS)
def test_jittered_points_are_hashed_places_in_their_cells(
    runner: Runner, rng: np.random.Generator, grid: tuple[int, int]
) -> None:
    light, patterns, seed = random_area(rng), 5, 77
    params = _params(0, grid, patterns=patterns, seed=seed, jittered=1)
    points = _points(runner, [light], params)
    strata = np.arange(grid[0] * grid[1])
    jitter = random4(strata[None], np.arange(patterns)[:, None], 0, seed)[..., :2]
    expected, bound = _where(light, (cells(*grid) + jitter) / np.array(grid))
    assert_within(points[..., :3], expected, bound, "points")
    assert_not_within(points[:-1, :, :3], expected[1:], bound[1:])

    other = _points(runner, [light], _params(0, grid, patterns=patterns, seed=seed + 1, jittered=1))
    assert not (points == other).all(), "another seed, other points"


def test_other_lights_have_other_points(runner: Runner, rng: np.random.Generator) -> None:
    light = random_area(rng)
    both = [_points(runner, [light, light], _params(k, (8, 8), jittered=1)) for k in range(2)]
    assert not np.isclose(both[0][..., :3], both[1][..., :3]).all(axis=-1).any()


def test_jittered_points_cover_their_cells_evenly(runner: Runner) -> None:
    """Over 2,000 patterns a cell's points have the mean 1/2 and the variance 1/12 of a uniform place."""
    light = Area(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.ones(3))
    patterns = 2000
    points = _points(runner, [light], _params(0, (3, 2), patterns=patterns, jittered=1)).astype(np.float64)
    inside = points[..., :2] * np.array([3, 2]) - cells(3, 2)
    assert inside.min() > -1e-6
    assert inside.max() < 1 + 1e-6
    assert_within(inside.mean(axis=0), np.full((6, 2), 0.5), 5 * np.sqrt(1 / 12 / patterns), "means")
    assert_within(inside.var(axis=0), np.full((6, 2), 1 / 12), 5 * np.sqrt(1 / 180 / patterns), "variances")


def test_sixteen_strata_in_a_row_are_neighbours(runner: Runner) -> None:
    """What the order is for: a packet's rays go to one block of 4 × 4 cells."""
    light = Area(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.ones(3))
    points = _points(runner, [light], _params(0, (16, 8)))[0, :, :2].reshape(8, 16, 2)
    spread = np.ptp(points, axis=1) * np.array([16, 8])
    assert_within(spread, np.full((8, 2), 3.0), 1e-4, "cells between the outermost points")


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (7, 1), (5, 3), (16, 16), (61, 130)])
@pytest.mark.parametrize("linear", [False, True])
def test_strata_have_the_integral_of_their_part_of_the_picture(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], grid: tuple[int, int], linear: bool
) -> None:
    """Against float64 box and hat integrals; together exactly the mean of the picture times the area."""
    light = random_area(rng, size, linear=linear)
    found = _radiance(runner, [random_area(rng, (2, 3)), random_spot(rng), light], 2, grid).astype(np.float64)
    at = cells(*grid)
    means = stratum_means(light.radiance, *grid, linear)[at[:, 1], at[:, 0]]
    share = light.area / len(at)
    # a cell's edges are rounded: half an ulp of the picture's width against the width of the cell
    bound = 9 * share * (2e-6 + 2 * ULP * max(grid))
    assert_within(found, means * share, bound, "strata")
    total = light.radiance.mean(axis=(0, 1)) * light.area
    assert_within(found.sum(axis=0), total, 2e-6 * total, "all strata together")
    if size != (1, 1):
        assert_not_within(found.sum(axis=0), total * (1 + 1e-4), 2e-6 * total)
        if np.ptp(means, axis=0).max() > 0.1:
            assert_not_within(found, means[::-1] * share, bound)


def test_constant_lights_give_every_stratum_its_share(runner: Runner, rng: np.random.Generator) -> None:
    light = random_area(rng)
    found = _radiance(runner, [light], 0, (6, 5))
    expected = np.broadcast_to(light.radiance * light.area / 30, (30, 3))
    assert_within(found, expected, 4 * ULP * expected, "shares")


def test_more_strata_than_one_row_of_workgroups(runner: Runner, rng: np.random.Generator) -> None:
    """One workgroup a stratum: 65,536 and more are folded into two rows."""
    light = random_area(rng, (2, 2))
    grid = (257, 256)
    assert grid[0] * grid[1] > 65_535
    found = _radiance(runner, [light], 0, grid).astype(np.float64)
    at = cells(*grid)
    expected = stratum_means(light.radiance, *grid, False)[at[:, 1], at[:, 0]] * light.area / len(at)
    assert_within(found, expected, 1e-4 * expected.max(), "strata")


INTERLEAVED = [(2, 2), (8, 8), (6, 4), (2, 10), (16, 12)]


@pytest.mark.parametrize("grid", INTERLEAVED)
@pytest.mark.parametrize("jittered", [0, 1])
def test_four_sets_have_one_of_each_two_by_two_strata(
    runner: Runner, rng: np.random.Generator, grid: tuple[int, int], jittered: int
) -> None:
    light, patterns = random_area(rng), 3
    params = _params(1, grid, classes=4, patterns=patterns, jittered=jittered)
    points = _points(runner, [random_spot(rng), light], params)
    strata, at = np.arange(grid[0] * grid[1]), dealt(*grid)
    jitter = random4(strata[None], np.arange(patterns)[:, None], 1, 0)[..., :2] if jittered else 0.5
    expected, bound = _where(light, np.broadcast_to((at + jitter) / np.array(grid), (patterns, len(at), 2)))
    assert_within(points[..., :3], expected, bound, "points")
    blocks = (at // 2 @ np.array([1, grid[0] // 2])).reshape(4, -1)
    assert (np.sort(blocks, axis=1) == np.arange(len(at) // 4)).all(), "one of each block in every set"
    assert len(np.unique(at, axis=0)) == len(at), "and no stratum twice"
    if len(at) > 4:
        plain = _where(light, (cells(*grid) + jitter) / np.array(grid))[0]
        assert_not_within(points[..., :3], np.broadcast_to(plain, expected.shape), bound)


@pytest.mark.parametrize("grid", INTERLEAVED)
@pytest.mark.parametrize("linear", [False, True])
def test_radiance_goes_with_the_points_of_four_sets(
    runner: Runner, rng: np.random.Generator, grid: tuple[int, int], linear: bool
) -> None:
    light = random_area(rng, (13, 9), linear=linear)
    found = _radiance(runner, [random_area(rng, (2, 3)), light], 1, grid, classes=4).astype(np.float64)
    at = dealt(*grid)
    means = stratum_means(light.radiance, *grid, linear)
    share = light.area / len(at)
    bound = 9 * share * (2e-6 + 2 * ULP * max(grid))
    assert_within(found, means[at[:, 1], at[:, 0]] * share, bound, "strata")
    if len(at) > 4:
        plain = cells(*grid)
        assert_not_within(found, means[plain[:, 1], plain[:, 0]] * share, bound)
