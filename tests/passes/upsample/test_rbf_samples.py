"""`rbf_samples`: what the pixels of each large fragment choose from, against plain loops [KJ16 Fig. 5]."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.radial_basis import LARGE, SLOTS, Extras, border_words, large_fragments
from tests.passes.reference.run import Runner, read
from tests.passes.reference.upsampling import Case
from tests.passes.upsample.cases import bindings, quilt_case, random_case

STEM = "passes/upsample/rbf_samples"
SIZES = [(64, 48), (129, 70), (37, 21), (23, 1)]


def random_extras(rng: np.random.Generator, case: Case) -> Extras:
    """Extra samples at most of the places where there may be some."""
    texels = 3 * sum(level[3] for level in case.levels[LARGE : case.coarsest + 1])
    light = rng.uniform(0, 2, (texels, 3, 3)).astype(np.float32).astype(np.float64)
    return Extras(light, rng.uniform(size=(texels, 3)) < 0.8)


def _run(runner: Runner, case: Case, extras: Extras | None) -> NDArray[np.uint32]:
    texels = sum(level[3] for level in case.levels[LARGE : case.coarsest + 1])
    light = np.full((9 * texels, 4), 9, np.float32)
    if extras is not None:
        light[:, :3] = extras.light.reshape(-1, 3)
        light[:, 3] = extras.there.ravel()
    out = runner(
        STEM,
        texels,
        constants={"EXTRAS": float(extras is not None)},
        border_samples=np.zeros((SLOTS * texels, 4), np.uint32),
        extra_light=light,
        **bindings(case, "view", "level_map", "g_position", "g_normal", "g_geometric"),
        **{name: bindings(case, name)[name] for name in ("fragment_at", "fragment_irradiance")},
    )
    return read(out, "border_samples", np.uint32, SLOTS * texels, 4)


@pytest.mark.parametrize("with_extras", [False, True])
@pytest.mark.parametrize("size", SIZES)
def test_lists_agree_with_the_loops(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], with_extras: bool
) -> None:
    case = quilt_case(rng, size) if with_extras else random_case(runner, rng, size, holes=0.0)
    extras = random_extras(rng, case) if with_extras else None
    found = _run(runner, case, extras).reshape(-1, SLOTS, 4)
    expected, clear = border_words(case, extras)
    lists = expected.reshape(-1, SLOTS, 4)
    assert clear.mean() > 0.8
    assert (found[clear] == lists[clear]).all()
    rows = [row for row, *_ in large_fragments(case)]
    counts = found[:, SLOTS - 1, 3]
    assert (counts[rows] >= 1).all()
    assert np.count_nonzero(counts) == len(rows)
    if min(size) > 20 and with_extras:
        assert counts.max() > 8
        case.light = case.light[::-1]
        assert (found[clear] != border_words(case, extras)[0].reshape(-1, SLOTS, 4)[clear]).any(), "control"


def test_extra_samples_go_to_their_texels(runner: Runner, rng: np.random.Generator) -> None:
    at = rng.permutation(np.concatenate([np.arange(1, 31), np.zeros(50)])).astype(np.uint32)
    light = rng.uniform(size=(90, 4)).astype(np.float32)
    out = runner(
        STEM,
        240,
        entry="spread",
        extra_at=at,
        extra_irradiance=light,
        extra_rows=np.full((240, 4), 9, np.float32),
    )
    rows = read(out, "extra_rows", np.float32, 80, 3, 4)
    assert (rows[at > 0] == light.reshape(30, 3, 4)[at[at > 0] - 1]).all()
    assert not rows[at == 0].any()
