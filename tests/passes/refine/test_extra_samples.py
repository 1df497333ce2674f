"""`extra_samples`: pixels on borders of large fragments and of the image [KJ16 Sec. 3.1.4]."""

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


Texel = tuple[int, int, int]


def _places(size: tuple[int, int], level: int, row: int, column: int) -> dict[tuple[int, int], int]:
    """Pixels of samples by set and number: upper and left side, the image's last column, its last row.

    A pixel is one sample: that of the first set, the image's last pixel, the last column, the last row.
    """
    half, x, y, (columns, rows) = 2**level // 2, column * 2**level, row * 2**level, size
    right, below = x + 2**level >= columns, y + 2**level >= rows
    wanted = {(0, 0): (x + half, y), (0, 1): (x, y), (0, 2): (x, y + half)}
    if right and below:
        wanted[1, 2] = (columns - 1, rows - 1)
    if right:
        wanted |= {(1, 0): (columns - 1, y), (1, 1): (columns - 1, y + half)}
    if below:
        wanted |= {(2, 0): (x, rows - 1), (2, 1): (x + half, rows - 1)}
    found: dict[tuple[int, int], int] = {}
    for key, (c, r) in wanted.items():
        if c < columns and r < rows and r * columns + c not in found.values():
            found[key] = r * columns + c
    return found


def _entries(size: tuple[int, int], coarsest: int, large: list[Texel]) -> dict[int, tuple[Texel, int]]:
    """Numbers in the list of sets, ascending: texel and set."""
    levels = sizes(*size)
    texels = sum(level[3] for level in levels[LARGE : coarsest + 1])
    found = {}
    for level, row, column in large:
        columns, rows, first, _ = levels[level]
        number = first + row * columns + column - levels[LARGE][2]
        for key, there in enumerate((True, column == columns - 1, row == rows - 1)):
            if there:
                found[key * texels + number] = ((level, row, column), key)
    return dict(sorted(found.items()))


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
        3 * (len(at) - first),
        entry="find",
        pyramid=pyramid_record(view, coarsest, 0, 0),
        fragment_at=at,
        extra_flags=np.full(3 * (len(at) - first), 7, np.uint32),
    )
    flags = read(out, "extra_flags", np.uint32)
    assert (np.flatnonzero(flags) == list(_entries(size, coarsest, large))).all()
    assert set(flags) <= {0, 1}
    assert flags.any()


@pytest.mark.parametrize(("size", "coarsest"), SIZES)
def test_samples_lie_on_borders(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    view, g, at, large = _case(rng, size, coarsest)
    first = sizes(*size)[LARGE][2]
    entries = _entries(size, coarsest, large)
    places = 3 * len(entries)
    out = runner(
        STEM,
        places,
        entry="points",
        params=record(EXTRA_SAMPLES, patterns=7, seed=5),
        pyramid=pyramid_record(view, coarsest, 0, 0),
        extra_list=np.array(list(entries), np.uint32),
        extra_receivers=np.full(places, 9, RECEIVER),
        extra_irradiance=np.full((places, 4), 9, np.float32),
        extra_at=np.zeros(3 * (len(at) - first), np.uint32),
        extra_count=np.zeros(1, np.uint32),
        **g.rows(),
    )
    receivers = read(out, "extra_receivers", RECEIVER)
    light = read(out, "extra_irradiance", np.float32, places, 4)
    pixels = [_places(size, *texel).get((key, k)) for texel, key in entries.values() for k in range(3)]
    there = np.array([pixel is not None and g.kind[pixel] == SURFACE for pixel in pixels])
    assert (light == np.where(there[:, None], [0, 0, 0, 1], 0)).all()
    assert read(out, "extra_count", np.uint32)[0] == there.sum()
    numbers = read(out, "extra_at", np.uint32)
    assert (numbers[list(entries)] == 1 + np.arange(len(entries))).all()
    assert np.count_nonzero(numbers) == len(entries)
    assert (receivers["pixel"] == [p if t else MISS for p, t in zip(pixels, there, strict=True)]).all()
    own = np.array([p for p, t in zip(pixels, there, strict=True) if t], np.int64)
    row, column = np.divmod(own, size[0])
    assert (receivers["pattern"][there] == pcg4d(column, row, 5, 1)[:, 0] % 7).all()
    assert_within(receivers["origin"][there], g.origin[own], 2 * ULP * np.abs(g.origin[own]), "origins")
    for name, normals in (("normal_geo", g.geometric), ("normal_shade", g.normal)):
        assert (receivers[name][there] == normals[own]).all(), name
    assert there.any()
