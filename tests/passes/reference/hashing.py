"""The counter-based random numbers, bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Words = NDArray[np.uint32]


def pcg4d(x: ArrayLike, y: ArrayLike, z: ArrayLike, w: ArrayLike) -> Words:
    """Hash four counters to four words, (..., 4) uint32 [JO20 pcg4d].

    A linear congruential step for each word, then twice a round of multiply-adds among the words, with a
    xorshift by half a word between the rounds; all modulo 2^32.
    """
    words = np.broadcast_arrays(*(np.asarray(c, np.uint64).astype(np.uint32) for c in (x, y, z, w)))
    v: list[Any] = list(words)

    def mix() -> None:
        for target, left, right in ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)):
            v[target] = v[target] + v[left] * v[right]

    with np.errstate(over="ignore"):
        v = [c * np.uint32(1664525) + np.uint32(1013904223) for c in v]
        mix()
        v = [c ^ (c >> np.uint32(16)) for c in v]
        mix()
    return np.stack(v, axis=-1)


def random4(x: ArrayLike, y: ArrayLike, z: ArrayLike, w: ArrayLike) -> NDArray[np.float64]:
    """Four numbers in [0, 1) for four counters, (..., 4): the upper 24 bits of each word as a fraction."""
    fraction: NDArray[np.float64] = (pcg4d(x, y, z, w) >> np.uint32(8)).astype(np.float64) / 2.0**24
    return fraction


def pcg4d_by_hand(counters: tuple[int, int, int, int]) -> tuple[int, ...]:
    """Hash one counter in Python's own integers, statement by statement as the paper's listing."""
    m = (1 << 32) - 1
    x, y, z, w = ((c * 1664525 + 1013904223) & m for c in counters)
    x = (x + y * w) & m
    y = (y + z * x) & m
    z = (z + x * y) & m
    w = (w + y * z) & m
    x, y, z, w = (c ^ c >> 16 for c in (x, y, z, w))
    x = (x + y * w) & m
    y = (y + z * x) & m
    z = (z + x * y) & m
    w = (w + y * z) & m
    return x, y, z, w
