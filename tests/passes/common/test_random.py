"""Random numbers of the shaders: the hash bit for bit, and that what comes out of it is random."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.hashing import pcg4d, pcg4d_by_hand, random4
from tests.passes.reference.run import Runner

COUNT = 1 << 16


def _hashes(runner: Runner, counters: NDArray[np.uint32]) -> NDArray[np.uint32]:
    return runner.function(
        "import package::common::random::pcg4d;",
        "answer[i] = bitcast<vec4f>(pcg4d(bitcast<vec4u>(given[i])));",
        counters.view(np.float32),
    )[:, 0]


def _numbers(runner: Runner, counters: NDArray[np.uint32]) -> NDArray[np.float64]:
    words = runner.function(
        "import package::common::random::random4;",
        "answer[i] = random4(bitcast<vec4u>(given[i]));",
        counters.view(np.float32),
    )
    return words[:, 0].view(np.float32).astype(np.float64)


def _lattice() -> NDArray[np.uint32]:
    """Counters as passes use them: neighbouring pixels, strata, kinds and seeds."""
    pixel, stratum, kind, seed = np.meshgrid(np.arange(256), np.arange(16), np.arange(4), np.arange(4))
    return np.stack([pixel, stratum, kind, seed], axis=-1).reshape(-1, 4).astype(np.uint32)


def test_the_reference_hash_agrees_with_integers_by_hand(rng: np.random.Generator) -> None:
    cases = [(0, 0, 0, 0), (1, 2, 3, 4), (0xFFFFFFFF,) * 4, *map(tuple, rng.integers(0, 1 << 32, (50, 4)))]
    for case in cases:
        x, y, z, w = (int(c) for c in case)
        assert tuple(int(v) for v in pcg4d(x, y, z, w)) == pcg4d_by_hand((x, y, z, w))


def test_the_hash_agrees_bit_for_bit(runner: Runner, rng: np.random.Generator) -> None:
    # a counter that is a NaN as a float would lose bits on its way through a float buffer
    counters = rng.integers(0, 0x7F800000, (5000, 4), dtype=np.uint32)
    counters[:100] = np.arange(400).reshape(100, 4)
    found = _hashes(runner, counters)
    finite = ~np.isnan(pcg4d(*counters.T).view(np.float32))
    assert (found == pcg4d(*counters.T))[finite].all()
    assert not (found == pcg4d(*(counters + np.uint32(1)).T))[finite].any(), "other counters, other words"


def test_numbers_are_the_upper_bits_of_the_hash(runner: Runner) -> None:
    counters = _lattice()
    found = _numbers(runner, counters)
    assert (found == random4(*counters.T)).all()
    assert found.min() >= 0.0
    assert found.max() < 1.0


def test_one_is_never_reached(runner: Runner) -> None:
    """The largest 24 bits make 1 − 2^−24, which float32 holds exactly."""
    assert np.float32((0xFFFFFFFF >> 8) / 2**24) < np.float32(1.0)
    many = random4(np.arange(1 << 20), 0, 0, 0)
    assert many.max() < 1.0
    assert many.max() > 1 - 1e-5


def _chi_square(counts: NDArray[np.int64]) -> float:
    expected = counts.sum() / counts.size
    return float(((counts - expected) ** 2 / expected).sum())


@pytest.mark.parametrize("component", range(4))
def test_numbers_are_uniform(component: int) -> None:
    """Pearson's χ² of 256 cells: mean 255, standard deviation √510 ≈ 22.6."""
    numbers = random4(*_lattice().T)[:, component]
    statistic = _chi_square(np.histogram(numbers, 256, (0, 1))[0])
    assert 255 - 5 * 22.6 < statistic < 255 + 5 * 22.6
    skewed = numbers**1.1
    assert _chi_square(np.histogram(skewed, 256, (0, 1))[0]) > 255 + 5 * 22.6


@pytest.mark.parametrize("axis", range(4))
def test_neighbouring_counters_are_not_correlated(axis: int) -> None:
    """Between a counter and the next along any axis, for all pairs of components: |r| stays within 5/√n."""
    start = _lattice()[:COUNT]
    after = start.copy()
    after[:, axis] += 1
    first, second = random4(*start.T), random4(*after.T)
    r = np.corrcoef(first.T, second.T)[:4, 4:]
    assert np.abs(r).max() < 5 / np.sqrt(len(start))
    mixed = 0.97 * second + 0.03 * first
    assert np.abs(np.corrcoef(first.T, mixed.T)[:4, 4:]).max() > 5 / np.sqrt(len(start))


def test_components_are_not_correlated_and_fill_the_square() -> None:
    numbers = random4(*_lattice().T)
    r = np.corrcoef(numbers.T) - np.eye(4)
    assert np.abs(r).max() < 5 / np.sqrt(len(numbers))
    for a, b in ((0, 1), (1, 2), (2, 3), (0, 3)):
        cells = np.histogram2d(numbers[:, a], numbers[:, b], 16, ((0, 1), (0, 1)))[0]
        assert _chi_square(cells.astype(np.int64)) < 255 + 5 * 22.6


@pytest.mark.parametrize("axis", range(4))
def test_one_flipped_bit_changes_half_of_the_others(axis: int) -> None:
    """Avalanche: on average 64 of the 128 bits change, whichever of the 32 bits was flipped."""
    counters = _lattice()[::8]
    before = pcg4d(*counters.T)
    for bit in range(32):
        flipped = counters.copy()
        flipped[:, axis] ^= np.uint32(1 << bit)
        changed = np.unpackbits((before ^ pcg4d(*flipped.T)).view(np.uint8)).reshape(len(counters), -1)
        share = changed.mean()
        # the top bits of a counter reach fewer words in two rounds; a quarter is still plenty for 24 bits
        assert 0.2 < share < 0.55, f"bit {bit}: {share:.3f}"
