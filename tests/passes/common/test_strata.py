"""Which strata pixels and cells ask: neighbours together ask all of them, and none of them twice."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import strata
from tests.passes.reference.run import Runner

SIDE = 24
Bits = NDArray[np.bool_]


def _pixels() -> NDArray[np.int64]:
    """SIDE × SIDE of them, far from the corner and not at a multiple of four: (row, column, 2)."""
    return np.stack(np.meshgrid(np.arange(SIDE) + 1001, np.arange(SIDE) + 334), axis=-1)


def _asked(runner: Runner, subs: int) -> Bits:
    """What the shader says of every pixel: (row, column, block, stratum)."""
    pixels = _pixels().reshape(-1, 2)
    given = np.zeros((len(pixels), 4), np.uint32)
    given[:, :2] = pixels
    out = runner.function(
        "import package::common::strata::{BLOCKS, asked_of_block};",
        f"""
    for (var block = 0u; block < BLOCKS; block++) {{
        let bits = asked_of_block({subs}u, bitcast<vec4u>(given[i]).xy, block);
        answer[i * BLOCKS + block] = vec4f(f32(bits));
    }}""",
        given.view(np.float32),
        rows=16,
    )
    bits = out.view(np.float32)[..., 0].astype(np.int64)
    return ((bits[..., None] >> np.arange(16)) & 1).astype(bool).reshape(SIDE, SIDE, 16, 16)


def _together(asked: Bits, side: int) -> NDArray[np.int64]:
    """How often each stratum is asked by every window of side × side pixels, wherever it begins."""
    windows = np.lib.stride_tricks.sliding_window_view(asked, (side, side), axis=(0, 1))
    return windows.sum(axis=(-1, -2))


def _quarters(asked: Bits) -> NDArray[np.int64]:
    """Strata asked of each quarter of a block: (..., 4)."""
    of = strata.quarter(np.arange(16))
    return np.stack([asked[..., of == q].sum(axis=-1) for q in range(4)], axis=-1)


@pytest.mark.parametrize("subs", [1, 4, 16])
def test_the_strata_of_a_block_agree_with_the_reference(runner: Runner, subs: int) -> None:
    found = _asked(runner, subs)
    expected = np.stack([strata.of_block(subs, _pixels(), b) for b in range(16)], axis=2)
    assert (found == expected).all()
    assert (found.sum(axis=-1) == subs).all()
    if subs < 16:
        assert (found != np.roll(expected, 1, axis=1)).any(axis=-1).all(), "a pixel on, other strata"


def test_any_4_by_4_pixels_ask_each_stratum_once(runner: Runner) -> None:
    found = _asked(runner, 1)
    assert (_together(found, 4) == 1).all()
    assert not (_together(found[:, ::2], 4) == 1).all(), "a wider lattice does not"


def test_any_2_by_2_pixels_ask_one_of_each_quarter(runner: Runner) -> None:
    found = _asked(runner, 1)
    assert (_quarters(_together(found, 2) > 0) == 1).all()
    rows = np.lib.stride_tricks.sliding_window_view(found, (1, 4), axis=(0, 1)).any(axis=(-1, -2))
    assert not (_quarters(rows) == 1).all(), "four in a row do not"


def test_four_are_one_of_each_quarter_and_any_2_by_2_pixels_ask_all(runner: Runner) -> None:
    found = _asked(runner, 4)
    assert (_quarters(found) == 1).all()
    assert (_together(found, 2) == 1).all()
    assert not (_together(found[::2], 2) == 1).all()


@pytest.mark.parametrize("subs", [1, 4])
def test_blocks_differ(runner: Runner, subs: int) -> None:
    """As many different choices over the blocks as there are."""
    found = strata.words(_asked(runner, subs)).astype(np.int64)
    halves = np.stack([found & 0xFFFF, found >> 16], axis=-1).reshape(SIDE, SIDE, 16)
    choices = 16 // subs
    assert all(len(np.unique(halves[y, x])) == choices for y in range(SIDE) for x in range(SIDE))


def test_a_cell_asks_each_block_once(runner: Runner) -> None:
    """Every pixel of it four blocks; any 4 × 4 cells all strata of every block."""
    cells = _pixels().reshape(-1, 2)
    given = np.zeros((len(cells), 4), np.uint32)
    given[:, :2] = cells
    out = runner.function(
        "import package::common::strata::{BLOCKS, cell_pixel, cell_stratum};",
        """
    for (var block = 0u; block < BLOCKS; block++) {
        let cell = bitcast<vec4u>(given[i]).xy;
        answer[i * BLOCKS + block] = vec4f(f32(cell_pixel(block)), f32(cell_stratum(cell, block)), 0.0, 0.0);
    }""",
        given.view(np.float32),
        rows=16,
    )
    pixel, stratum = np.moveaxis(out.view(np.float32)[..., :2].astype(int), -1, 0)
    assert (np.sort(pixel, axis=1) == np.repeat(np.arange(4), 4)).all()
    assert (pixel == strata.asker(np.arange(16))).all()
    assert not (pixel == strata.asker(np.arange(16)[::-1] ^ 1)).all()
    asked = (stratum[..., None] == np.arange(16)).reshape(SIDE, SIDE, 16, 16)
    assert (_together(asked, 4) == 1).all()
    assert (_quarters(_together(asked, 2)) == 1).all()


def test_words_and_blocks_are_inverse(rng: np.random.Generator) -> None:
    rows = rng.integers(0, 1 << 32, (5, 7, 8), dtype=np.uint32)
    assert (strata.words(strata.blocks(rows)) == rows).all()
    one = np.zeros((16, 16), bool)
    one[5, 3] = True
    assert (strata.words(one) == [0, 0, 1 << 19, 0, 0, 0, 0, 0]).all(), "block 5 is the high half of word 2"
