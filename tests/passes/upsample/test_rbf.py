"""`rbf`: radial basis functions from fragments to pixels, against plain loops [KJ16 Sec. 3.1.5]."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import plane_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.radial_basis import Extras, border_words, rbf
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.upsampling import Case
from tests.passes.upsample.cases import (
    SIZES,
    bindings,
    constant,
    fragments,
    quilt_case,
    random_case,
    step_case,
)
from tests.passes.upsample.test_rbf_samples import random_extras

OWN = ("fragment_at", "fragment_irradiance", "level_map")
SEEN = ("view", "g_position", "g_normal", "g_geometric")


def run_rbf(
    runner: Runner, case: Case, samples: int = 3, extras: Extras | None = None, paper: bool = False
) -> NDArray[np.float32]:
    """The image: pixels of large fragments and of level 0, then the lists of levels 1 and 2."""
    columns, rows, _, pixels = case.levels[0]
    words, _ = border_words(case, extras)
    given = {**bindings(case, *OWN), "border_samples": np.concatenate([words, np.zeros((32, 4), np.uint32)])}
    image = np.full((pixels, 4), 9, np.float32)
    if paper:
        out = runner("passes/upsample/rbf_paper", pixels, direct_irradiance=image, **given)
        return read(out, "direct_irradiance", np.float32, pixels, 4)[:, :3]
    stem, constants = "passes/upsample/rbf", {"SAMPLES": float(samples)}
    threads = -(-columns // 8) * -(-rows // 8) * 64
    out = runner(stem, threads, constants=constants, direct_irradiance=image, **given)
    image = read(out, "direct_irradiance", np.float32, pixels, 4)
    del given["border_samples"]
    for level in (1, 2):
        listed = np.flatnonzero(case.level_map.ravel() == level).astype(np.uint32)
        out = runner(
            stem,
            max(len(listed), 1),
            entry="small",
            constants=constants,
            direct_irradiance=image,
            small_pixels=np.append(listed, [0, pixels + 5]).astype(np.uint32),
            **given,
            **{name: bindings(case, name)[name] for name in SEEN},
        )
        image = read(out, "direct_irradiance", np.float32, pixels, 4)
    return image[:, :3]


@pytest.mark.parametrize("with_extras", [False, True])
@pytest.mark.parametrize("samples", [1, 2, 3, 4])
@pytest.mark.parametrize("size", SIZES)
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], samples: int, with_extras: bool
) -> None:
    case = quilt_case(rng, size) if with_extras else random_case(runner, rng, size)
    extras = random_extras(rng, case) if with_extras else None
    found = run_rbf(runner, case, samples, extras)
    expected, clear = rbf(case, samples, extras)
    assert clear.mean() > 0.6
    assert_within(found[clear], expected[clear], 2e-3, "irradiance")
    case.light = case.light[:, [1, 2, 0]]
    assert_not_within(found[clear], rbf(case, samples, extras)[0][clear], 2e-3)
    if min(size) > 1 and samples > 1:
        assert_not_within(found[clear], rbf(random_case(runner, rng, size), samples - 1)[0][clear], 2e-3)


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    case = random_case(runner, rng, (53, 38))
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    assert_within(run_rbf(runner, case, samples)[case.shaded], expected[case.shaded], 1e-6, "irradiance")
    case.light[case.at[case.at > 0][0] - 1] += 1
    assert_not_within(run_rbf(runner, case, samples)[case.shaded], expected[case.shaded], 1e-2)


@pytest.mark.parametrize("samples", [3, 4])
def test_nothing_rings_above_its_samples(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    case = random_case(runner, rng, (64, 48))
    case.light = rng.choice([0.0, 1.0], case.light.shape)
    found = run_rbf(runner, case, samples)
    assert found.min() >= 0
    assert found.max() <= 1
    assert ((found > 0.01) & (found < 0.99)).any(), "some lie in between"


@pytest.mark.parametrize("column", [29, 32])
def test_no_light_crosses_an_edge(runner: Runner, rng: np.random.Generator, column: int) -> None:
    """A lit wall before a dark one: each keeps its light to the pixel, also between large fragments."""
    case, left = step_case(runner, rng, column)
    found = run_rbf(runner, case)[:, 0]
    levels = {0, 1, 2, 3, 4} if column == 29 else {4}
    assert levels == set(np.unique(case.level_map))
    assert_within(found, left, 1e-6, "irradiance")


@pytest.mark.parametrize("samples", [3, 4])
def test_a_ramp_across_fragments_is_smooth(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    """On a bare wall lit linearly the inside of the image is nearly linear, where nearest leaves steps."""
    view = random_view(rng, 128, 64)
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25, "metrics": (3, 2)}
    case = fragments(runner, rng, view, plane_gbuffer(view, 0.0), 3, **limits)
    columns, _, first, count = case.levels[3]
    case.light = np.repeat(((np.arange(count) % columns) * 8 + 4)[:, None], 3, axis=1)
    case.at[first : first + count] = np.arange(count) + 1
    image = run_rbf(runner, case, samples)[:, 0].reshape(64, 128)
    inside = np.arange(8, 120)
    ramp = np.broadcast_to(np.arange(128.0), image.shape)
    assert_within(image[8:56, inside], ramp[8:56, inside], 1.5, "the ramp")
    assert np.abs(np.diff(image[8:56, inside], axis=1)).max() < 4, "steps from pixel to pixel, of 8 at most"
    assert_not_within(run_rbf(runner, case, 1)[:, 0].reshape(64, 128)[:, inside], ramp[:, inside], 3.0)
