"""`compact`: np.flatnonzero on the device, in order, with the arguments of a dispatch over the list."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import COMPACT, record

STEM = "passes/refine/compact"
WORDS = np.dtype((np.uint32, 2))
BLOCK = 2048
Words = NDArray[np.uint32]


def _compact(runner: Runner, flags: Words, mask: int, value: int, scanned: bool) -> tuple[Words, Words]:
    items, words, blocks = len(flags), max(-(-len(flags) // 32), 1), max(-(-len(flags) // BLOCK), 1)
    given: dict[str, NDArray[Any]] = {
        "params": record(COMPACT, items=items, mask=mask, value=value, scanned=scanned)
    }
    ends: dict[str, NDArray[Any]] = {
        "list": np.zeros(items, np.uint32),
        "arguments": np.full(4, 9, np.uint32),
    }
    counted = runner(
        STEM,
        words,
        entry="count",
        flags=flags,
        chosen=np.zeros((words, 2), np.uint32),
        totals=np.zeros(blocks, np.uint32),
        **given,
    )
    chosen, totals = read(counted, "chosen", np.uint32, words, 2), read(counted, "totals", np.uint32)
    if scanned:
        totals = read(runner(STEM, 1, entry="scan", groups=True, totals=totals, **given), "totals", np.uint32)
    out = runner(STEM, words, entry="scatter", chosen=chosen, totals=totals, **given, **ends)
    return read(out, "list", np.uint32), read(out, "arguments", np.uint32)


def _flags(rng: np.random.Generator, items: int, share: float) -> Words:
    """Random bits everywhere but in 0xF0, which is 0x50 for a share of the items and never for the others."""
    others = np.array([0x00, 0x10, 0x40, 0x70, 0xD0])[rng.integers(0, 5, items)]
    chosen = np.where(rng.uniform(size=items) < share, 0x50, others)
    return ((rng.integers(0, 1 << 32, items) & 0xFFFFFF0F) | chosen).astype(np.uint32)


def _check(found: tuple[Words, Words], expected: NDArray[np.int64]) -> None:
    items, arguments = found
    count = len(expected)
    assert arguments[3] == count
    assert (items[:count] == expected).all()
    assert not items[count:].any(), "nothing is written beyond the list"
    groups = -(-count // 64)
    assert arguments[2] == 1
    assert arguments[:2].max() <= 65_535
    assert groups <= arguments[0] * arguments[1] <= groups + arguments[1]


@pytest.mark.parametrize("items", [0, 1, 31, 63, 64, 65, 2047, 2048, 2049, 4095, 1_000_000])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("scanned", [False, True])
def test_it_is_flatnonzero(
    runner: Runner, rng: np.random.Generator, items: int, share: float, scanned: bool
) -> None:
    flags = _flags(rng, items, share)
    found = _compact(runner, flags, 0xF0, 0x50, scanned)
    expected = np.flatnonzero((flags & 0xF0) == 0x50)
    _check(found, expected)
    if 0 < share < 1 and items > 1:
        with pytest.raises(AssertionError):
            _check(found, np.flatnonzero((flags & 0xF0) == 0x70))
        with pytest.raises(AssertionError):
            _check((found[0][::-1], found[1]), expected)


@pytest.mark.parametrize("items", [0, 1, 64, 65, 2047, 2048])
def test_one_workgroup_does_the_same(runner: Runner, rng: np.random.Generator, items: int) -> None:
    flags = _flags(rng, items, 0.4)
    out = runner(
        STEM,
        1,
        entry="whole",
        groups=True,
        params=record(COMPACT, items=items, mask=0xF0, value=0x50),
        flags=flags,
        list=np.zeros(items, np.uint32),
        arguments=np.full(4, 9, np.uint32),
    )
    found = read(out, "list", np.uint32), read(out, "arguments", np.uint32)
    _check(found, np.flatnonzero((flags & 0xF0) == 0x50))


def test_the_arguments_fold_beyond_65535_workgroups(runner: Runner) -> None:
    """Five million items are 78,125 workgroups: two rows."""
    flags = np.ones(5_000_000, np.uint32)
    found = _compact(runner, flags, 1, 1, True)
    _check(found, np.arange(5_000_000))
    assert found[1][1] == 2
