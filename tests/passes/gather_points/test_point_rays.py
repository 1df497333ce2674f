"""`point_rays`: the places that gather, and their stratified cosine-weighted rays [WRC88]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import gather_points as gp
from tests.passes.reference.gbuffers import GBuffer, random_gbuffer
from tests.passes.reference.hashing import random4
from tests.passes.reference.hemisphere import concentric, cosine_directions
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER_PATH, GATHER_WAVE, MISS, RAY, VIEW, record

WIDTH, HEIGHT = 45, 30
VIEW_OF = record(VIEW, width=WIDTH, height=HEIGHT, fx=60.0, fy=60.0)
GRID = (4, 3)
FIRST, SEED = 5, 3


@dataclasses.dataclass
class Case:
    """Blocks of a level that gather, and the pixel that each one's mark names."""

    level: int
    g: GBuffer
    marks: NDArray[np.uint32]
    blocks: NDArray[np.uint32]
    pixels: NDArray[np.int64]


def _case(rng: np.random.Generator, level: int) -> Case:
    columns, _, _, count = sizes(WIDTH, HEIGHT)[level]
    g = random_gbuffer(rng, WIDTH * HEIGHT, surfaces=2.0)
    blocks = np.flatnonzero(rng.uniform(size=count) < 0.6)
    row, column = np.divmod(blocks, columns)
    side = 2**level
    x, y = (rng.integers(0, side, len(blocks)) for _ in range(2))
    x, y = np.minimum(x, WIDTH - 1 - side * column), np.minimum(y, HEIGHT - 1 - side * row)
    far = (2 * x + 1 - side) ** 2 + (2 * y + 1 - side) ** 2
    key = far * side**2 + y * side + x
    marks = np.zeros(count, np.uint32)
    marks[blocks] = gp.MARKED | (0x7FFFFFFF - key)
    pixels = (side * row + y) * WIDTH + side * column + x
    return Case(level, g, marks, blocks.astype(np.uint32), pixels)


def _common(case: Case) -> dict[str, Any]:
    return {
        "pyramid": pyramid_record(VIEW_OF, 4, level=case.level),
        "params": gp.params(first=FIRST, count=len(case.blocks)),
        "blocks": case.blocks,
        "marks": case.marks,
    }


@pytest.mark.parametrize("level", [0, 1, 3])
def test_points_are_where_their_marks_say(runner: Runner, rng: np.random.Generator, level: int) -> None:
    case = _case(rng, level)
    _, _, first, count = sizes(WIDTH, HEIGHT)[level]
    rows = case.g.rows()
    out = runner(
        "passes/gather_points/point_rays",
        len(case.blocks),
        entry="begin",
        g_position=rows["g_position"],
        g_normal=rows["g_normal"],
        points=np.full(FIRST + len(case.blocks), 7, gp.GATHER_POINT),
        point_at=np.zeros(first + count, np.uint32),
        **_common(case),
    )
    points = read(out, "points", gp.GATHER_POINT)
    at = read(out, "point_at", np.uint32)
    assert (points["position"][FIRST:] == case.g.position[case.pixels]).all()
    assert (points["normal"][FIRST:] == case.g.normal[case.pixels]).all()
    assert (points["level"][FIRST:] == level).all()
    assert (points["inverse"][FIRST:] == 0).all()
    assert (points["met"][FIRST:] == 0).all()
    assert all((points[name][FIRST:] == 0).all() for name in (*gp.CHANNELS, "red_slope", "blue_slope"))
    assert (points["level"][:FIRST] == 7).all()
    assert (at[first + case.blocks] == FIRST + 1 + np.arange(len(case.blocks))).all()
    assert np.count_nonzero(at) == len(case.blocks)


@pytest.mark.parametrize("level", [0, 2])
def test_rays_agree_with_the_reference(runner: Runner, rng: np.random.Generator, level: int) -> None:
    case = _case(rng, level)
    tiles = -(-len(case.blocks) // 64)
    shape = (tiles, GRID[0] * GRID[1], 64)
    wave = record(
        GATHER_WAVE, strata_u=GRID[0], strata_v=GRID[1], tiles=tiles, strata=GRID[0] * GRID[1], seed=SEED
    )
    out = runner(
        "passes/gather_points/point_rays",
        int(np.prod(shape)),
        wave=wave,
        rays=np.zeros(shape, RAY),
        paths=np.zeros(shape, GATHER_PATH),
        **case.g.rows(),
        **_common(case),
    )
    rays, paths = read(out, "rays", RAY, *shape), read(out, "paths", GATHER_PATH, *shape)
    number = np.broadcast_to(64 * np.arange(tiles)[:, None, None] + np.arange(64), shape)
    there = number < len(case.blocks)
    assert (paths["pixel"][~there] == MISS).all()
    assert (rays["t_max"][~there] < rays["t_min"][~there]).all()
    assert (paths["pixel"][there] == FIRST + number[there]).all()
    k = np.broadcast_to(np.arange(shape[1])[:, None], shape)[there]
    pixel = case.pixels[number[there]]
    square = (
        np.stack([k % GRID[0], k // GRID[0]], axis=-1) + random4(FIRST + number[there], k, 0, SEED)[:, :2]
    )
    square /= np.array(GRID)
    expected = cosine_directions(case.g.normal[pixel], square)
    above = (expected * case.g.geometric[pixel]).sum(axis=1)
    up = above > 1e-5
    made = rays[there]
    height = np.sqrt(np.clip(1 - (concentric(square) ** 2).sum(axis=1), 0, None))
    bound = (1e-6 + 4e-7 / np.maximum(height, 4e-4))[:, None]
    assert_within(made["direction"][up], expected[up], bound[up], "directions")
    assert_not_within(made["direction"][up], expected[np.roll(np.flatnonzero(up), 1)], bound[up])
    origin = case.g.origin[pixel]
    assert_within(made["origin"][up], origin[up], 2 * ULP * np.abs(origin[up]), "origins")
    worth = np.pi / (GRID[0] * GRID[1])
    assert_within(paths["throughput"][there][up], np.full((up.sum(), 3), worth), 2 * ULP * worth, "worth")
    down = above < -1e-5
    assert (made["t_max"][down] < made["t_min"][down]).all()
    assert (paths["throughput"][there][down] == 0).all()
