"""`vpl_pixels`: what the lists leave, at every pixel, and what the levels hold, interpolated."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import pixel_numbers
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.refining import LIT, ROUGH_DEPTH
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import SURFACE, VPL_LISTS, record, row
from tests.passes.reference.virtual_lists import Case, interpolated, random_case

STEM = "passes/upsample/vpl_pixels"
HEAD, FIRST = 4, 3
Array = NDArray[np.float64]


def _pixels(
    runner: Runner, case: Case, left: NDArray[np.bool_], start: NDArray[np.float32], glossy: bool
) -> Array:
    """Light a pixel after the virtual lights from number FIRST on were added."""
    count = len(case.lights) - FIRST
    words = -(-count // 32)
    bits = np.zeros((*left.shape[:2], words * 32), np.uint64)
    bits[..., :count] = left[..., FIRST:]
    masks = (bits.reshape(*left.shape[:2], words, 32) << np.arange(32, dtype=np.uint64)).sum(-1)
    numbers = {"first": FIRST, "count": count, "words": words, "lowest": 1}
    out = runner(
        STEM,
        len(pixel_numbers(*case.size)),
        entry="pixels",
        constants={"DISC": float(case.disc), "GLOSSY": float(glossy)},
        params=record(VPL_LISTS, reach=case.reach, **numbers),
        pyramid=pyramid_record(case.view, case.coarsest),
        view=case.view,
        g_albedo=row(np.zeros((len(case.instance), 3)), case.instance),
        instance_lobes=case.lobes.astype(np.float32),
        short_lights=case.short_lights(1.0),
        masks=np.concatenate([np.zeros(HEAD), masks.ravel()]).astype(np.uint32),
        light=start,
        **case.g.rows(),
    )
    return read(out, "light", np.float32, -1, 4).astype(np.float64)


@pytest.mark.parametrize("glossy", [False, True])
@pytest.mark.parametrize(("size", "disc"), [((37, 22), True), ((16, 9), False)])
def test_what_is_left_lights_each_pixel(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], disc: bool, glossy: bool
) -> None:
    case = random_case(rng, size, 2, 72, disc=disc, holes=0.05)
    columns, rows, _, _ = sizes(*size)[1]
    left = rng.uniform(size=(rows, columns, 72)) < 0.4
    start = rng.uniform(size=(size[0] * size[1], 4)).astype(np.float32)
    found = _pixels(runner, case, left, start, glossy)
    every = np.arange(size[0] * size[1])
    line, column = np.divmod(every, size[0])
    chosen = left[line // 2, column // 2] & (np.arange(72) >= FIRST)

    def sums(chosen: NDArray[np.bool_]) -> Array:
        total: Array = start[:, :3] + (case.light(every)[glossy] * chosen[..., None]).sum(-2)
        return total

    bound = case.bounds(every)[glossy] + 1e-6
    assert_within(found[:, :3], sums(chosen), bound)
    assert (found[:, 3] == start[:, 3]).all()
    assert (found[case.g.kind != SURFACE] == start[case.g.kind != SURFACE]).all()
    assert_not_within(found[:, :3], sums(np.roll(chosen, 1, axis=1)), bound)
    assert np.median(bound) < 1e-3


def _levels(runner: Runner, case: Case, held: dict[int, Array], lowest: int) -> Array:
    width, height = case.size
    levels = sizes(width, height)
    rows = [
        held.get(level, np.full((levels[level][1], levels[level][0], 3), 77.0)).reshape(-1, 3)
        for level in range(1, case.coarsest + 1)
    ]
    out = runner(
        STEM,
        width * height,
        entry="levels",
        params=record(VPL_LISTS, lowest=lowest),
        pyramid=pyramid_record(case.view, case.coarsest),
        texel_state=case.state,
        held=np.pad(np.concatenate(rows), ((0, 0), (0, 1))).astype(np.float32),
        light=np.zeros((width * height, 4), np.float32),
    )
    return read(out, "light", np.float32, height, width, 4)[..., :3].astype(np.float64)


CASES = [((37, 22), 4, 1), ((64, 40), 5, 3), ((33, 17), 3, 2), ((20, 9), 1, 1)]


@pytest.mark.parametrize(("size", "coarsest", "lowest"), CASES)
def test_levels_are_interpolated_inside_of_what_keeps_them(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, lowest: int
) -> None:
    case = random_case(rng, size, coarsest, 1, rough=0.2, holes=0.01)
    held = {
        level: rng.uniform(size=(*case.states[level].shape, 3)).astype(np.float32).astype(np.float64)
        for level in range(max(lowest, 2) - 1, coarsest)
    }
    found = _levels(runner, case, held, lowest)
    surface = (case.g.kind == SURFACE).reshape(found.shape[:2])
    expected = interpolated(case, held) * surface[..., None]
    assert_within(found, expected, 4e-6 * coarsest)
    if coarsest > 1:
        case.states[coarsest][:] |= ROUGH_DEPTH
        assert_not_within(found, interpolated(case, held) * surface[..., None], 4e-6 * coarsest)


def test_a_slope_stays_one_whatever_texels_keep_it(runner: Runner, rng: np.random.Generator) -> None:
    """Half of the texels of level 3 keep it, the others' children do: no border shows."""
    case = random_case(rng, (64, 48), 3, 1, rough=0.0)
    rows, columns = np.divmod(np.arange(64 * 48), 64)
    slope = (1 + 0.02 * columns + 0.03 * rows).reshape(48, 64, 1) * np.array([1, 0.5, 2])
    keeps = rng.uniform(size=(6, 8)) < 0.5
    held = {}
    for level, whole in ((2, keeps), (1, ~keeps)):
        image = slope.reshape(-1, 3)[case.middles(level)]
        wide = np.repeat(np.repeat(whole, 2 ** (3 - level), axis=0), 2 ** (3 - level), axis=1)
        held[level] = image * wide[..., None]
    assert all((state & LIT).all() for state in case.states)
    found = _levels(runner, case, held, 1)
    assert_within(found, slope, 1e-5)
    held[1] = held[1] * 1.001
    assert_not_within(_levels(runner, case, held, 1), slope, 1e-5)
