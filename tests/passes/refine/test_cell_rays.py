"""`cell_rays`: each cell of an open tile asks each block of strata once, by one of its pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import light_frames as frames
from tests.passes.reference import strata
from tests.passes.reference.cells import Layout
from tests.passes.reference.gbuffers import GBuffer, tiled_gbuffer
from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.lights import Light, random_area, random_spot, table
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIST, MISS, RECEIVER, SURFACE, record

SIZES = [(77, 45), (1, 19), (23, 1), (16, 16)]
SEED, PATTERNS = 11, 13


def _run(
    runner: Runner,
    light: Light,
    layout: Layout,
    g: GBuffer,
    tiles: NDArray[np.int64],
    first: int = 0,
    entry: str = "main",
) -> tuple[NDArray[Any], NDArray[np.uint32]]:
    count = 64 * (len(tiles) - first)
    width = 1 if entry == "spot" else strata.WORDS
    lights = [random_spot(np.random.default_rng(0)), light]
    params = record(
        LIST, width=layout.width, height=layout.height, light=1, patterns=PATTERNS, seed=SEED, first=first
    )
    out = runner(
        "passes/refine/cell_rays",
        count,
        entry=entry,
        params=params,
        frame=frames.light_frame(light),
        lights=table(lights),
        open_tiles=tiles.astype(np.uint32),
        receivers=np.zeros(count, RECEIVER),
        asked=np.full((count, width), 0xABCDEF01, np.uint32),
        **g.rows(),
    )
    return read(out, "receivers", RECEIVER), read(out, "asked", np.uint32, count, width)


def _tiles(rng: np.random.Generator, layout: Layout) -> NDArray[np.int64]:
    """Some of the tiles, ascending."""
    count = layout.tiles[0] * layout.tiles[1]
    return np.flatnonzero(rng.uniform(size=count) < 0.6) if count > 4 else np.arange(count)


def _pixels(layout: Layout, tiles: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(column, row) of the listed receivers' pixels and cells, (n, 2) each."""
    listed = (16 * tiles[:, None] + np.arange(16)).ravel()
    corners = layout.corners(listed)
    return corners.reshape(-1, 2), np.repeat(layout.order[listed], 4, axis=0)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "spot"])
def test_receivers_and_strata_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], kind: str
) -> None:
    layout = Layout(*size)
    light: Light = random_spot(rng, 70) if kind == "spot" else random_area(rng, two_sided=kind == "two-sided")
    g = frames.without_doubt(light, tiled_gbuffer(rng, *size, surfaces=0.8))
    tiles = _tiles(rng, layout)
    found, asked = _run(runner, light, layout, g, tiles, entry="spot" if kind == "spot" else "main")
    pixels, cells = _pixels(layout, tiles)
    at = layout.number(pixels)
    live = (at >= 0) & (g.kind[at] == SURFACE) & frames.seen_by(light, g).facing[at]
    assert size[0] < 50 or 0.02 < live.mean() < 0.9
    assert ((found["pattern"] != MISS) == live).all()
    at = at[live]
    assert (found["pixel"][live] == at).all()
    assert (found["pattern"][live] == pcg4d(*pixels[live].T, SEED, 1)[:, 0] % PATTERNS).all()
    assert_within(found["origin"][live], g.origin[at], 2 * ULP * np.abs(g.origin[at]), "origins")
    assert (found["normal_geo"][live] == g.geometric[at]).all()
    assert (found["normal_shade"][live] == g.normal[at]).all()
    if len(at) > 9:
        assert_not_within(found["origin"][live], g.position[at], 2 * ULP * np.abs(g.origin[at]))
    if kind == "spot":
        assert (asked == 1).all()
        return
    block, corner = np.arange(16), np.arange(len(cells)) % 4
    mine = strata.asker(block) == corner[:, None]
    which = strata.single(cells[:, None], block)[..., None] == np.arange(16)
    expected = strata.words(mine[..., None] & which)
    assert (asked == expected).all()
    assert not (asked == expected[::-1]).all()


def test_any_4_by_4_cells_ask_every_stratum_and_a_cell_each_block(
    runner: Runner, rng: np.random.Generator
) -> None:
    """Whatever tiles they lie in."""
    layout = Layout(40, 24)
    light = random_area(rng)
    tiles = np.arange(15)
    _, asked = _run(runner, light, layout, tiled_gbuffer(rng, 40, 24), tiles)
    cells = strata.blocks(asked).reshape(-1, 4, 16, 16)
    assert (cells.sum(axis=(1, 3)) == 1).all(), "each cell each block once"
    assert (cells.sum(axis=(2, 3)) == 4).all(), "each pixel four"
    image = layout.image(cells.any(axis=1))
    windows = np.lib.stride_tricks.sliding_window_view(image, (4, 4), axis=(0, 1))
    assert (windows.sum(axis=(-1, -2)) == 1).all()
    narrow = np.lib.stride_tricks.sliding_window_view(image, (4, 3), axis=(0, 1))
    assert not (narrow.sum(axis=(-1, -2)) == 1).all()


@pytest.mark.parametrize("entry", ["main", "spot"])
def test_a_piece_of_the_list_is_a_part_of_the_whole(
    runner: Runner, rng: np.random.Generator, entry: str
) -> None:
    layout = Layout(77, 45)
    light: Light = random_spot(rng, 70) if entry == "spot" else random_area(rng)
    g = tiled_gbuffer(rng, 77, 45)
    tiles = _tiles(rng, layout)
    whole = _run(runner, light, layout, g, tiles, entry=entry)
    part = _run(runner, light, layout, g, tiles, 7, entry=entry)
    for a, b in zip(whole, part, strict=True):
        assert (a[7 * 64 :] == b).all()
    assert not (whole[0][: -7 * 64] == part[0]).all()
