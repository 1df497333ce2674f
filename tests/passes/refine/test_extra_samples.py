"""`extra_samples`: three pixels on the border of every large fragment [KJ16 Sec. 3.1.4]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, wavy_gbuffer
from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.image import random_view
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import ULP, Runner, assert_within, read
from tests.passes.reference.structs import EXTRA_SAMPLES, MISS, RECEIVER, SURFACE, record

STEM = "passes/refine/extra_samples"
LARGE = 3
SIZES = [((70, 45), 4), ((37, 21), 3), ((129, 64), 6), ((1, 40), 4), ((9, 9), 3)]


def _places(size: tuple[int, int], level: int, row: int, column: int) -> list[int | None]:
    """Pixels in the middle of the upper side, in the corner, and in that of the left side; None outside."""
    width = 2**level
    x, y = column * width, row * width
    all_ = [(x + width // 2, y), (x, y), (x, y + width // 2)]
    return [r * size[0] + c if c < size[0] and r < size[1] else None for c, r in all_]


def _case(
    rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> tuple[NDArray[Any], GBuffer, NDArray[np.uint32], list[tuple[int, int, int]]]:
    """A surface with holes, numbers of fragments, and the texels of the large ones in order."""
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=0.1, step=0.5)
    levels = sizes(*size)
    at = np.zeros(sum(level[3] for level in levels[: coarsest + 1]), np.uint32)
    large = []
    for level in range(coarsest + 1):
        columns, rows, first, _ = levels[level]
        for texel in range(columns * rows):
            kind = rng.choice([0, 1, 2])
            at[first + texel] = (0, 1 + texel, CULLED)[kind]
            if kind == 1 and level >= LARGE:
                large.append((level, *divmod(texel, columns)))
    return view, g, at, large


@pytest.mark.parametrize(("size", "coarsest"), SIZES)
def test_large_fragments_are_found(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    view, _, at, large = _case(rng, size, coarsest)
    first = sizes(*size)[LARGE][2]
    out = runner(
        STEM,
        len(at) - first,
        entry="find",
        pyramid=pyramid_record(view, coarsest, 0, 0),
        fragment_at=at,
        extra_flags=np.full(len(at) - first, 7, np.uint32),
    )
    flags = read(out, "extra_flags", np.uint32)
    numbers = [sizes(*size)[level][2] + row * sizes(*size)[level][0] + column for level, row, column in large]
    assert (np.flatnonzero(flags) + first == numbers).all()
    assert set(flags) <= {0, 1}
    assert flags.any()


@pytest.mark.parametrize(("size", "coarsest"), SIZES)
def test_samples_lie_on_the_upper_and_left_border(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    view, g, at, large = _case(rng, size, coarsest)
    levels = sizes(*size)
    first = levels[LARGE][2]
    entries = [levels[level][2] + row * levels[level][0] + column - first for level, row, column in large]
    places = 3 * len(large)
    out = runner(
        STEM,
        places,
        entry="points",
        params=record(EXTRA_SAMPLES, patterns=7, seed=5),
        pyramid=pyramid_record(view, coarsest, 0, 0),
        extra_list=np.array(entries, np.uint32),
        extra_receivers=np.full(places, 9, RECEIVER),
        extra_irradiance=np.full((places, 4), 9, np.float32),
        extra_at=np.zeros(len(at) - first, np.uint32),
        extra_count=np.zeros(1, np.uint32),
        **g.rows(),
    )
    receivers = read(out, "extra_receivers", RECEIVER)
    light = read(out, "extra_irradiance", np.float32, places, 4)
    pixels = [pixel for texel in large for pixel in _places(size, *texel)]
    there = np.array([pixel is not None and g.kind[pixel] == SURFACE for pixel in pixels])
    assert (light == np.where(there[:, None], [0, 0, 0, 1], 0)).all()
    assert read(out, "extra_count", np.uint32)[0] == there.sum()
    numbers = read(out, "extra_at", np.uint32)
    assert (numbers[entries] == 1 + np.arange(len(large))).all()
    assert np.count_nonzero(numbers) == len(large)
    assert (receivers["pixel"] == [p if t else MISS for p, t in zip(pixels, there, strict=True)]).all()
    own = np.array([p for p, t in zip(pixels, there, strict=True) if t], np.int64)
    row, column = np.divmod(own, size[0])
    assert (receivers["pattern"][there] == pcg4d(column, row, 5, 1)[:, 0] % 7).all()
    assert_within(receivers["origin"][there], g.origin[own], 2 * ULP * np.abs(g.origin[own]), "origins")
    for name, normals in (("normal_geo", g.geometric), ("normal_shade", g.normal)):
        assert (receivers[name][there] == normals[own]).all(), name
    assert there.any()
