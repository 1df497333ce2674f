"""`zone`: where a cell and its neighbours agree about a light there is no shadow's edge."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import cells as ref
from tests.passes.reference import light_frames as frames
from tests.passes.reference import strata
from tests.passes.reference.cells import DARK, LIT, NONE, ZONE, Layout
from tests.passes.reference.lights import single
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import LIST, record

SIZES = [(93, 61), (1, 21), (27, 1), (2, 2), (64, 16)]
Bits = NDArray[np.bool_]
UNTOUCHED = 77


@dataclasses.dataclass
class Case:
    """Flags of the tiles, what the cells of the open ones see and where they lie; in the order of the tiles.

    Of the other tiles the surfaces are what the last light left there.
    """

    layout: Layout
    flags: NDArray[np.uint32]
    seen: Bits
    asked: Bits
    surfaces: ref.Surfaces

    @property
    def open(self) -> Bits:
        """Cells of open tiles."""
        return np.repeat(self.flags & (frames.FACING | frames.LIT | frames.DARK) == frames.FACING, 16)

    def expected(self, across: int, missing: int = 0) -> ref.Votes:
        """What follows from it, or would if so many cells fewer were on one surface."""
        flags = np.repeat(self.flags, 16)
        proven = np.where(flags & frames.LIT, LIT, np.where(flags & frames.DARK, DARK, NONE))
        surfaces = ref.Surfaces(*(self.layout.image(a) for a in vars(self.surfaces).values()))
        alike = surfaces.alike(self.layout.image(self.open), self.layout.image(proven != NONE)) - missing
        given = (self.seen, self.asked, flags & frames.FACING != 0, proven)
        seen, asked, facing, proven = (self.layout.image(a) for a in given)
        return ref.zone(seen, asked, facing, proven, alike, across)


def _surfaces(rng: np.random.Generator, layout: Layout, kinks: float, whole: float) -> ref.Surfaces:
    """A plane that some tiles have left; cells that look another way, and that hold several surfaces."""
    count = len(layout.order) // 16
    normal = np.array([0.6, 0, 0.8])
    position = layout.order @ np.array([(0.8, 0, -0.6), (0, 1, 0)])
    position += np.repeat(rng.uniform(size=count) < kinks, 16)[:, None] * normal * 3
    normal = np.where((rng.uniform(size=(16 * count, 1)) < kinks / 4), [0, 0, -1], normal)
    return ref.Surfaces(single(position), single(normal), rng.uniform(size=16 * count) < whole)


def _case(rng: np.random.Generator, size: tuple[int, int]) -> Case:
    """Tiles of every kind; the open ones see all, nothing, the same part everywhere, or anything."""
    layout = Layout(*size)
    count = layout.tiles[0] * layout.tiles[1]
    kinds = [0, frames.FACING, frames.FACING, frames.FACING | frames.LIT, frames.FACING | frames.DARK]
    flags = rng.choice(kinds, count) | rng.choice([2, 4, 8, 16, 32, 64], count)
    share = rng.choice([0.0, 1.0, -1.0, 0.5, 0.95], count)
    # the same part of the light in all tiles, but for a strip of cells here and there
    part = rng.uniform(size=16) < 0.5
    seen = rng.uniform(size=(count, 16, 16)) < np.abs(share)[:, None, None]
    seen[share < 0] = part
    asked = rng.uniform(size=seen.shape) < rng.choice([1.0, 0.6], count)[:, None, None]
    asked &= rng.uniform(size=(count, 16, 1)) < 0.95
    asked = asked.reshape(-1, 16) & layout.inside[:, None]
    surfaces = _surfaces(rng, layout, 0.3, 0.95)
    away = ~asked & (rng.uniform(size=asked.shape) < 0.3)
    return Case(layout, flags.astype(np.uint32), (seen.reshape(-1, 16) & asked) | away, asked, surfaces)


def _run(runner: Runner, case: Case, across: int, reuse: int = 2) -> dict[str, NDArray[Any]]:
    """The three outputs in image order; what closed tiles' cells said last is left in their bits.

    By default of a light that is not alone.
    """
    layout = case.layout
    stale = np.random.default_rng(7).integers(0, 1 << 32, len(case.open))
    bits = np.where(case.open, ref.pack(case.seen, case.asked), stale).astype(np.uint32)
    count = len(bits)
    across_image, down_image = layout.cells
    out = runner(
        "passes/refine/zone",
        count,
        params=record(
            LIST,
            width=layout.width,
            height=layout.height,
            blocks_u=across,
            reuse=reuse,
            boosts=strata.boosts(1),
        ),
        tile_flags=case.flags,
        cell_bits=bits,
        cell_surface=case.surfaces.rows(),
        cell_state=np.full(across_image * down_image, UNTOUCHED, np.uint32),
        cell_agreed=np.full(count, UNTOUCHED, np.uint32),
        cell_plan=np.full(count, UNTOUCHED, np.uint32),
    )
    plan = read(out, "cell_plan", np.uint32)
    assert (plan[~layout.inside] == 0).all(), "what lies outside is in no zone"
    return {
        "state": read(out, "cell_state", np.uint32, down_image, across_image),
        "agreed": layout.image(read(out, "cell_agreed", np.uint32)),
        "plan": layout.image(plan),
    }


def _check(found: dict[str, NDArray[Any]], expected: ref.Votes) -> None:
    assert (found["state"] == expected.state).all()
    plan = ref.PLAN_ZONE + ref.PLAN_CALM * expected.calm
    assert (found["plan"] == np.where(expected.state == ZONE, plan, 0)).all()
    sure, answer = ref.unpack(found["agreed"])
    mine = expected.state == ZONE
    assert (sure[mine] == expected.sure[mine]).all()
    assert (answer[mine] == expected.answer[mine]).all()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("across", [1, 2, 4, 8, 16])
def test_states_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], across: int
) -> None:
    case = _case(rng, size)
    found, expected = _run(runner, case, across), case.expected(across)
    _check(found, expected)
    if size[0] < 60:
        return
    shares = np.bincount(expected.state.ravel(), minlength=4) / expected.state.size
    assert (shares > 0.02).all()
    assert 0.01 < expected.sure[expected.state == ZONE].mean() < 0.99
    with pytest.raises(AssertionError):
        _check(found, case.expected(across, missing=2))
    alone = _run(runner, case, across, reuse=1)
    zone = expected.state == ZONE
    sure, answer = ref.unpack(alone["agreed"])
    assert (sure[zone] == expected.sure[zone]).all()
    assert (answer[zone] == (expected.answer & expected.sure)[zone]).all(), (
        "blocks beside are asked as others"
    )
    fresh = _run(runner, case, across, reuse=0)
    assert (fresh["state"] == found["state"]).all()
    assert not fresh["agreed"].any(), "nothing is taken over where that is not wanted"
    assert (fresh["plan"] == np.where(expected.state == ZONE, ref.PLAN_ZONE, 0)).all()


def _open(layout: Layout, seen: Bits, asked: Bits | None = None) -> Case:
    """Open tiles everywhere, from what cells see in image order."""
    flags = np.full(layout.tiles[0] * layout.tiles[1], frames.FACING, np.uint32)
    asked = np.ones(seen.shape, bool) if asked is None else asked
    surfaces = _surfaces(np.random.default_rng(0), layout, 0, 2)
    return Case(layout, flags, layout.listed(seen & asked), layout.listed(asked), surfaces)


@pytest.mark.parametrize("across", [1, 4, 16])
def test_a_straight_edge_makes_a_zone_two_cells_wide(runner: Runner, across: int) -> None:
    layout = Layout(47, 31)
    columns, rows = layout.cells
    seen = np.zeros((rows, columns, 16), bool)
    seen[:, :9] = True
    found = _run(runner, _open(layout, seen), across)
    expected = np.full((rows, columns), DARK)
    expected[:, :8], expected[:, 8:10] = LIT, ZONE
    assert (found["state"] == expected).all()
    sure, answer = ref.unpack(found["agreed"])
    assert not sure[:, 8:10].any(), "there nobody agrees about anything"
    # a cell at a corner of the image has too few neighbours
    sure[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    assert sure[:, :8].all()
    assert answer[1:-1, :8].all()
    assert sure[:, 10:].all()
    assert not answer[:, 10:].any()


@pytest.mark.parametrize("across", [1, 2, 4, 8, 16])
def test_a_block_without_agreement_takes_the_blocks_beside_it_along(runner: Runner, across: int) -> None:
    """One block that half of the image sees; all others are seen by all."""
    layout = Layout(40, 16)
    columns, rows = layout.cells
    down = 16 // across
    for block in range(16):
        seen = np.ones((rows, columns, 16), bool)
        seen[:, 10:, block] = False
        sure, answer = ref.unpack(_run(runner, _open(layout, seen), across)["agreed"])
        v, u = np.divmod(np.arange(16), across)
        beside = np.abs(u - block % across) + np.abs(v - block // across) <= 1
        assert beside.sum() <= 5
        assert beside.sum() >= (2 if 1 in (across, down) else 3)
        assert (sure[:, 9:11] == ~beside).all()
        assert sure[1:-1, :9].all()
        others = np.arange(16) != block
        assert (answer[1:-1] == others)[:, 9:].all(), "seen, or of those beside it: agreed on"


def test_what_is_half_seen_everywhere_is_zone_but_agreed_on(runner: Runner) -> None:
    layout = Layout(24, 24)
    part = np.isin(np.arange(16) % 4, (0, 1))
    found = _run(runner, _open(layout, np.broadcast_to(part, (12, 12, 16)).copy()), 4)
    assert (found["state"] == ZONE).all()
    sure, answer = ref.unpack(found["agreed"])
    sure[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    assert sure.all()
    assert (answer[1:-1] == part).all()


@pytest.mark.parametrize(("blocks", "calm"), [(1, True), (3, True), (4, False)])
def test_a_cell_with_few_blocks_in_doubt_is_calm(runner: Runner, blocks: int, calm: bool) -> None:
    """Where the surface goes on all around, not at the edge of the image."""
    layout = Layout(40, 24)
    seen = np.ones((12, 20, 16), bool)
    seen[:, 10:, :blocks] = False
    plan = _run(runner, _open(layout, seen), 4)["plan"]
    assert (plan[1:-1, 9:11] == ref.PLAN_ZONE + ref.PLAN_CALM * calm).all()
    assert (plan[[0, -1], 9:11] == ref.PLAN_ZONE).all()


def test_cells_of_another_surface_agree_about_nothing(runner: Runner) -> None:
    """Half of the light is seen everywhere; one column of cells stands out, another holds two surfaces."""
    layout = Layout(40, 24)
    case = _open(layout, np.broadcast_to(np.arange(16) < 8, (12, 20, 16)).copy())
    columns = layout.order[:, 0]
    case.surfaces.position[columns == 6] += single(3 * case.surfaces.normal[0])
    case.surfaces.one[columns == 14] = False
    sure, _ = ref.unpack(_run(runner, case, 4)["agreed"])
    # for those beside them, three of nine that lie elsewhere are few enough
    assert (sure[1:-1] == ~np.isin(np.arange(20), (6, 14))[:, None]).all()
    flat = dataclasses.replace(case, surfaces=_surfaces(np.random.default_rng(0), layout, 0, 2))
    assert not (ref.unpack(_run(runner, flat, 4)["agreed"])[0] == sure).all()


def test_proofs_count_as_answers_of_neighbours(runner: Runner) -> None:
    """A dark tile between lit ones, and an open tile that sees all: the zone lies in the open tile alone."""
    layout = Layout(24, 8)
    flags = np.array([frames.LIT | 1, 1, frames.DARK | 1], np.uint32)
    all_of_it = np.ones((48, 16), bool)
    surfaces = _surfaces(np.random.default_rng(0), layout, 0, -1)
    found = _run(runner, Case(layout, flags, all_of_it, all_of_it, surfaces), 4)["state"]
    expected = np.repeat([LIT, DARK], [8, 4])
    expected[7] = ZONE
    assert (found == expected).all()
    assert not (found == np.repeat([LIT, DARK], [8, 4])).all()


@pytest.mark.parametrize("size", SIZES)
def test_of_a_spot_each_pixel_has_its_own_answer(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    layout = Layout(*size)
    count = layout.tiles[0] * layout.tiles[1]
    kinds = [0, frames.FACING, frames.FACING, frames.FACING | frames.LIT, frames.FACING | frames.DARK]
    flags = rng.choice(kinds, count).astype(np.uint32)
    cells = np.arange(16 * count)
    at = layout.number(layout.corners(cells))
    awake = (at >= 0) & (rng.uniform(size=at.shape) < rng.choice([0.3, 1.0], (len(at), 1)))
    seen = awake & (rng.uniform(size=at.shape) < rng.choice([0.0, 0.5, 1.0], (len(at), 1)))
    closed = np.repeat(flags & (frames.FACING | frames.LIT | frames.DARK) != frames.FACING, 16)
    blank = np.zeros((len(cells), 12), bool)
    bits = ref.pack(*(np.concatenate([a, blank], axis=1) for a in (seen, awake)))
    bits[closed] = rng.integers(0, 1 << 32, closed.sum())
    columns, rows = layout.cells
    out = runner(
        "passes/refine/zone",
        len(cells),
        entry="spot",
        params=record(LIST, width=size[0], height=size[1], blocks_u=1),
        tile_flags=flags,
        cell_bits=bits,
        cell_state=np.full(columns * rows, UNTOUCHED, np.uint32),
        share=np.full((size[0] * size[1], 4), 0.25, np.float32),
    )
    flags = np.repeat(flags, 16)
    state = np.where(seen.any(axis=1), np.where((seen == awake).all(axis=1), LIT, ZONE), DARK)
    state[~awake.any(axis=1)] = NONE
    state = np.where(flags & frames.LIT, LIT, np.where(flags & frames.DARK, DARK, state))
    state[flags & frames.FACING == 0] = NONE
    found = read(out, "cell_state", np.uint32, rows, columns)
    assert (found == layout.image(state)).all()
    share = np.full(size[0] * size[1], 0.25)
    mine = (at >= 0) & (state == ZONE)[:, None]
    share[at[mine]] = seen[mine]
    assert (read(out, "share", np.float32, -1, 4)[:, :3] == share[:, None]).all()
    if size[0] > 60:
        assert (np.bincount(state, minlength=4) > 20).all()
        assert not (found == layout.image(np.where(state == ZONE, LIT, state))).all()
