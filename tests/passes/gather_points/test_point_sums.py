"""`point_sums`: what rays found: vector irradiance, gradients, mean distances of the points [WRC88; WH92]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import gather_points as gp
from tests.passes.reference.hashing import random4
from tests.passes.reference.hemisphere import cosine_directions
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER_PATH, GATHER_WAVE, HIT, MISS, RAY, record

Array = NDArray[np.float64]
GRID = (6, 5)
COUNT, FIRST, SEED = 150, 7, 11


def _wave(**part: int) -> NDArray[Any]:
    values = {"tiles": 3, "strata": 30, "seed": SEED, "width": COUNT, "height": 1, **part}
    return record(GATHER_WAVE, strata_u=GRID[0], strata_v=GRID[1], **values)


def _points(rng: np.random.Generator) -> NDArray[Any]:
    points = np.zeros(FIRST + COUNT, gp.GATHER_POINT)
    normal = rng.normal(size=(len(points), 3))
    points["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    points["position"] = rng.normal(size=(len(points), 3))
    return points


def _paths(rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """(tiles, strata, 64) paths, and which of their shadow rays end."""
    paths = np.zeros((3, 30, 64), GATHER_PATH)
    number = 64 * np.arange(3)[:, None, None] + np.arange(64)
    paths["pixel"] = np.where(number < COUNT, FIRST + number, MISS)
    paths["stratum"] = np.arange(30)[:, None]
    paths["pending"] = rng.lognormal(0, 1, (*paths.shape, 3))
    paths["slope"] = rng.normal(size=(*paths.shape, 3))
    return paths, rng.uniform(size=paths.shape) < 0.4


def _light(
    runner: Runner, points: NDArray[Any], paths: NDArray[Any], occluded: NDArray[np.bool_], **part: int
) -> NDArray[Any]:
    out = runner(
        "passes/gather_points/point_sums",
        64 * paths.shape[0],
        entry="light",
        wave=_wave(tiles=paths.shape[0], strata=paths.shape[1], **part),
        params=gp.params(first=FIRST, count=COUNT),
        paths=paths,
        occluded=np.packbits(occluded.ravel(), bitorder="little").view("<u4"),
        points=points,
    )
    return read(out, "points", gp.GATHER_POINT)


def _expected(points: NDArray[Any], paths: NDArray[Any], occluded: NDArray[np.bool_]) -> dict[str, Array]:
    tiles, strata, lanes = np.nonzero((paths["pixel"] != MISS) & ~occluded)
    path = paths[tiles, strata, lanes]
    at, k = path["pixel"].astype(np.int64), path["stratum"].astype(np.int64)
    square = (np.stack([k % GRID[0], k // GRID[0]], axis=-1) + random4(at, k, 0, SEED)[:, :2]) / np.array(
        GRID
    )
    normal = points["normal"][at].astype(np.float64)
    w = cosine_directions(normal, square)
    cosine = (w * normal).sum(axis=1, keepdims=True)
    along = (w - cosine * normal) / cosine
    far = np.linalg.norm(along, axis=1, keepdims=True)
    way = normal + along * np.minimum(1, 3 / np.maximum(far, 1e-12))
    slope = path["slope"].astype(np.float64)
    slope -= (slope * normal).sum(axis=1, keepdims=True) * normal
    found = {}
    for channel, name in enumerate(gp.CHANNELS):
        for field, vector in ((name, way), (f"{name}_slope", slope)):
            found[field] = points[field].astype(np.float64)
            np.add.at(found[field], at, vector * path["pending"][:, channel : channel + 1])
    return found


def test_light_agrees_with_the_reference(runner: Runner, rng: np.random.Generator) -> None:
    points = _points(rng)
    paths, occluded = _paths(rng)
    found = _light(runner, points, paths, occluded)
    expected = _expected(points, paths, occluded)
    turned = points.copy()
    turned["normal"] *= -1
    other = _expected(turned, paths, occluded)
    for field, values in expected.items():
        # directions are good to 4e-5 near the horizon, three times as far along the surface
        bound = 3e-4 * np.abs(expected["red"]).max()
        assert_within(found[field], values, bound, field)
        if not field.endswith("slope"):
            assert_not_within(found[field], other[field], bound)
            # and exact against the own normal: the sum of what arrived
            own = (found[field] * points["normal"]).sum(axis=1)[FIRST:]
            pending = np.where(occluded, 0, paths["pending"][..., gp.CHANNELS.index(field)]).sum(axis=1)
            assert_within(own, pending.ravel()[:COUNT], 1e-5 * own.max(), "irradiance")
    assert (found[:FIRST] == points[:FIRST]).all(), "points of other levels stay"
    assert (found["position"] == points["position"]).all()


def test_waves_of_strata_add_up(runner: Runner, rng: np.random.Generator) -> None:
    points = _points(rng)
    paths, occluded = _paths(rng)
    whole = _light(runner, points, paths, occluded)
    half = points
    for part in (slice(0, 12), slice(12, 30)):
        half = _light(runner, half, paths[:, part].copy(), occluded[:, part].copy())
    for name in gp.CHANNELS:
        assert_within(half[name], whole[name], 64 * ULP * np.abs(whole[name]).max(), name)


@pytest.mark.parametrize("misses", [0.0, 0.4, 1.0])
def test_distances_are_harmonic_means(runner: Runner, rng: np.random.Generator, misses: float) -> None:
    points = _points(rng)
    paths, _ = _paths(rng)
    hits = np.zeros(paths.shape, HIT)
    hits["t"] = rng.lognormal(0, 1, paths.shape)
    hits["instance"] = np.where(rng.uniform(size=paths.shape) < misses, MISS, 3)
    rays = np.zeros(paths.shape, RAY)
    rays["t_max"] = 3e38
    idle = rng.uniform(size=paths.shape) < 0.2
    rays["t_min"][idle], rays["t_max"][idle] = 1, 0
    out = runner(
        "passes/gather_points/point_sums",
        192,
        entry="distances",
        wave=_wave(),
        params=gp.params(first=FIRST, count=COUNT),
        rays=rays,
        hits=hits,
        points=points,
    )
    points = read(out, "points", gp.GATHER_POINT)
    found = points["inverse"]
    met = ~idle & (hits["instance"] != MISS)
    expected = np.where(met, 1 / hits["t"].astype(np.float64), 0).sum(axis=1).ravel()[:COUNT]
    assert_within(found[FIRST:], expected, 40 * ULP * max(expected.max(), 1e-6), "sum of 1 / distance")
    assert (points["met"][FIRST:] == met.sum(axis=1).ravel()[:COUNT]).all()
    if misses < 1:
        assert_not_within(found[FIRST:], 1.1 * expected, 40 * ULP * expected.max())
    assert (found[:FIRST] == 0).all()
