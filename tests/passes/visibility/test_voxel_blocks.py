"""`voxel_blocks`: which blocks of cells have something in them or near them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, read
from tests.passes.reference.voxels import Bits, Grid, blocks_of, pack_bits, random_grid


def _blocks(runner: Runner, grid: Grid, filled: Bits) -> Bits:
    """What the pass writes behind the cells."""
    cells = pack_bits(filled)
    shape = blocks_of(filled).shape
    words = shape[0] * shape[1] * grid.words
    before: NDArray[np.uint32] = np.concatenate([cells, np.full(words, 0xABCDABCD, np.uint32)])
    out = runner("passes/visibility/voxel_blocks", words, voxels=grid.packed(), bits=before)
    after = read(out, "bits", np.uint32)
    assert (after[: len(cells)] == cells).all(), "cells are left alone"
    flags = np.unpackbits(after[len(cells) :].view(np.uint8), bitorder="little")
    return flags.reshape(shape).astype(bool)


@pytest.mark.parametrize(("columns", "rows", "words"), [(24, 17, 2), (64, 48, 1), (5, 3, 4), (1, 1, 1)])
def test_blocks_agree_with_the_loops(
    runner: Runner, rng: np.random.Generator, columns: int, rows: int, words: int
) -> None:
    grid = random_grid(rng, columns, rows, words)
    filled = rng.uniform(size=(rows, columns, grid.slices)) < 0.004
    found, wanted = _blocks(runner, grid, filled), blocks_of(filled)
    assert (found == wanted).all()
    if columns > 20:
        assert 0.02 < wanted.mean() < 0.9
        # Negative control: other cells make other blocks.
        assert (found != blocks_of(np.roll(filled, 7, 1))).any()


def test_one_cell_fills_the_blocks_around_it(runner: Runner, rng: np.random.Generator) -> None:
    grid = random_grid(rng, 32, 32, 1)
    filled = np.zeros((32, 32, 32), bool)
    filled[15, 16, 5] = True
    blocks = _blocks(runner, grid, filled)
    assert blocks.sum() == 3 * 3, (
        "row 15 lies in block 3, column 16 in block 4; four cells around reach the next"
    )
    assert blocks[2:5, 3:6, 5].all()
