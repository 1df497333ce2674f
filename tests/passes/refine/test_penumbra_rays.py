"""`penumbra_rays`: one ray a cell of the zone, towards a place of the light that it does not see."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import strata
from tests.passes.reference.cells import Layout, pack
from tests.passes.reference.gbuffers import GBuffer, tiled_gbuffer
from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIST, RAY, record

SEED, PATTERNS = 5, 9


@dataclasses.dataclass
class Case:
    """Cells of the zone, what each of all cells sees and asked, and points of the light."""

    layout: Layout
    g: GBuffer
    zone: NDArray[np.int64]
    seen: NDArray[np.bool_]
    asked: NDArray[np.bool_]
    points: NDArray[np.float32]


def _case(rng: np.random.Generator, size: tuple[int, int]) -> Case:
    """A third of the cells is in the zone; some of those see all that they asked."""
    layout = Layout(*size)
    count = len(layout.order)
    inside = np.flatnonzero(layout.inside)
    zone = inside if len(inside) < 50 else inside[rng.uniform(size=len(inside)) < 0.3]
    awake = (layout.number(layout.corners(np.arange(count))) >= 0) & (rng.uniform(size=(count, 4)) < 0.8)
    asked = awake[:, strata.asker(np.arange(16))]
    seen = asked & (rng.uniform(size=(count, 16)) < rng.choice([0.0, 0.3, 0.9, 1.0], (count, 1)))
    points = np.concatenate(
        [rng.normal(size=(PATTERNS * strata.STRATA, 3)), np.full((PATTERNS * strata.STRATA, 1), 0.9999)],
        axis=1,
    )
    return Case(layout, tiled_gbuffer(rng, *size), zone, seen, asked, points.astype(np.float32))


def _run(runner: Runner, case: Case, first: int = 0) -> NDArray[Any]:
    count = len(case.zone) - first
    size = {"width": case.layout.width, "height": case.layout.height}
    out = runner(
        "passes/refine/penumbra_rays",
        count,
        params=record(LIST, **size, patterns=PATTERNS, seed=SEED, first=first, blocks_u=4),
        zone_cells=case.zone.astype(np.uint32),
        cell_bits=pack(case.seen, case.asked),
        light_points=case.points,
        rays=np.zeros(count, RAY),
        **case.g.rows(),
    )
    return read(out, "rays", RAY)


def _expected(case: Case) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
    """Which cells ask, from which pixel, and for which point of the list.

    The first hidden block from the one on that the cell's place says, after the last the first.
    """
    cells = case.layout.order[case.zone]
    hidden = np.logical_and(case.asked, ~case.seen)[case.zone]
    turned = (strata.single(cells, 0)[:, None] + np.arange(16)) % 16
    first = np.take_along_axis(hidden, turned, axis=1).argmax(axis=1)
    block = turned[np.arange(len(cells)), first]
    pixel = case.layout.corners(case.zone)[np.arange(len(cells)), strata.asker(block)]
    pattern = pcg4d(*pixel.T, SEED, 1)[:, 0].astype(np.int64) % PATTERNS
    which = np.array([strata.single(c, b) for c, b in zip(cells, block, strict=True)], int)
    return np.any(hidden, axis=1), case.layout.number(pixel), pattern * strata.STRATA + 16 * block + which


@pytest.mark.parametrize("size", [(77, 45), (1, 19), (23, 1)])
def test_rays_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    case = _case(rng, size)
    rays = _run(runner, case)
    asks, at, which = _expected(case)
    assert ((rays["t_max"] > rays["t_min"]) == asks).all()
    assert size[0] < 50 or 0.5 < asks.mean() < 0.9
    origin, point = case.g.origin[at[asks]], case.points[which[asks]].astype(np.float64)
    bound = 4 * ULP * (np.abs(origin) + np.abs(point[:, :3]))
    assert_within(rays["origin"][asks], origin, bound, "origins")
    assert_within(rays["direction"][asks], point[:, :3] - origin, bound, "to the point where t is 1")
    assert (rays["t_min"] == np.where(asks, 0, rays["t_min"])).all()
    assert (rays["t_max"][asks] == point[:, 3]).all()
    assert_not_within(rays["direction"][asks], case.points[which[asks] ^ 1, :3] - origin, bound)


def test_each_ray_goes_to_a_place_that_was_asked_and_is_hidden(
    runner: Runner, rng: np.random.Generator
) -> None:
    """From the rays alone: which stratum they meet, and who asked for its block."""
    case = _case(rng, (61, 43))
    rays = _run(runner, case)
    live = rays["t_max"] > rays["t_min"]
    ends = (rays["origin"].astype(np.float64) + rays["direction"])[live]
    zone = case.zone[live]
    point = np.array([np.abs(case.points[:, :3] - e).sum(axis=1).argmin() for e in ends])
    block = point % strata.STRATA // 16
    assert (case.asked & ~case.seen)[zone, block].all()
    assert not case.seen[zone, block].any()
    assert (point % 16 == strata.single(case.layout.order[zone], block)).all(), "the one that the cell asked"
    assert len(np.unique(block)) == 16, "not always the same block"


def test_a_piece_of_the_list_is_a_part_of_the_whole(runner: Runner, rng: np.random.Generator) -> None:
    case = _case(rng, (77, 45))
    whole, part = _run(runner, case), _run(runner, case, 33)
    assert (whole[33:] == part).all()
    assert not (whole[: len(part)] == part).all()
