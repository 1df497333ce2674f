"""`edge_aware`: from fragments to pixels, against plain loops over levels."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference.gbuffers import plane_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.upsample.cases import SIZES, check_constant, check_image, fragments, run, step_case

BOUND = 1e-4


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("coarsest", [0, 1, 4, 7])
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    check_image(runner, rng, "edge_aware", size, coarsest, BOUND)


def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator) -> None:
    check_constant(runner, rng, "edge_aware")


def test_no_light_crosses_an_edge(runner: Runner, rng: np.random.Generator) -> None:
    """A lit wall before a dark one: each keeps its light to the pixel."""
    case, left = step_case(runner, rng)
    found = run(runner, "edge_aware", case)[:, 0]
    assert {0, 1, 2, 3, 4} == set(np.unique(case.level_map))
    assert_within(found, left, 1e-6, "irradiance")


def test_a_ramp_across_fragments_is_smooth(runner: Runner, rng: np.random.Generator) -> None:
    """On a bare wall lit linearly the inside of the image is linear again, where nearest leaves steps."""
    view = random_view(rng, 128, 64)
    g = plane_gbuffer(view, 0.0)
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25, "metrics": (3, 2)}
    case = fragments(runner, rng, view, g, 3, **limits)
    columns, _, first, count = case.levels[3]
    case.light = np.repeat(((np.arange(count) % columns) * 8 + 4)[:, None], 3, axis=1)
    case.at[first : first + count] = np.arange(count) + 1
    image = run(runner, "edge_aware", case)[:, 0].reshape(64, 128)
    inside = np.arange(8, 120)
    ramp = np.broadcast_to(np.arange(128.0), image.shape)
    # all four lie in the plane, so only rounding is left
    assert_within(image[:, inside], ramp[:, inside], 1e-3, "the ramp")
    steps = run(runner, "nearest", case)[:, 0].reshape(64, 128)
    assert_not_within(steps[:, inside], ramp[:, inside], 3.0)
