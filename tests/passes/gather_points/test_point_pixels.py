"""`point_pixels`: pixels take the points around them, and blocks gather where none holds [WRC88; WH92]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import gather_points as gp
from tests.passes.reference.gbuffers import GBuffer
from tests.passes.reference.pyramids import pixel_width, pyramid_record, sizes
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import NOTHING, SURFACE, VIEW, record

Array = NDArray[np.float64]
WIDTH, HEIGHT, COARSEST = 37, 29, 3
VIEW_OF = record(VIEW, width=WIDTH, height=HEIGHT, fx=40.0, fy=40.0, eye=(0, 0, 5), backward=(0, 0, 1))
REACH, COVERED = 0.7, 0.3
PIXELS = WIDTH * HEIGHT


def _gbuffer(rng: np.random.Generator) -> GBuffer:
    """A bumpy sheet before the eye, with holes."""
    y, x = np.divmod(np.arange(PIXELS), WIDTH)
    position = np.stack([x / 10, y / 10, 0.05 * rng.normal(size=PIXELS)], axis=-1)
    normal = np.array([0, 0, 1.0]) + 0.1 * rng.normal(size=(PIXELS, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    position, normal = (a.astype(np.float32).astype(np.float64) for a in (position, normal))
    kind = np.where(rng.uniform(size=PIXELS) < 0.9, SURFACE, NOTHING)
    return GBuffer(position, np.zeros(PIXELS), normal, normal, kind)


@dataclasses.dataclass
class Case:
    """Points of one level."""

    level: int
    g: GBuffer
    points: NDArray[Any]
    at: NDArray[np.uint32]
    sums: NDArray[np.float32]
    coverage: NDArray[np.float32]


def _case(rng: np.random.Generator, level: int, share: float = 0.8) -> Case:
    g = _gbuffer(rng)
    columns, _, first, count = sizes(WIDTH, HEIGHT)[level]
    blocks = np.flatnonzero(rng.uniform(size=count) < share)
    points = gp.random_points(rng, 1 + len(blocks), 0.1)
    row, column = np.divmod(blocks, columns)
    middle = (np.stack([column, row], axis=-1) + 0.5) * 2**level / 10
    points["position"][1:, :2] += middle
    at = np.zeros(sizes(WIDTH, HEIGHT)[COARSEST][2] + sizes(WIDTH, HEIGHT)[COARSEST][3], np.uint32)
    at[first + blocks] = 2 + np.arange(len(blocks))
    sums = rng.uniform(0, 2, (PIXELS, 4)).astype(np.float32)
    return Case(level, g, points, at, sums, rng.uniform(0, 0.2, PIXELS).astype(np.float32))


def _interpolate(runner: Runner, case: Case) -> tuple[Array, Array, NDArray[np.uint32]]:
    rows = case.g.rows()
    below = sizes(WIDTH, HEIGHT)[max(case.level - 1, 0)][3]
    out = runner(
        "passes/gather_points/point_pixels",
        PIXELS,
        entry="interpolate",
        params=gp.params(reach=REACH, covered=COVERED),
        pyramid=pyramid_record(VIEW_OF, COARSEST, level=case.level),
        view=VIEW_OF,
        g_position=rows["g_position"],
        g_normal=rows["g_normal"],
        point_at=case.at,
        points=case.points,
        sums=case.sums,
        coverage=case.coverage,
        marks=np.zeros(below, np.uint32),
    )
    sums = read(out, "sums", np.float32, -1, 4).astype(np.float64)
    return sums, read(out, "coverage", np.float32).astype(np.float64), read(out, "marks", np.uint32)


def _expected(case: Case) -> tuple[Array, Array]:
    """Sums and coverage; bilinear weights of the four blocks about a pixel, of the border's own beyond it."""
    columns, rows, first, _ = sizes(WIDTH, HEIGHT)[case.level]
    y, x = np.divmod(np.arange(PIXELS), WIDTH)
    place = (np.stack([x, y], axis=-1) + 0.5) / 2**case.level - 0.5
    corner = np.floor(place).astype(int)
    part = place - corner
    p, n = case.g.position, case.g.normal
    width = pixel_width(VIEW_OF) * (5 - p[:, 2])
    numbers, weights = [], []
    for step in ((0, 0), (1, 0), (0, 1), (1, 1)):
        block = np.clip(corner + step, 0, [columns - 1, rows - 1])
        number = case.at[first + block[:, 1] * columns + block[:, 0]].astype(int)
        share = np.where(step, part, 1 - part).prod(axis=1)
        held = gp.holds(case.points[np.maximum(number - 1, 0)], REACH, p, n, width)
        numbers.append(np.maximum(number - 1, 0))
        weights.append(np.where(number > 0, share * held, 0))
    stacked = case.points[np.stack(numbers, axis=1)]
    light, more, total = gp.mean_at(stacked, np.stack(weights, axis=1), p, n)
    seen = case.g.kind == SURFACE
    factor = 4.0 ** (COARSEST - case.level)
    added = factor * np.concatenate([light + more, total[:, None]], axis=1)
    sums = case.sums.astype(np.float64) + np.where(seen[:, None], added, 0)
    return sums, case.coverage.astype(np.float64) + np.where(seen, total, 0)


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_pixels_agree_with_the_reference(runner: Runner, rng: np.random.Generator, level: int) -> None:
    case = _case(rng, level)
    sums, coverage, marks = _interpolate(runner, case)
    expected, covered = _expected(case)
    # fourth powers of differences of positions
    bound = 1e-4 * np.abs(expected).max(axis=0)
    assert_within(sums, expected, bound, "sums")
    assert_within(coverage, covered, 1e-4, "coverage")
    moved = dataclasses.replace(case, points=np.roll(case.points, 1))
    assert_not_within(sums, _expected(moved)[0], bound)
    if level == 0:
        assert not marks.any()
        return
    lacking = (case.g.kind == SURFACE) & (coverage < COVERED)
    assert lacking.any()
    assert not lacking[case.g.kind == SURFACE].all()
    assert (marks == _marks(lacking, level - 1)).all()


def _marks(wanted: NDArray[np.bool_], level: int) -> NDArray[np.uint32]:
    """Of each block with a wanted pixel: the one nearest to its middle, row by row the first of them."""
    columns, rows, _, count = sizes(WIDTH, HEIGHT)[level]
    side = 2**level
    made = np.zeros(count, np.uint32)
    image = wanted.reshape(HEIGHT, WIDTH)
    for block in range(count):
        row, column = divmod(block, columns)
        part = image[side * row : side * (row + 1), side * column : side * (column + 1)]
        keys = [
            ((2 * x + 1 - side) ** 2 + (2 * y + 1 - side) ** 2) * side**2 + y * side + x
            for y, x in zip(*np.nonzero(part), strict=True)
        ]
        if keys:
            made[block] = gp.MARKED | (0x7FFFFFFF - min(keys))
    assert rows * columns == count
    return made


@pytest.mark.parametrize("level", [0, 2, 4])
def test_at_first_every_block_that_sees_a_surface_gathers(
    runner: Runner, rng: np.random.Generator, level: int
) -> None:
    g = _gbuffer(rng)
    count = sizes(WIDTH, HEIGHT)[level][3]
    out = runner(
        "passes/gather_points/point_pixels",
        PIXELS,
        entry="begin",
        pyramid=pyramid_record(VIEW_OF, level, level=level),
        g_normal=g.rows()["g_normal"],
        sums=np.full((PIXELS, 4), 3, np.float32),
        coverage=np.full(PIXELS, 3, np.float32),
        marks=np.zeros(count, np.uint32),
    )
    assert (read(out, "marks", np.uint32) == _marks(g.kind == SURFACE, level)).all()
    assert not read(out, "sums", np.float32).any()
    assert not read(out, "coverage", np.float32).any()


def test_levels_are_those_of_blocks_whose_parts_have_no_points(
    runner: Runner, rng: np.random.Generator
) -> None:
    g = _gbuffer(rng)
    levels = sizes(WIDTH, HEIGHT)
    at = np.zeros(levels[COARSEST][2] + levels[COARSEST][3], np.uint32)
    expected = np.full((HEIGHT, WIDTH), COARSEST)
    parents = np.ones(levels[COARSEST][:2][::-1], bool)
    at[levels[COARSEST][2] :] = 1
    for level in range(COARSEST - 1, -1, -1):
        columns, rows, first, count = levels[level]
        grown = parents.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns]
        chosen = grown & (rng.uniform(size=(rows, columns)) < 0.2)
        at[first : first + count] = chosen.ravel()
        split = np.zeros(parents.shape, bool)
        np.logical_or.at(split, tuple(i // 2 for i in np.nonzero(chosen)), True)
        side = 2 ** (level + 1)
        whole = split.repeat(side, axis=0).repeat(side, axis=1)[:HEIGHT, :WIDTH]
        expected[whole & (expected == level + 1)] = level
        parents = chosen
    sums = rng.uniform(0.5, 2, (PIXELS, 4)).astype(np.float32)
    out = runner(
        "passes/gather_points/point_pixels",
        PIXELS,
        entry="finish",
        pyramid=pyramid_record(VIEW_OF, COARSEST),
        g_normal=g.rows()["g_normal"],
        point_at=at,
        sums=sums,
        irradiance=np.zeros((PIXELS, 4), np.float32),
        level_map=np.zeros(PIXELS, np.uint32),
        reason_map=np.zeros(PIXELS, np.uint32),
    )
    seen = g.kind == SURFACE
    found = read(out, "level_map", np.uint32)
    assert (found == np.where(seen, expected.ravel(), 255)).all()
    assert len(np.unique(found)) == 5
    reasons = read(out, "reason_map", np.uint32)
    assert (reasons == np.where(seen, np.where(found == COARSEST, 0, 3), 255)).all()
    mean = np.where(seen[:, None], sums[:, :3] / sums[:, 3:], 0)
    assert_within(read(out, "irradiance", np.float32, -1, 4)[:, :3], mean, 1e-5, "irradiance")
