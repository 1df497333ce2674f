"""`zone_rays`: pixels of penumbrae ask strata of those blocks on which their neighbourhood disagrees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import cells as ref
from tests.passes.reference import strata
from tests.passes.reference.cells import Layout
from tests.passes.reference.gbuffers import GBuffer, tiled_gbuffer
from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIST, MISS, RECEIVER, SURFACE, record

SEED, PATTERNS = 3, 7
Bits = NDArray[np.bool_]


def _answers(sure: Bits) -> Bits:
    """To what cells agree; of the blocks that are not sure: one answer is enough."""
    return np.random.default_rng(1).uniform(size=sure.shape) < 0.5


def _run(
    runner: Runner,
    layout: Layout,
    g: GBuffer,
    cells: NDArray[np.int64],
    sure: Bits,
    subs: NDArray[np.int64],
    first: int = 0,
    answer: Bits | None = None,
    brightness: NDArray[np.int64] | None = None,
) -> tuple[NDArray[Any], Bits]:
    """Receivers, and what they ask: (n, block, stratum)."""
    count = 4 * (len(cells) - first)
    answer = _answers(sure) if answer is None else answer
    radius = np.arange(len(subs)) % 3
    plan = ref.PLAN_ZONE + ref.PLAN_TRACED + ref.PLAN_SUBS * subs + ref.PLAN_RADIUS * radius
    out = runner(
        "passes/refine/zone_rays",
        count,
        params=record(
            LIST,
            width=layout.width,
            height=layout.height,
            patterns=PATTERNS,
            seed=SEED,
            first=first,
            boosts=strata.boosts(1 if brightness is None else brightness),
        ),
        traced_cells=cells.astype(np.uint32),
        cell_agreed=ref.pack(sure, answer),
        cell_plan=plan.astype(np.uint32),
        receivers=np.zeros(count, RECEIVER),
        asked=np.full((count, strata.WORDS), 0xABCDEF01, np.uint32),
        **g.rows(),
    )
    asked = read(out, "asked", np.uint32, count, strata.WORDS)
    return read(out, "receivers", RECEIVER), strata.blocks(asked)


def _case(
    rng: np.random.Generator, layout: Layout
) -> tuple[GBuffer, NDArray[np.int64], Bits, NDArray[np.int64]]:
    count = len(layout.order)
    inside = np.flatnonzero(layout.inside)
    cells = inside if len(inside) < 50 else inside[rng.uniform(size=len(inside)) < 0.4]
    sure = rng.uniform(size=(count, 16)) < rng.choice([0.0, 0.5, 1.0], (count, 1))
    g = tiled_gbuffer(rng, layout.width, layout.height, surfaces=0.8)
    return g, cells, sure, rng.choice([1, 4, 16], count)


@pytest.mark.parametrize(("size", "first"), [((77, 45), 0), ((77, 45), 50), ((1, 19), 0), ((23, 1), 2)])
def test_receivers_and_questions_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], first: int
) -> None:
    layout = Layout(*size)
    g, cells, sure, subs = _case(rng, layout)
    bright = rng.integers(0, 3, 16)
    found, asked = _run(runner, layout, g, cells, sure, subs, first, brightness=bright)
    mine = np.repeat(cells[first:], 4)
    pixels = layout.corners(cells[first:]).reshape(-1, 2)
    at = layout.number(pixels)
    live = (at >= 0) & (g.kind[at] == SURFACE)
    at = at[live]
    assert ((found["pattern"] != MISS) == live).all()
    assert (found["pixel"][live] == at).all()
    assert (found["pattern"][live] == pcg4d(*pixels[live].T, SEED, 1)[:, 0] % PATTERNS).all()
    assert_within(found["origin"][live], g.origin[at], 2 * ULP * np.abs(g.origin[at]), "origins")
    if len(at) > 9:
        assert_not_within(found["origin"][live], g.position[at], 2 * ULP * np.abs(g.origin[at]))
    assert (found["normal_geo"][live] == g.geometric[at]).all()
    assert (found["normal_shade"][live] == g.normal[at]).all()
    once = _answers(sure)[mine]
    expected = strata.by_plan(pixels, subs[mine], sure[mine], once, bright)
    assert (asked == expected)[live].all()
    assert size[0] < 50 or not (asked == np.roll(expected, 1, axis=1))[live].all()
    _, plain = _run(runner, layout, g, cells, sure, subs, first)
    counts = np.where(sure[mine], 0, np.where(once, 1, subs[mine][:, None]))
    assert (plain.sum(axis=2) == counts)[live].all()
    more, less = (asked.sum(axis=2)[live][:, bright == b] for b in (2, 0))
    before, after = (counts[live][:, bright == b] for b in (2, 0))
    assert (more == np.minimum(4 * before, 16)).all()
    assert (less == np.minimum(np.maximum(after // 4, 1), after)).all()


@pytest.mark.parametrize("subs", [1, 4])
def test_neighbours_together_ask_every_stratum(runner: Runner, rng: np.random.Generator, subs: int) -> None:
    """Any 4 × 4 pixels that ask one a block, any 2 × 2 that ask four, across cells and tiles."""
    layout = Layout(24, 16)
    count = len(layout.order)
    g = tiled_gbuffer(rng, 24, 16, surfaces=2.0)
    nothing = np.zeros((count, 16), bool)
    found, asked = _run(runner, layout, g, np.arange(count), nothing, np.full(count, subs), answer=nothing)
    image = np.zeros((24 * 16, 16, 16), bool)
    image[found["pixel"]] = asked
    side = 4 if subs == 1 else 2
    for across, complete in ((side, True), (side - 1, False)):
        windows = np.lib.stride_tricks.sliding_window_view(
            image.reshape(16, 24, 16, 16), (side, across), axis=(0, 1)
        )
        assert windows.any(axis=(-1, -2)).all() == complete


def test_what_is_agreed_on_is_not_asked_again(runner: Runner, rng: np.random.Generator) -> None:
    layout = Layout(24, 16)
    g, cells, sure, subs = _case(rng, layout)
    _, asked = _run(runner, layout, g, cells, np.ones_like(sure), subs)
    assert not asked.any()
    _, asked = _run(runner, layout, g, cells, sure, subs)
    assert asked.any()
