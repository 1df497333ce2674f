"""`uniform_levels`: the largest block around each pixel that every light sees alike."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.cells import DARK, LIT, NONE, PLAN_TRACED, PLAN_ZONE, ZONE, Layout
from tests.passes.reference.light_frames import BEHIND_LIGHT, FACED, FACING_AWAY
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import FIRST_LIGHT, NOTHING, SURFACE, UNIFORM_LEVELS, record, row

STEM = "passes/refine/uniform_levels"
BATCH = 15
"""Lights whose states are looked at together."""
CULLED, UNSEEN = 254, 255
WHY_COARSEST, WHY_VISIBILITY, WHY_EMITTER, WHY_AWAY, WHY_BEHIND = 0, 4, 6, 7, 8

Whole = NDArray[np.int64]
Bits = NDArray[np.bool_]


@dataclasses.dataclass
class Light:
    """States of the cells and which ask for themselves, in image order; or all cells of the zone do."""

    state: Whole
    traced: Bits
    own_pixels: bool = False


@dataclasses.dataclass
class Case:
    """Lights, and at each pixel what is there and what any light does to it."""

    layout: Layout
    lights: list[Light]
    kind: Whole
    bits: Whole
    coarsest: int


def _light(rng: np.random.Generator, layout: Layout, own_pixels: bool = False) -> Light:
    """Lit, with a few rectangles that are dark and zones here and there."""
    columns, rows = layout.cells
    state = np.full((rows, columns), LIT)
    for value in rng.choice([DARK, DARK, NONE, ZONE], 6):
        x, y = rng.integers(0, columns), rng.integers(0, rows)
        state[y : y + rng.integers(1, 9), x : x + rng.integers(1, 9)] = value
    return Light(state, rng.uniform(size=state.shape) < 0.5, own_pixels)


def _case(rng: np.random.Generator, size: tuple[int, int], lights: int, coarsest: int) -> Case:
    layout = Layout(*size)
    listed = [_light(rng, layout, bool(k % 3 == 2)) for k in range(lights)]
    shape = size[::-1]
    kind = rng.choice([SURFACE, SURFACE, SURFACE, NOTHING, FIRST_LIGHT, FIRST_LIGHT + 2], shape)
    some = [FACED, FACED | FACING_AWAY, FACED | BEHIND_LIGHT, FACING_AWAY, BEHIND_LIGHT]
    return Case(layout, listed, kind, rng.choice([*some, FACING_AWAY | BEHIND_LIGHT], shape), coarsest)


def _params(case: Case, **more: Any) -> NDArray[Any]:
    values = {"width": case.layout.width, "height": case.layout.height, "coarsest": case.coarsest}
    return record(UNIFORM_LEVELS, **values, **more)


def _words(runner: Runner, case: Case, lights: list[Light]) -> NDArray[np.uint32]:
    """The words of all cells, after lights have been added one by one."""
    layout = case.layout
    words = np.zeros(len(layout.order), np.uint32)
    for slot, light in enumerate(lights):
        plan = PLAN_ZONE + PLAN_TRACED * layout.listed(light.traced)
        # what lies outside has whatever plan
        plan = np.where(layout.inside, plan, 0xFFFFFFFF)
        out = runner(
            STEM,
            len(words),
            entry="add",
            params=_params(case, slot=slot, own_pixels=light.own_pixels),
            cell_state=light.state.astype(np.uint32).ravel(),
            cell_plan=plan.astype(np.uint32),
            cell_word=words,
        )
        words = read(out, "cell_word", np.uint32)
        assert (words[~layout.inside] == 0).all()
    return words


def _run(runner: Runner, case: Case, first_bits: Whole | None = None) -> tuple[Whole, Whole]:
    """Levels and reasons, after batches of lights; `first_bits`: what is known of pixels before the last."""
    layout = case.layout
    pixels = layout.width * layout.height
    tiles = layout.tiles[0] * layout.tiles[1]
    maps = {name: np.full(pixels, 77, np.uint32) for name in ("level_map", "reason_map")}
    for first in range(0, len(case.lights), BATCH):
        words = _words(runner, case, case.lights[first : first + BATCH])
        last = first + BATCH >= len(case.lights)
        blank = np.full(tiles, 99, np.uint32)
        out = runner(STEM, tiles, entry="tiles", cell_word=words, tile_word=blank)
        tile_word = read(out, "tile_word", np.uint32)
        out = runner(STEM, tiles, entry="tops", params=_params(case), tile_word=tile_word, tile_level=blank)
        bits = case.bits if last or first_bits is None else first_bits
        out = runner(
            STEM,
            pixels,
            entry="map",
            params=_params(case, again=first > 0, last=last),
            cell_word=words,
            tile_level=read(out, "tile_level", np.uint32),
            g_normal=row(np.zeros((pixels, 3)), case.kind.ravel()),
            pixel_lights=bits.astype(np.uint32).ravel(),
            **maps,
        )
        maps = {name: read(out, name, np.uint32) for name in maps}
    level, reason = (maps[name].reshape(layout.height, layout.width) for name in maps)
    return level.astype(np.int64), reason.astype(np.int64)


def _levels(case: Case) -> Whole:
    """Level of each pixel by trying blocks of all sizes from the largest on.

    A block is uniform when no light has something lit and something dark in it, a penumbra being both, and no
    pixel of it asks for itself. Cells are no larger blocks' business: only those that ask are split.
    """
    h, w = case.layout.height, case.layout.width

    def pixels(cells: NDArray[Any]) -> NDArray[Any]:
        return cells.repeat(2, axis=0).repeat(2, axis=1)[:h, :w]

    own = np.any([(a.state == ZONE) & (a.traced | a.own_pixels) for a in case.lights], axis=0)
    lit = [pixels((a.state == LIT) | (a.state == ZONE)) for a in case.lights]
    dark = [pixels((a.state == DARK) | (a.state == ZONE)) for a in case.lights]
    level = np.where(pixels(own), 0, 1)
    for size in range(2, case.coarsest + 1):
        side = 1 << size
        for y in range(0, h, side):
            for x in range(0, w, side):
                block = np.s_[y : y + side, x : x + side]
                mixed = any(a[block].any() and b[block].any() for a, b in zip(lit, dark, strict=True))
                if not mixed and not pixels(own)[block].any():
                    level[block] = size
    return np.minimum(level, case.coarsest)


def _expected(case: Case) -> tuple[Whole, Whole]:
    """Levels and reasons as the maps have them."""
    level = _levels(case)
    reason = np.where(level == case.coarsest, WHY_COARSEST, WHY_VISIBILITY)
    culled = (case.bits & FACED) == 0
    away = np.where(case.bits & FACING_AWAY, WHY_AWAY, WHY_BEHIND)
    level, reason = np.where(culled, CULLED, level), np.where(culled, away, reason)
    light = case.kind >= FIRST_LIGHT
    level, reason = np.where(light, CULLED, level), np.where(light, WHY_EMITTER, reason)
    nothing = case.kind == NOTHING
    return np.where(nothing, UNSEEN, level), np.where(nothing, UNSEEN, reason)


@pytest.mark.parametrize(
    ("size", "lights", "coarsest"),
    [
        ((141, 77), 1, 5),
        ((141, 77), 3, 6),
        ((140, 78), 2, 4),
        ((77, 45), 2, 3),
        ((77, 45), 2, 2),
        ((77, 45), 2, 1),
        ((1, 90), 1, 5),
        ((83, 1), 2, 5),
        ((93, 61), 15, 5),
        ((93, 61), 20, 5),
        ((61, 43), 31, 5),
    ],
)
def test_levels_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], lights: int, coarsest: int
) -> None:
    case = _case(rng, size, lights, coarsest)
    level, reason = _run(runner, case)
    expected_level, expected_reason = _expected(case)
    assert (level == expected_level).all()
    assert (reason == expected_reason).all()
    if lights > 1:
        fewer = dataclasses.replace(case, lights=case.lights[:1])
        assert size[0] < 90 or not (level == _expected(fewer)[0]).all()
    if size[0] > 100:
        assert set(range(coarsest + 1)) | {CULLED, UNSEEN} == set(level.ravel().tolist())


@pytest.mark.parametrize("lights", [1, 4, 17])
def test_fragments_are_a_partition(runner: Runner, rng: np.random.Generator, lights: int) -> None:
    """Each block is uniform, all of its pixels have its level, and the next larger one is not uniform."""
    case = _case(rng, (141, 77), lights, 5)
    case.kind[...], case.bits[...] = SURFACE, FACED
    level, _ = _run(runner, case)
    assert (level <= 5).all()
    h, w = level.shape
    own = np.any([(a.state == ZONE) & (a.traced | a.own_pixels) for a in case.lights], axis=0)

    def uniform(y: int, x: int, size: int) -> bool:
        cells = np.s_[y // 2 : (y + size + 1) // 2, x // 2 : (x + size + 1) // 2]
        values = (set(a.state[cells].ravel().tolist()) - {NONE} for a in case.lights)
        return all(v in ({LIT}, {DARK}, set()) for v in values) and not own[cells].any()

    counts = 0
    for size in range(6):
        side = 1 << size
        for y in range(0, h, side):
            for x in range(0, w, side):
                block = level[y : y + side, x : x + side]
                if not (block == size).any():
                    continue
                counts += 1
                assert (block == size).all(), "all pixels of a fragment have its level"
                assert size < 2 or uniform(y, x, side)
                if 1 <= size < 5:
                    twice = 2 * side
                    assert not uniform(y // twice * twice, x // twice * twice, twice), "it could be larger"
    assert counts > 30
    spoiled = level.copy()
    spoiled[0, 0] = 5 - spoiled[0, 0]
    assert not (spoiled[:32, :32] == spoiled[0, 0]).all()


def test_the_finest_of_the_lights_counts(runner: Runner, rng: np.random.Generator) -> None:
    """Lights one by one, and together; in one batch, and apart."""
    case = _case(rng, (93, 61), 4, 5)
    case.kind[...], case.bits[...] = SURFACE, FACED
    alone = [_run(runner, dataclasses.replace(case, lights=[a]))[0] for a in case.lights]
    together, _ = _run(runner, case)
    # where each light is of one kind, but another at each, blocks of all are blocks of each
    assert (together == np.min(alone, axis=0)).all()
    assert not (together == np.max(alone, axis=0)).all()
    columns, rows = case.layout.cells
    idle = Light(np.full((rows, columns), NONE), np.zeros((rows, columns), bool))
    apart = dataclasses.replace(case, lights=[*case.lights[:2], *[idle] * 14, *case.lights[2:]])
    assert (_run(runner, apart)[0] == together).all()


def test_what_only_later_lights_face_keeps_the_earlier_lights_levels(
    runner: Runner, rng: np.random.Generator
) -> None:
    """A pixel that no light of the first batch faces lies in a block of theirs all the same."""
    case = _case(rng, (93, 61), 20, 5)
    case.kind[...] = SURFACE
    earlier = np.where(rng.uniform(size=case.bits.shape) < 0.3, FACING_AWAY, case.bits)
    case.bits |= earlier | FACED
    found = _run(runner, case, earlier)
    expected = _expected(case)
    assert (found[0] == expected[0]).all()
    assert (found[1] == expected[1]).all()
    late = dataclasses.replace(case, lights=case.lights[BATCH:])
    assert not (found[0] == _expected(late)[0]).all()


@pytest.mark.parametrize("own_pixels", [False, True])
def test_an_edge_by_hand(runner: Runner, own_pixels: bool) -> None:
    """64 × 32 pixels; left of column 18 lit, right of it dark, a zone of two cells between."""
    layout = Layout(64, 32)
    state = np.full((16, 32), LIT)
    state[:, 9:], state[:, 8:10] = DARK, ZONE
    shape = (32, 64)
    light = Light(state, np.zeros(state.shape, bool), own_pixels)
    case = Case(layout, [light], np.full(shape, SURFACE), np.full(shape, FACED), 5)
    level, reason = _run(runner, case)
    row_of_levels = np.repeat([4, 0 if own_pixels else 1, 2, 3, 5], [16, 4, 4, 8, 32])
    assert (level == row_of_levels).all()
    assert (reason == np.where(row_of_levels == 5, WHY_COARSEST, WHY_VISIBILITY)).all()
    light.traced[:, 8] = True
    split = _run(runner, case)[0]
    assert (split[:, 16:18] == 0).all()
    assert (split[:, 18:20] == (0 if own_pixels else 1)).all()
