"""`inject`: what surface samples reflect, before them: the flux of all, or the mean [KD10; KJ16]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import lpv
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import record

Array = NDArray[np.float64]
VOLUME = lpv.Volume(np.array([1.0, -2, 3]), 0.4, (6, 5, 4))


def _points(rng: np.random.Generator, count: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float32]]:
    """Points by cell, their cells and their radiosity."""
    points = np.zeros(count, lpv.LPV_POINT)
    normals = rng.normal(size=(count, 3))
    points["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    points["area"] = rng.lognormal(-4, 1, count)
    cell = np.sort(rng.integers(0, VOLUME.cells, count))
    radiosity = rng.lognormal(0, 1, (count, 4)).astype(np.float32)
    radiosity[rng.uniform(size=count) < 0.3] = 0
    return points, cell, radiosity


def _run(
    runner: Runner,
    points: NDArray[Any],
    cell: NDArray[Any],
    radiosity: NDArray[np.float32],
    shared: bool,
    most: float = 1.0,
    side: Array | None = None,
) -> Array:
    numbers, first, counts = np.unique(cell, return_index=True, return_counts=True)
    cells = np.zeros(len(numbers), lpv.LPV_CELL)
    cells["cell"], cells["first"], cells["count"] = numbers, first, counts
    out = runner(
        "passes/lpv/inject",
        len(cells),
        constants={"SHARED": shared},
        volume=VOLUME.record(),
        params=record(lpv.INJECT, most=most, side=(0, 0, 0) if side is None else side),
        cells=cells,
        points=points,
        radiosity=radiosity,
        flow=np.zeros((3 * VOLUME.cells, 4), np.float32),
    )
    found: Array = read(out, "flow", np.float32, 3, *VOLUME.shape, 4).astype(np.float64)
    return found


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("most", [1.0, 0.3])
def test_cells_hold_what_is_reflected_before_them(
    runner: Runner, rng: np.random.Generator, shared: bool, most: float
) -> None:
    points, cell, radiosity = _points(rng, 300)
    found = _run(runner, points, cell, radiosity, shared, most)
    given = (points["normal"].astype(np.float64), points["area"].astype(np.float64))
    expected = lpv.inject(VOLUME, cell, *given, radiosity[:, :3].astype(np.float64), shared, most)
    # sums of ten terms, a lobe good to seven digits; the reference's lobe is a quadrature
    bound = 40 * ULP * np.abs(expected[..., :1]) + 1e-6 * expected.max()
    assert_within(found, expected, bound, "flow")
    other = lpv.inject(VOLUME, cell, *given, radiosity[:, :3].astype(np.float64), not shared, most)
    assert_not_within(found, other, bound)
    turned = lpv.inject(VOLUME, cell, -given[0], given[1], radiosity[:, :3].astype(np.float64), shared, most)
    assert_not_within(found, turned, bound)


def test_six_sides_share_all_light(runner: Runner, rng: np.random.Generator) -> None:
    points, cell, radiosity = _points(rng, 300)
    given = (points["normal"].astype(np.float64), points["area"].astype(np.float64))
    whole = _run(runner, points, cell, radiosity, False)
    bound = 40 * ULP * np.abs(whole[..., :1]) + 1e-6 * whole.max()
    sides = [_run(runner, points, cell, radiosity, False, side=way) for way in lpv.AXES]
    for way, found in zip(lpv.AXES, sides, strict=True):
        expected = lpv.inject(VOLUME, cell, *given, radiosity[:, :3].astype(np.float64), False, 1.0, way)
        assert_within(found, expected, bound, "one side")
        assert_not_within(found, whole, bound)
    assert_within(np.sum(sides, axis=0), whole, 2 * bound, "all")


def test_flux_is_kept_and_the_mean_is_not(runner: Runner, rng: np.random.Generator) -> None:
    points, cell, radiosity = _points(rng, 400)
    flux = (radiosity[:, :3].astype(np.float64) * points["area"][:, None]).sum(axis=0)
    found = lpv.flux(_run(runner, points, cell, radiosity, False)).sum(axis=(1, 2, 3))
    assert_within(found, flux, 1e-5 * flux, "all light")
    shared = lpv.flux(_run(runner, points, cell, radiosity, True)).sum(axis=(1, 2, 3))
    assert_not_within(shared, flux, 0.1 * flux)
    # twice the samples of half the area: the same light, and the same mean
    doubled = np.repeat(points, 2)
    doubled["area"] /= 2
    both = (doubled, np.repeat(cell, 2), np.repeat(radiosity, 2, axis=0))
    assert_within(
        lpv.flux(_run(runner, *both, False)).sum(axis=(1, 2, 3)), flux, 1e-5 * flux, "finer samples"
    )


def test_a_lit_square_is_a_clamped_cosine(runner: Runner) -> None:
    """Intensity flux / pi times the clamped cosine: sqrt(pi) / 2 and sqrt(pi / 3) of it [KD10]."""
    points = np.zeros(1, lpv.LPV_POINT)
    points["normal"], points["area"] = (0, 0, 1), 0.5
    found = _run(runner, points, np.array([7]), np.full((1, 4), 2, np.float32), False)
    at = found[:, 0, 1, 1]
    intensity = 0.5 * 2 / np.pi
    expected = intensity * np.array([np.sqrt(np.pi) / 2, 0, 0, np.sqrt(np.pi / 3)])
    assert_within(at, np.tile(expected, (3, 1)), 1e-6, "coefficients")
    assert np.count_nonzero(found) == 6


def _entered(
    runner: Runner, flow: Array, first: Array, passed: Array, met: Array, most: float, side: Array | None
) -> Array:
    """`enter` of a volume of the flow's size inside of one of `met`'s."""
    size = np.array(flow.shape[3:0:-1])
    inner = lpv.Volume(VOLUME.corner + first * VOLUME.edge, VOLUME.edge / 2, tuple(int(n) for n in size))
    outer = np.array(met.shape[:0:-1])
    means = np.zeros((2, passed[0].size, 4), np.float32)
    for face in range(6):
        means[face % 2, :, face // 2] = passed[face].ravel()
    given = {"most": most, "outer": outer, "outer_cells": outer.prod(), "first": first}
    out = runner(
        "passes/lpv/inject",
        3 * inner.cells,
        entry="enter",
        volume=inner.record(),
        entering=record(lpv.ENTER, side=(0, 0, 0) if side is None else side, **given),
        flow=flow.reshape(-1, 4).astype(np.float32),
        outer_met=met.ravel().astype(np.float32),
        outer_lower=means[0],
        outer_upper=means[1],
    )
    found: Array = read(out, "flow", np.float32, 3, *flow.shape[1:4], 4).astype(np.float64)
    return found


@pytest.mark.parametrize("first", [(0, 0, 0), (2, 1, 1), (1, 2, 0)])
def test_light_enters_through_the_border(
    runner: Runner, rng: np.random.Generator, first: tuple[int, int, int]
) -> None:
    """Of six sides and of all, with surfaces before and behind the border."""
    at = np.array(first)
    flow = np.zeros((3, 6, 6, 8, 4))
    flow[..., 0] = rng.uniform(0, 1, flow.shape[:-1]) * (rng.uniform(size=flow.shape[:-1]) < 0.3)
    passed = rng.uniform(0, 1, (6, 3, *VOLUME.shape)).astype(np.float32).astype(np.float64)
    rooms = rng.integers(0, 2, VOLUME.shape)
    met = lpv.surfaces(VOLUME, rooms, 0.3)
    met = np.where(rng.uniform(size=met.shape) < 0.5, met, np.where(met == lpv.NOWHERE, met, 0.7))
    bound = 1e-5 * flow.max()
    for side in (None, *lpv.AXES):
        found = _entered(runner, flow, at, passed, met, 0.7, side)
        expected = lpv.enter(flow, at, passed, met, 0.7, side)
        assert_within(found, expected, bound, "flow")
        if side is not None:
            assert_not_within(found, lpv.enter(flow, at, passed, met, 0.7, -side), bound)
    found = _entered(runner, flow, at, passed, met, 0.7, None)
    assert_not_within(found, lpv.enter(flow, at, passed, np.full_like(met, lpv.NOWHERE), 0.7, None), bound)


def test_what_enters_is_what_left(runner: Runner) -> None:
    """All that leaves the cells outside towards a volume is in it; sides share it."""
    flow, at = np.zeros((3, 4, 4, 4, 4)), np.array([1, 1, 1])
    passed = np.ones((6, 3, *VOLUME.shape))
    met = np.full((3, *VOLUME.shape), lpv.NOWHERE)
    whole = _entered(runner, flow, at, passed, met, 1.0, None)
    # six sides of two by two cells outside, each with a mean of 1
    assert_within(whole[..., 0].sum((1, 2, 3)), np.full(3, 24.0), 1e-4, "all")
    sides = sum(_entered(runner, flow, at, passed, met, 1.0, side) for side in lpv.AXES)
    assert_within(sides, whole, 1e-5, "six sides")
