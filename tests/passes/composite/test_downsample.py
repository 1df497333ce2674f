"""`downsample`: every pixel of the image is the mean of its block of internal pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import DOWNSAMPLE, record


def _run(runner: Runner, fine: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    height, width = fine.shape[0] // factor, fine.shape[1] // factor
    out = runner(
        "passes/composite/downsample",
        width * height,
        params=record(DOWNSAMPLE, width=width, height=height, factor=factor),
        fine=fine,
        coarse=np.full((height, width, 4), np.nan, np.float32),
    )
    return read(out, "coarse", np.float32, height, width, 4)


def _blocks(fine: NDArray[Any], factor: int) -> NDArray[np.float64]:
    height, width = fine.shape[0] // factor, fine.shape[1] // factor
    split = fine.astype(np.float64).reshape(height, factor, width, factor, 4)
    means: NDArray[np.float64] = split.mean(axis=(1, 3))
    return means


@pytest.mark.parametrize("factor", [2, 4])
@pytest.mark.parametrize(("width", "height"), [(333, 217), (1, 9), (5, 1), (1, 1)])
def test_pixels_are_means(
    runner: Runner, rng: np.random.Generator, width: int, height: int, factor: int
) -> None:
    fine = rng.lognormal(0, 3, (height * factor, width * factor, 4)).astype(np.float32)
    coarse = _run(runner, fine, factor)
    expected = _blocks(fine, factor)
    assert_within(coarse, expected, factor**2 * ULP * expected, "means")
    shifted = np.roll(fine, 1, axis=1) if width > 1 else fine * 1.00001
    assert_not_within(coarse, _blocks(shifted, factor), factor**2 * ULP * expected)


def test_a_constant_stays_exactly_what_it_is(runner: Runner) -> None:
    for factor in (1, 2, 4):
        coarse = _run(runner, np.full((8 * factor, 12 * factor, 4), 0.7, np.float32), factor)
        assert_within(coarse, np.full(coarse.shape, np.float32(0.7)), 8 * ULP)


def test_more_pixels_than_one_row_of_workgroups(runner: Runner) -> None:
    """65,536 workgroups and more are folded into two rows; every pixel is still its own."""
    width, height = 65_537, 64
    fine = np.zeros((height, width, 4), np.float32)
    fine[..., 0], fine[..., 1] = np.arange(width), np.arange(height)[:, None]
    assert width * height > 65_535 * 64
    assert (_run(runner, fine, 1) == fine).all()
