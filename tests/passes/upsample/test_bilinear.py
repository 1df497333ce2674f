"""`bilinear`: from fragments to pixels, against plain loops over levels."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference import upsampling
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.upsample.cases import SIZES, constant, random_case, run, step_case

BOUND = 2e-6


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("coarsest", [0, 1, 4, 7])
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    case = random_case(runner, rng, size, coarsest)
    found = run(runner, "bilinear", case)
    expected = upsampling.bilinear(case)
    assert_within(found, expected, BOUND, "irradiance")
    assert not found[~case.shaded & (case.g.kind != 1)].any(), "what sees no surface has no light"
    case.light = case.light[:, [1, 2, 0]]
    assert_not_within(found, upsampling.bilinear(case), BOUND)


def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator) -> None:
    case = random_case(runner, rng, (53, 38))
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    found = run(runner, "bilinear", case)
    assert_within(found[case.shaded], expected[case.shaded], 1e-6, "irradiance")


def test_light_leaks_across_an_edge(runner: Runner, rng: np.random.Generator) -> None:
    """The halo of [NW09 Fig. 3]: next to the lit wall the dark one is not dark."""
    case, left = step_case(runner, rng)
    found = run(runner, "bilinear", case)[:, 0]
    assert {0, 1, 2, 3, 4} == set(np.unique(case.level_map))
    assert 0.05 < found[~left].max() < 1
    assert found[left].min() < 0.95
