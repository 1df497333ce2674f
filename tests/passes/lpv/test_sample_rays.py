"""`sample_rays`: sides of surface samples as hits of gather rays, tile by tile, then by stratum [KJ16]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.lpv import LPV_POINT
from tests.passes.reference.run import Runner, assert_within, read
from tests.passes.reference.structs import GATHER_PATH, GATHER_WAVE, HIT, MISS, RAY, record


def _points(rng: np.random.Generator, count: int) -> NDArray[Any]:
    points = np.zeros(count, LPV_POINT)
    normals = rng.normal(size=(count, 3))
    points["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    points["area"] = rng.uniform(size=count)
    points["instance"], points["triangle"] = rng.integers(0, 1000, (2, count))
    points["u"], points["v"] = rng.uniform(0, 0.5, (2, count))
    return points


@pytest.mark.parametrize(
    ("count", "strata", "first", "tiles"), [(200, 4, 0, 4), (200, 3, 2, 2), (64, 1, 0, 1)]
)
def test_every_stratum_of_every_point_has_its_path(
    runner: Runner, rng: np.random.Generator, count: int, strata: int, first: int, tiles: int
) -> None:
    points = _points(rng, count)
    paths = tiles * strata * 64
    wave = record(GATHER_WAVE, width=count, first_tile=first, tiles=tiles, strata=strata)
    out = runner(
        "passes/lpv/sample_rays",
        paths,
        wave=wave,
        points=points,
        hits=np.zeros(paths, HIT),
        rays=np.zeros(paths, RAY),
        paths=np.zeros(paths, GATHER_PATH),
    )
    hits, rays, made = read(out, "hits", HIT), read(out, "rays", RAY), read(out, "paths", GATHER_PATH)
    place = np.arange(paths).reshape(tiles, strata, 64)
    number = 64 * (first + np.arange(tiles))[:, None, None] + np.arange(64) + 0 * place
    stratum = np.arange(strata)[None, :, None] + 0 * place
    there = number < count
    assert (made["stratum"].reshape(place.shape) == stratum).all()
    assert (made["pixel"].reshape(place.shape) == np.where(there, number, MISS)).all()
    active = (rays["t_max"] > rays["t_min"]).reshape(place.shape)
    assert (active == there).all()
    mine = points[number[there]]
    found = hits[there.ravel()]
    for name in ("instance", "triangle", "u", "v"):
        assert (found[name] == mine[name]).all(), name
    # seen from the side on which the normal is
    assert (rays["direction"][there.ravel()] == -mine["normal"]).all()
    assert not (rays["direction"][there.ravel()] == mine["normal"]).all()
    # reflected radiances, summed over the strata, are a mean times pi
    throughput = made["throughput"][there.ravel()]
    assert_within(throughput, np.full(throughput.shape, np.pi / strata), 1e-6, "throughput")
    assert (made["throughput"][~there.ravel()] == 0).all()
