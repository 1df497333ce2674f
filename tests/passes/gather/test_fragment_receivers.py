"""`fragment_receivers`: each fragment's shading point is its surface pixel nearest to its middle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, random_gbuffer
from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.image import pixel_numbers, random_view
from tests.passes.reference.nodes import middle_pixel
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import FRAGMENT_RECEIVERS, RECEIVER, SURFACE, record

COARSEST = 5


def _fragments(
    rng: np.random.Generator, view: NDArray[Any], g: GBuffer
) -> list[tuple[int, NDArray[np.int64]]]:
    """For each place of the tile order that begins a fragment: its level and its pixels; levels at random."""
    width, height = int(view["width"][0]), int(view["height"][0])
    numbers = np.arange(width * height).reshape(height, width)
    level_of = rng.integers(0, COARSEST + 1, (height // 32 + 1, width // 32 + 1))
    found = []
    for pixel in pixel_numbers(width, height):
        line, column = divmod(int(pixel), width)
        level = int(level_of[line // 32, column // 32]) if pixel >= 0 else 0
        side = 2**level
        block = numbers[line : line + side, column : column + side].ravel()
        begins = pixel >= 0 and line % side == 0 and column % side == 0
        found.append((level if begins and (g.kind[block] == SURFACE).any() else -1, block))
    return found


@pytest.mark.parametrize("size", [(70, 45), (1, 40), (33, 1), (3, 3)])
@pytest.mark.parametrize("surfaces", [0.2, 0.9])
def test_receivers_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], surfaces: float
) -> None:
    view = random_view(rng, *size)
    g = random_gbuffer(rng, size[0] * size[1], surfaces=surfaces)
    g.kind[0] = SURFACE
    places = _fragments(rng, view, g)
    chosen = np.flatnonzero([level >= 0 for level, _ in places])
    flags = np.array([257 + level if level >= 0 else 0 for level, _ in places], np.uint32)
    levels = sizes(*size)
    total = sum(row[3] for row in levels[: COARSEST + 1])
    first = len(chosen) // 3
    count = len(chosen) - first
    out = runner(
        "passes/gather/fragment_receivers",
        count,
        params=record(FRAGMENT_RECEIVERS, first=first, patterns=64, seed=3),
        pyramid=pyramid_record(view, COARSEST),
        fragment_list=chosen.astype(np.uint32),
        fragment_flags=flags,
        receivers=np.zeros(count, RECEIVER),
        fragment_at=np.zeros(total, np.uint32),
        **g.rows(),
    )
    found, at = read(out, "receivers", RECEIVER), read(out, "fragment_at", np.uint32)
    pixels = np.array([middle_pixel(view, g, places[place][1]) for place in chosen[first:]])
    assert (found["pixel"] == first + np.arange(count)).all(), "the fragment's number"
    assert_within(found["origin"], g.origin[pixels], 2 * ULP * np.abs(g.origin[pixels]), "origins")
    if count > 1:
        wrong = np.roll(pixels, 1)
        assert_not_within(found["origin"], g.origin[wrong], 2 * ULP * np.abs(g.origin[wrong]))
    assert (found["normal_geo"] == g.geometric[pixels].astype(np.float32)).all()
    assert (found["normal_shade"] == g.normal[pixels].astype(np.float32)).all()
    line, column = np.divmod(pixels, size[0])
    assert (found["pattern"] == pcg4d(column, line, 3, 1)[:, 0] % 64).all()

    expected = np.zeros(total, np.uint32)
    for number, place in enumerate(chosen[first:], first + 1):
        level, block = places[place]
        columns, _, start, _ = levels[level]
        y, x = divmod(int(block[0]), size[0])
        expected[start + (y >> level) * columns + (x >> level)] = number
    assert (at == expected).all()
