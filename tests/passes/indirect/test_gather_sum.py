"""`gather_sum`: adds to each pixel what the shadow rays of a wave let through."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import pixel_numbers
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER_PATH, GATHER_WAVE, MISS, record


def _run(
    runner: Runner, paths: NDArray[Any], occluded: NDArray[np.bool_], before: NDArray[np.float32]
) -> NDArray[np.float32]:
    """`paths` and `occluded` (tiles, strata, 64)."""
    tiles, strata, _ = paths.shape
    out = runner(
        "passes/indirect/gather_sum",
        tiles * 64,
        wave=record(GATHER_WAVE, tiles=tiles, strata=strata),
        paths=paths,
        occluded=np.packbits(occluded.ravel(), bitorder="little").view("<u4"),
        indirect_irradiance=before,
    )
    return read(out, "indirect_irradiance", np.float32, *before.shape)


def _paths(
    rng: np.random.Generator, size: tuple[int, int], strata: int
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    pixels = pixel_numbers(*size).reshape(-1, 1, 64)
    paths = np.zeros((len(pixels), strata, 64), GATHER_PATH)
    # some strata have no ray: those below the surface
    lost = rng.uniform(size=paths.shape) < 0.2
    paths["pixel"] = np.where((pixels < 0) | lost, MISS, pixels)
    paths["pending"] = rng.lognormal(0, 2, (*paths.shape, 3)) * (paths["pixel"] != MISS)[..., None]
    return paths, rng.uniform(size=paths.shape) < 0.3


@pytest.mark.parametrize("size", [(33, 21), (1, 9), (5, 1), (333, 217)])
@pytest.mark.parametrize("strata", [1, 7, 64])
def test_sums_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], strata: int
) -> None:
    if size == (333, 217):
        strata = min(strata, 8)
    paths, occluded = _paths(rng, size, strata)
    before = rng.uniform(0, 3, (size[0] * size[1], 4)).astype(np.float32)
    found = _run(runner, paths, occluded, before)

    def expected(hidden: NDArray[np.bool_]) -> NDArray[np.float64]:
        total = before[:, :3].astype(np.float64)
        through = (paths["pixel"] != MISS) & ~hidden
        np.add.at(total, paths["pixel"][through], paths["pending"][through].astype(np.float64))
        return total

    sums = expected(occluded)
    assert_within(found[:, :3], sums, (strata + 1) * ULP * sums, "sums")
    assert (found[:, 3] == before[:, 3]).all()
    flipped = occluded.copy()
    flipped.ravel()[np.flatnonzero(paths["pixel"].ravel() != MISS)[0]] ^= True
    assert_not_within(found[:, :3], expected(flipped), (strata + 1) * ULP * sums)


def test_pixels_without_any_ray_are_left_alone(runner: Runner, rng: np.random.Generator) -> None:
    paths = np.zeros((1, 4, 64), GATHER_PATH)
    paths["pixel"] = MISS
    paths["pending"] = 1.0
    before = rng.uniform(0, 3, (64, 4)).astype(np.float32)
    assert (_run(runner, paths, np.zeros((1, 4, 64), bool), before) == before).all()


def test_the_order_of_the_sum_is_fixed(runner: Runner, rng: np.random.Generator) -> None:
    paths, occluded = _paths(rng, (64, 64), 32)
    before = np.zeros((4096, 4), np.float32)
    first = _run(runner, paths, occluded, before)
    assert all((_run(runner, paths, occluded, before) == first).all() for _ in range(3))
