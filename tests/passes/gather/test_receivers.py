"""`receivers`: the shading points of a range of pixels, in tile order, and how many of them there are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, random_gbuffer
from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.image import pixel_numbers, tile_order
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import MISS, RECEIVER, RECEIVERS, SURFACE, record


def _run(
    runner: Runner, size: tuple[int, int], gbuffer: GBuffer, first: int, count: int, **more: int
) -> tuple[NDArray[Any], int]:
    values = {"patterns": 64, "seed": 3, **more}
    out = runner(
        "passes/gather/receivers",
        count,
        params=record(RECEIVERS, width=size[0], height=size[1], first=first, **values),
        receivers=np.zeros(count, RECEIVER),
        active_count=np.array([1000], np.uint32),
        **gbuffer.rows(),
    )
    return read(out, "receivers", RECEIVER), int(read(out, "active_count", np.uint32)[0]) - 1000


@pytest.mark.parametrize("size", [(333, 217), (1, 9), (5, 1), (8, 8)])
def test_receivers_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    g = random_gbuffer(rng, size[0] * size[1])
    pixels = pixel_numbers(*size)
    found, active = _run(runner, size, g, 0, len(pixels))
    live = (pixels >= 0) & (g.kind[pixels] == SURFACE)
    at = pixels[live]
    assert active == live.sum() == (g.kind == SURFACE).sum()
    assert (found["pixel"][live] == at).all()
    assert_within(found["origin"][live], g.origin[at], 2 * ULP * np.abs(g.origin[at]), "origins")
    assert_not_within(found["origin"][live], g.position[at], 2 * ULP * np.abs(g.origin[at]))
    assert (found["normal_geo"][live] == g.geometric[at].astype(np.float32)).all()
    assert (found["normal_shade"][live] == g.normal[at].astype(np.float32)).all()
    columns, rows = tile_order(*size)[live].T
    assert (found["pattern"][live] == pcg4d(columns, rows, 3, 1)[:, 0] % 64).all()
    if live.sum() > 1:
        assert not (found["pattern"][live] == pcg4d(rows, columns, 3, 1)[:, 0] % 64).all()
    assert (found["pattern"][~live] == MISS).all(), "the rest is inactive"


def test_a_range_of_pixels_is_a_part_of_the_whole(runner: Runner, rng: np.random.Generator) -> None:
    size = (100, 50)
    g = random_gbuffer(rng, 5000)
    whole, active = _run(runner, size, g, 0, len(pixel_numbers(*size)))
    total = 0
    for first in range(0, len(whole), 1024):
        count = min(1024, len(whole) - first)
        part, here = _run(runner, size, g, first, count)
        assert (part == whole[first : first + count]).all()
        total += here
    assert total == active


def test_patterns_are_even_and_follow_the_seed(runner: Runner, rng: np.random.Generator) -> None:
    """χ² over 64 patterns: mean 63, standard deviation √126 ≈ 11.2."""
    size = (256, 128)
    g = random_gbuffer(rng, 256 * 128, surfaces=2.0)
    found, _ = _run(runner, size, g, 0, 256 * 128)
    counts = np.bincount(found["pattern"], minlength=64)
    expected = counts.sum() / 64
    assert ((counts - expected) ** 2 / expected).sum() < 63 + 5 * 11.2
    image = np.zeros(size[0] * size[1], int)
    image[found["pixel"]] = found["pattern"]
    same = (image.reshape(128, 256)[:, 1:] == image.reshape(128, 256)[:, :-1]).mean()
    assert same < 3 / 64, "neighbours rarely share a pattern"
    other, _ = _run(runner, size, g, 0, 256 * 128, seed=4)
    assert (other["pattern"] == found["pattern"]).mean() < 3 / 64
    alone, _ = _run(runner, size, g, 0, 256 * 128, patterns=1)
    assert (alone["pattern"] == 0).all()


def test_nothing_seen_is_no_receiver(runner: Runner, rng: np.random.Generator) -> None:
    g = random_gbuffer(rng, 64, surfaces=-1.0)
    found, active = _run(runner, (8, 8), g, 0, 64)
    assert active == 0
    assert (found["pattern"] == MISS).all()
