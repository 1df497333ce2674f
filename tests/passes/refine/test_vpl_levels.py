"""`vpl_levels`: the finest fragment of any virtual light at each pixel, against the recursion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.refining import LIT, ROUGH_DEPTH
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import SURFACE
from tests.passes.reference.virtual_lists import clear_limit, lists, random_case
from tests.passes.refine.test_vpl_lists import Run

DEPTH, ILLUMINATION, COARSEST = 1, 3, 0
CASES = [((37, 22), 4, 1), ((64, 40), 5, 1), ((24, 16), 3, 2), ((90, 70), 5, 3)]


def _maps(run: Run, counts: tuple[int, ...]) -> list[NDArray[np.uint32]]:
    """Levels and reasons after batches of so many virtual lights."""
    case = run.case
    width, height = case.size
    maps = [np.full(width * height, 7, np.uint32) for _ in range(2)]
    for number, count in enumerate(counts):
        masks = run.batch(sum(counts[:number]), count)
        given: dict[str, Any] = {"level_map": maps[0], "reason_map": maps[1], "masks": masks}
        pyramid = pyramid_record(case.view, case.coarsest, run.lowest)
        normal = case.g.rows()["g_normal"]
        out = run.runner(
            "passes/refine/vpl_levels",
            width * height,
            pyramid=pyramid,
            g_normal=normal,
            texel_state=case.state,
            **run.params,
            **given,
        )
        maps = [read(out, name, np.uint32) for name in ("level_map", "reason_map")]
    return [made.reshape(height, width) for made in maps]


@pytest.mark.parametrize(("size", "coarsest", "lowest"), CASES)
@pytest.mark.parametrize("counts", [(6,), (4, 2), (1, 3, 2)])
def test_levels_are_the_finest_of_all_lists(
    runner: Runner,
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    lowest: int,
    counts: tuple[int, ...],
) -> None:
    case = random_case(rng, size, coarsest, 6, rough=0.05, holes=0.003)
    limit = clear_limit(case, 0.85)
    expected = lists(case, limit, lowest).finest
    levels, reasons = _maps(Run(runner, case, limit, lowest), counts)
    seen = (case.g.kind == SURFACE).reshape(levels.shape)
    assert (levels[seen] == expected[seen]).all()
    assert (levels[~seen] >= 254).all()
    assert set(np.unique(levels[seen])) >= {lowest - 1, coarsest - 1}
    # a split pixel says why the texel that holds its fragment's parent was split
    assert (reasons[seen & (levels == coarsest - 1)] == COARSEST).all()
    for row, column in np.argwhere(seen & (levels < coarsest - 1)):
        level = levels[row, column] + 2
        state = case.states[level][row >> level, column >> level]
        assert state & LIT
        assert reasons[row, column] == (DEPTH if state & ROUGH_DEPTH else ILLUMINATION)
    fewer = lists(case, 1e30, lowest).finest
    assert (levels[seen] != fewer[seen]).any()


def test_without_a_limit_only_rough_texels_are_split(runner: Runner, rng: np.random.Generator) -> None:
    case = random_case(rng, (40, 24), 4, 40, rough=0.1)
    levels, reasons = _maps(Run(runner, case, 1e30), (40,))
    assert (levels == lists(case, 1e30).finest).all()
    assert set(np.unique(reasons)) == {COARSEST, DEPTH}
