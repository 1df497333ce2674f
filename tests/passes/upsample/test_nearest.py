"""`nearest`: from fragments to pixels, against plain loops over levels."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference.run import Runner
from tests.passes.upsample.cases import SIZES, check_constant, check_image

BOUND = 0.0


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("coarsest", [0, 1, 4, 7])
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    check_image(runner, rng, "nearest", size, coarsest, BOUND)


def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator) -> None:
    check_constant(runner, rng, "nearest")
