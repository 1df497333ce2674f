"""Which strata of a light are asked where: 16 blocks of 4 × 4, stratum s at column s mod 4, row s div 4."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCKS, STRATA, WORDS = 16, 256, 8
_APART = np.array([0, 2, 1, 3])
"""Order of four places in which neighbours, also the last and the first, lie in different halves."""

Whole = NDArray[np.int64]


def mixed(block: Any) -> Whole:
    """What is added bit by bit to a block's strata, so that no two blocks ask alike."""
    return np.asarray(block) * 7 % 16


def single(place: Whole, block: Any) -> Whole:
    """The one stratum of a block that places (..., 2) of a lattice ask."""
    return (_APART[place[..., 0] % 4] + 4 * _APART[place[..., 1] % 4]) ^ mixed(block)


def of_block(subs: int, pixel: Whole, block: int) -> NDArray[np.bool_]:
    """Which of the 16 strata of a block pixels (..., 2) ask: one, one of each quarter, or all; (..., 16)."""
    strata = np.arange(16)
    if subs == 1:
        return single(pixel, block)[..., None] == strata
    if subs != 4:
        return np.ones((*pixel.shape[:-1], 16), bool)
    column, row = (pixel[..., 0] + mixed(block)) % 2, (pixel[..., 1] + mixed(block) // 2) % 2
    same: NDArray[np.bool_] = (strata % 2 == column[..., None]) & (strata // 4 % 2 == row[..., None])
    return same


def boosts(brightness: Any) -> int:
    """The word that says how bright each of the blocks is: 0 dim, 1 as most, 2 bright."""
    return int((np.broadcast_to(brightness, BLOCKS).astype(np.int64) << 2 * np.arange(BLOCKS)).sum())


def by_plan(
    pixels: Whole, subs: Whole, sure: NDArray[np.bool_], once: NDArray[np.bool_], brightness: Any = 1
) -> NDArray[np.bool_]:
    """What pixels (n, 2) ask by the plans of their cells, (n, 16, 16).

    Nothing of the blocks that are sure; one stratum of the others where that is enough, else `subs` of them;
    of bright blocks four times as many, of dim ones a quarter: at least one, and at most all.
    """
    asked = np.zeros((len(pixels), BLOCKS, 16), bool)
    wanted = np.where(once, 1, subs[:, None]) * np.array([0.25, 1, 4])[np.broadcast_to(brightness, BLOCKS)]
    numbers = np.clip(wanted, 1, 16).astype(int)
    for number in np.unique(numbers):
        here = np.stack([of_block(number, pixels, block) for block in range(BLOCKS)], axis=1)
        asked |= here & (numbers == number)[..., None]
    return asked & ~sure[..., None]


def quarter(stratum: Any) -> Whole:
    """Quarter of its block that a stratum lies in: 0 or 1 along u, plus 2 along v."""
    stratum = np.asarray(stratum)
    return stratum % 4 // 2 + 2 * (stratum // 8)


def asker(block: Any) -> Whole:
    """The pixel of a cell, 0 to 3, that asks a block: 0 1 2 3 in the first row, 1 0 3 2 next."""
    block = np.asarray(block)
    return (block % 4) ^ (block // 4)


def words(asked: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """The words of (..., 16 blocks, 16 strata): two blocks a word, (..., 8)."""
    bits = np.packbits(asked.reshape(*asked.shape[:-2], WORDS, 32), axis=-1, bitorder="little")
    return np.ascontiguousarray(bits).view("<u4")[..., 0]


def blocks(rows: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """The reverse of `words`: (..., 16, 16) from (..., 8)."""
    octets = np.ascontiguousarray(rows, "<u4").view(np.uint8)
    flat = np.unpackbits(octets, axis=-1, bitorder="little")
    return flat.reshape(*rows.shape[:-1], BLOCKS, 16).astype(bool)
