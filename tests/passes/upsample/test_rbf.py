"""`rbf`: radial basis functions from fragments to pixels, against plain loops [KJ16 Sec. 3.1.5]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import plane_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.radial_basis import rbf, rbf_paper
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.reference.structs import RBF, record
from tests.passes.reference.upsampling import Case
from tests.passes.upsample.cases import SIZES, Steps, constant, fragments, random_case, step_case

READS = ("fragment_at", "fragment_irradiance", "view", "level_map", "g_position", "g_normal", "g_geometric")


def _run(runner: Runner, case: Case, samples: int = 3, entry: str = "main") -> NDArray[np.float32]:
    params: NDArray[Any] = record(RBF, samples=samples)
    return Steps(runner, "rbf", case).pixels(entry, *READS, levels=False, params=params)


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
@pytest.mark.parametrize("size", SIZES)
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], samples: int
) -> None:
    case = random_case(runner, rng, size)
    found = _run(runner, case, samples)
    expected, clear = rbf(case, samples)
    assert clear.mean() > 0.9
    assert_within(found[clear], expected[clear], 2e-3, "irradiance")
    case.light = case.light[:, [1, 2, 0]]
    assert_not_within(found[clear], rbf(case, samples)[0][clear], 2e-3)
    if min(size) > 1 and samples > 1:
        assert_not_within(found[clear], rbf(random_case(runner, rng, size), samples - 1)[0][clear], 2e-3)


@pytest.mark.parametrize("size", [(64, 48), (37, 21)])
def test_the_paper_s_form_agrees_with_its_equations(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    case = random_case(runner, rng, size)
    found = _run(runner, case, entry="paper")
    expected, clear = rbf_paper(case)
    assert clear.mean() > 0.9
    # its matrix may be nearly singular, and amplifies what rounding leaves
    assert_within(found[clear], expected[clear], 2e-3 * max(np.abs(expected).max(), 1), "irradiance")
    other, both = rbf(case)
    assert_not_within(found[clear & both], other[clear & both], 2e-3)


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    case = random_case(runner, rng, (53, 38))
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    assert_within(_run(runner, case, samples)[case.shaded], expected[case.shaded], 1e-6, "irradiance")
    case.light[case.at[case.at > 0][0] - 1] += 1
    assert_not_within(_run(runner, case, samples)[case.shaded], expected[case.shaded], 1e-2)


@pytest.mark.parametrize("samples", [3, 4])
def test_nothing_rings_above_its_samples(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    case = random_case(runner, rng, (64, 48))
    case.light = rng.choice([0.0, 1.0], case.light.shape)
    found = _run(runner, case, samples)
    assert found.min() >= 0
    assert found.max() <= 1
    assert ((found > 0.01) & (found < 0.99)).any(), "some lie in between"


@pytest.mark.parametrize("column", [29, 32])
def test_no_light_crosses_an_edge(runner: Runner, rng: np.random.Generator, column: int) -> None:
    """A lit wall before a dark one: each keeps its light to the pixel, also between large fragments."""
    case, left = step_case(runner, rng, column)
    found = _run(runner, case)[:, 0]
    levels = {0, 1, 2, 3, 4} if column == 29 else {4}
    assert levels == set(np.unique(case.level_map))
    assert_within(found, left, 1e-6, "irradiance")


@pytest.mark.parametrize("samples", [3, 4])
def test_a_ramp_across_fragments_is_smooth(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    """On a bare wall lit linearly the inside of the image is nearly linear, where nearest leaves steps."""
    view = random_view(rng, 128, 64)
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25, "depth_metric": 3, "normal_metric": 2}
    case = fragments(runner, rng, view, plane_gbuffer(view, 0.0), 3, **limits)
    columns, _, first, count = case.levels[3]
    case.light = np.repeat(((np.arange(count) % columns) * 8 + 4)[:, None], 3, axis=1)
    case.at[first : first + count] = np.arange(count) + 1
    image = _run(runner, case, samples)[:, 0].reshape(64, 128)
    inside = np.arange(8, 120)
    ramp = np.broadcast_to(np.arange(128.0), image.shape)
    assert_within(image[8:56, inside], ramp[8:56, inside], 1.5, "the ramp")
    assert np.abs(np.diff(image[8:56, inside], axis=1)).max() < 4, "steps from pixel to pixel, of 8 at most"
    assert_not_within(_run(runner, case, 1)[:, 0].reshape(64, 128)[:, inside], ramp[:, inside], 3.0)


def test_the_paper_s_form_keeps_no_constant(runner: Runner, rng: np.random.Generator) -> None:
    """On a bare wall in even light its sum without a constant sags between samples; ours does not."""
    view = random_view(rng, 64, 64)
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25, "depth_metric": 3, "normal_metric": 2}
    case = fragments(runner, rng, view, plane_gbuffer(view, 0.0), 3, **limits)
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    assert_within(_run(runner, case)[case.shaded], expected[case.shaded], 1e-6, "irradiance")
    assert_not_within(_run(runner, case, entry="paper")[case.shaded], expected[case.shaded], 0.02)
