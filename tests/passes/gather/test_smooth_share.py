"""`smooth_share`: averages of shares over one surface, as far as chance may have taken a pixel's own."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import cells as ref
from tests.passes.reference import shares
from tests.passes.reference.cells import DARK, LIT, NONE, ZONE, Layout
from tests.passes.reference.lights import single
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.shares import Picture
from tests.passes.reference.structs import LIST, MISS, bits, record, row

STALE = 0.125
ENTRIES = ["pixels", "cells"]
TRUST = 2
"""Standard errors by which a share may change."""

Array = NDArray[np.float64]


@dataclasses.dataclass
class Case:
    """What is seen, the filter's radius at every cell in the order of the tiles, and the listed cells."""

    layout: Layout
    picture: Picture
    radius: NDArray[np.int64]
    cells: NDArray[np.int64]


def _plane(rng: np.random.Generator, layout: Layout, shares_there: Array, error: float = 1.0) -> Case:
    """A tilted plane, all of it in the zone, whose shares are so much in doubt that any average is taken."""
    w, h = layout.width, layout.height
    y, x = np.indices((h, w))
    u, v = rng.normal(size=(2, 3))
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    u -= normal * (u @ normal)
    v -= normal * (v @ normal)
    picture = Picture(
        single(x[..., None] * u + y[..., None] * v),
        single(np.broadcast_to(normal, (h, w, 3)).copy()),
        np.ones((h, w), bool),
        np.full((h, w), ZONE),
        single(shares_there),
        np.full((h, w), error),
    )
    return Case(layout, picture, np.full(len(layout.order), 2), np.flatnonzero(layout.inside))


def _random(rng: np.random.Generator, size: tuple[int, int]) -> Case:
    """Patches raised or turned, holes, cells of every state, errors of all sizes, most of the zone listed."""
    layout = Layout(*size)
    w, h = size
    case = _plane(rng, layout, rng.uniform(size=(h, w, 3)))
    p = case.picture
    y, x = np.indices((h, w)) // 5
    raised = rng.uniform(size=(h, w)) < 0.1
    step = rng.choice([0.0, 0.0, 5.0], (h, w))[y, x]
    p.position[...] = single(p.position + (0.3 * raised + step)[..., None] * p.geometric)
    turned = p.geometric + rng.choice([0.0, 0.0, 0.3, 0.9], (h, w))[y, x, None] * rng.normal(size=(h, w, 3))
    p.geometric[...] = single(turned / np.linalg.norm(turned, axis=2, keepdims=True))
    p.surface[...] = rng.uniform(size=(h, w)) < 0.95
    columns, rows = layout.cells
    state = rng.choice([NONE, LIT, DARK, ZONE, ZONE, ZONE], (rows, columns))
    p.state[...] = state.repeat(2, axis=0).repeat(2, axis=1)[:h, :w]
    p.error[...] = single(rng.choice([0, 0.02, 0.1, 1], (h, w)))
    zone = np.flatnonzero(layout.listed(state) == ZONE)
    radius = rng.integers(0, 3, len(layout.order))
    return Case(layout, p, radius, zone if len(zone) < 30 else zone[rng.uniform(size=len(zone)) < 0.7])


def _run(runner: Runner, case: Case, entry: str, first: int = 0) -> NDArray[np.float32]:
    p, layout = case.picture, case.layout
    w, h = layout.width, layout.height
    plan = ref.PLAN_ZONE + ref.PLAN_SUBS + ref.PLAN_RADIUS * case.radius
    values = np.concatenate([p.share, p.error[..., None]], axis=2).astype(np.float32).reshape(-1, 4)
    more: dict[str, NDArray[Any]] = {"cell_plan": plan.astype(np.uint32)} if entry == "pixels" else {}
    out = runner(
        "passes/gather/smooth_share",
        4 * (len(case.cells) - first),
        entry=entry,
        params=record(LIST, width=w, height=h, first=first),
        g_position=row(p.position.reshape(-1, 3), bits(1e-5)),
        g_geometric=row(p.geometric.reshape(-1, 3), np.where(p.surface, 3, MISS).ravel()),
        listed_cells=case.cells.astype(np.uint32),
        cell_state=p.state[::2, ::2].astype(np.uint32).ravel(),
        share=values,
        smooth_share=np.full((w * h, 4), STALE, np.float32),
        **more,
    )
    return read(out, "smooth_share", np.float32, h, w, 4)


def _average(case: Case, entry: str) -> tuple[Array, NDArray[np.bool_]]:
    """Average at each pixel, and where no neighbour is a case of doubt."""
    h, w = case.picture.surface.shape
    radius = case.layout.image(case.radius).repeat(2, axis=0).repeat(2, axis=1)[:h, :w]
    taps = shares.pixel_taps(radius) if entry == "pixels" else shares.cell_taps((h, w))
    return shares.averaged(case.picture, taps)


@pytest.mark.parametrize("size", [(61, 45), (1, 19), (23, 1)])
@pytest.mark.parametrize("entry", ENTRIES)
def test_averages_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], entry: str
) -> None:
    case = _random(rng, size)
    p = case.picture
    first = 7 if size[0] > 50 else 0
    found = _run(runner, case, entry, first).astype(np.float64)
    average, clear = _average(case, entry)
    reach = (TRUST * p.error)[..., None]
    expected = np.clip(average, p.share - reach, p.share + reach)
    pixels = case.layout.number(case.layout.corners(case.cells[first:])).ravel()
    pixels = pixels[pixels >= 0]
    untouched = np.delete(found.reshape(-1, 4), pixels, axis=0)
    assert (untouched == STALE).all()
    mine = np.zeros(size[0] * size[1], bool)
    mine[pixels] = True
    mine = mine.reshape(clear.shape) & p.surface
    assert clear[mine].mean() > 0.99
    mine &= clear
    assert_within(found[mine, :3], expected[mine], 2e-6, "averages")
    assert_within(found[mine, 3], p.error[mine], 0, "errors")
    if size[0] > 50:
        assert_not_within(found[mine, :3], average[mine], 2e-6)
        assert_not_within(found[mine, :3], p.share[mine], 2e-6)
        moved = np.abs(found[mine, :3] - p.share[mine]).max(axis=1) > 1e-3
        assert 0.2 < moved.mean() < 0.9


@pytest.mark.parametrize("entry", ENTRIES)
def test_a_constant_stays(runner: Runner, rng: np.random.Generator, entry: str) -> None:
    """Whatever lies around: holes, steps, turned surfaces, cells where nothing faces the light."""
    case = _random(rng, (45, 37))
    p = case.picture
    p.state[p.state != ZONE] = NONE
    p.error[...] = 1
    p.share[...] = [0.3, 0.6, 0.9]
    found = _run(runner, case, entry)
    pixels = case.layout.number(case.layout.corners(case.cells)).ravel()
    mine = found.reshape(-1, 4)[pixels[pixels >= 0], :3]
    assert_within(mine, np.broadcast_to([0.3, 0.6, 0.9], mine.shape), 1e-6, "shares")
    p.share[20:, :] += 0.05
    found = _run(runner, case, entry)
    mine = found.reshape(-1, 4)[pixels[pixels >= 0], :3]
    assert_not_within(mine, np.broadcast_to([0.3, 0.6, 0.9], mine.shape), 1e-6)


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("edge", ["step", "fold", "hole"])
def test_nothing_is_taken_from_beyond_an_edge(
    runner: Runner, rng: np.random.Generator, entry: str, edge: str
) -> None:
    """Shares of 0 to the left of an edge of the geometry and of 1 to its right stay exactly so."""
    layout = Layout(40, 24)
    left = (np.arange(40) < 19)[None, :, None] & np.ones((24, 1, 3), bool)
    case = _plane(rng, layout, 1.0 - left)
    p = case.picture
    far = ~left[..., 0]
    if edge == "step":
        p.position[far] = single(p.position[far] + 40 * p.geometric[far])
    elif edge == "fold":
        # the plane to the right is turned about the edge by 45 degrees
        along = p.position[1, 0] - p.position[0, 0]
        along /= np.linalg.norm(along)
        n = p.geometric[0, 0]
        across = np.cross(along, n)
        q = p.position[far] - p.position[0, 19]
        side = np.sign(q[10] @ across)
        tilted = (across * side + n) / np.sqrt(2)
        on_edge = (q @ along)[:, None] * along
        p.position[far] = single(p.position[0, 19] + on_edge + (q @ across * side)[:, None] * tilted)
        p.geometric[far] = single((n - across * side) / np.sqrt(2))
    else:
        p.surface[:, 19:24] = False
        p.share[:, 19:24] = 7
        if entry == "cells":
            p.surface[:, 24:26], p.share[:, 24:26] = False, 7
    found = _run(runner, case, entry)[..., :3]
    rest = p.surface
    assert (found[rest] == p.share[rest]).all()
    without = _plane(rng, layout, 1.0 - left)
    assert not (_run(runner, without, entry)[..., :3][rest] == p.share[rest]).all(), "without it they mix"


@pytest.mark.parametrize(("entry", "radius"), [("pixels", 0), ("pixels", 1), ("pixels", 2), ("cells", 2)])
def test_a_ramp_stays_a_ramp(runner: Runner, rng: np.random.Generator, entry: str, radius: int) -> None:
    """One value a pixel, or one a cell, of which its pixels lie a quarter of a cell off the middle."""
    layout = Layout(52, 38)
    y, x = np.indices((38, 52)) + 0.5
    ramp = (0.1 + 0.008 * x + 0.009 * y)[..., None] * [1, 0.5, 0.25]
    middle_x, middle_y = 2 * np.floor(x / 2) + 1, 2 * np.floor(y / 2) + 1
    steps = (0.1 + 0.008 * middle_x + 0.009 * middle_y)[..., None] * [1, 0.5, 0.25]
    case = _plane(rng, layout, steps if entry == "cells" else ramp)
    case.radius[:] = radius
    found = _run(runner, case, entry)[6:-6, 6:-6, :3]
    assert_within(found, ramp[6:-6, 6:-6], 1e-6, "a ramp")
    assert_not_within(found, steps[6:-6, 6:-6], 1e-6)


@pytest.mark.parametrize(("entry", "radius", "period"), [("pixels", 1, 2), ("pixels", 2, 4), ("cells", 2, 8)])
def test_a_pattern_that_repeats_averages_out(
    runner: Runner, rng: np.random.Generator, entry: str, radius: int, period: int
) -> None:
    """Any pattern of 2 × 2 pixels (4 × 4 pixels, 4 × 4 cells): each of its places weighs the same."""
    layout = Layout(64, 48)
    grain = 2 if entry == "cells" else 1
    pattern = (
        rng.uniform(size=(period // grain, period // grain, 3)).repeat(grain, axis=0).repeat(grain, axis=1)
    )
    case = _plane(rng, layout, np.tile(pattern, (48 // period, 64 // period, 1)))
    case.radius[:] = radius
    found = _run(runner, case, entry)[8:-8, 8:-8, :3]
    mean = np.broadcast_to(pattern.mean(axis=(0, 1)), found.shape)
    assert_within(found, mean, 1e-6, "the mean of the pattern")
    case.picture.share[...] = np.tile(np.repeat(pattern, 2, axis=1), (48 // period, 32 // period, 1))
    assert_not_within(_run(runner, case, entry)[8:-8, 8:-8, :3], mean, 1e-6)


@pytest.mark.parametrize("entry", ENTRIES)
def test_what_is_sure_stays(runner: Runner, rng: np.random.Generator, entry: str) -> None:
    case = _random(rng, (45, 37))
    case.picture.error[...] = 0
    found = _run(runner, case, entry)
    pixels = case.layout.number(case.layout.corners(case.cells)).ravel()
    pixels = pixels[pixels >= 0]
    own = case.picture.share.reshape(-1, 3)[pixels]
    assert (found.reshape(-1, 4)[pixels, :3] == own).all()
    case.picture.error[...] = 0.01
    found = _run(runner, case, entry)
    assert_within(found.reshape(-1, 4)[pixels, :3], own, 0.02 + 1e-6, "two standard errors")
    assert_not_within(found.reshape(-1, 4)[pixels, :3], own, 0.019)
