"""`nearest`: from fragments to pixels, against plain loops over levels."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference import upsampling
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.upsample.cases import SIZES, constant, random_case, run

BOUND = 0.0


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("coarsest", [0, 1, 4, 7])
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    case = random_case(runner, rng, size, coarsest)
    found = run(runner, "nearest", case)
    expected = upsampling.nearest(case)
    assert_within(found, expected, BOUND, "irradiance")
    assert not found[~case.shaded & (case.g.kind != 1)].any(), "what sees no surface has no light"
    case.light = case.light[:, [1, 2, 0]]
    assert_not_within(found, upsampling.nearest(case), BOUND)


def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator) -> None:
    case = random_case(runner, rng, (53, 38))
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    found = run(runner, "nearest", case)
    assert_within(found[case.shaded], expected[case.shaded], 1e-6, "irradiance")
