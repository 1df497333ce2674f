"""`bilinear`: from fragments to pixels, against plain loops over levels."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference.run import Runner
from tests.passes.upsample.cases import SIZES, check_constant, check_image, run, step_case

BOUND = 2e-6


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("coarsest", [0, 1, 4, 7])
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    check_image(runner, rng, "bilinear", size, coarsest, BOUND)


def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator) -> None:
    check_constant(runner, rng, "bilinear")


def test_light_leaks_across_an_edge(runner: Runner, rng: np.random.Generator) -> None:
    """The halo of [NW09 Fig. 3]: next to the lit wall the dark one is not dark."""
    case, left = step_case(runner, rng)
    found = run(runner, "bilinear", case)[:, 0]
    assert {0, 1, 2, 3, 4} == set(np.unique(case.level_map))
    assert 0.05 < found[~left].max() < 1
    assert found[left].min() < 0.95
