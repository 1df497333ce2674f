"""`vpl_points`: shading points of texels, the mean irradiance, and what a difference may be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.refining import LIT
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import SHADED_POINT, VPL_POINTS, record, row
from tests.passes.reference.virtual_lists import Case, random_case

STEM = "passes/refine/vpl_points"
FIELDS = ("origin", "normal_shade", "normal_geo", "mirror", "red", "green", "blue", "exponent")


def _points(runner: Runner, case: Case, *, glossy: bool = True) -> NDArray[Any]:
    expected = case.points()
    out = runner(
        STEM,
        len(expected),
        entry="middles",
        constants={"GLOSSY": float(glossy)},
        pyramid=pyramid_record(case.view, case.coarsest),
        view=case.view,
        g_albedo=row(np.zeros((len(case.instance), 3)), case.instance),
        instance_lobes=case.lobes.astype(np.float32),
        texel_state=case.state,
        points=np.full(len(expected), np.nan, SHADED_POINT),
        **case.g.rows(),
    )
    return read(out, "points", SHADED_POINT)


def _mean(runner: Runner, case: Case, points: NDArray[Any]) -> NDArray[np.float32]:
    """The mean irradiance at the coarsest level, one number."""
    count, lights = case.states[case.coarsest].size, len(case.lights)
    estimates = np.full((count, 2), np.nan, np.float32)
    for first, end in ((0, lights // 3), (lights // 3, lights)):  # in two parts
        out = runner(
            STEM,
            count,
            entry="estimate",
            constants={"DISC": float(case.disc)},
            params=record(VPL_POINTS, lights=lights, reach=case.reach, first=first, end=end),
            pyramid=pyramid_record(case.view, case.coarsest),
            texel_state=case.state,
            points=points,
            virtual_lights=case.lights.view(np.float32).reshape(-1, 4),
            estimates=estimates,
        )
        estimates = read(out, "estimates", np.float32, -1, 2)
    averaged = runner(
        STEM,
        1,
        entry="mean",
        groups=True,
        pyramid=pyramid_record(case.view, case.coarsest),
        estimates=estimates,
        mean_irradiance=np.full(1, np.nan, np.float32),
    )
    return read(averaged, "mean_irradiance", np.float32)


@pytest.mark.parametrize(("size", "coarsest"), [((37, 22), 4), ((64, 40), 2), ((9, 1), 1)])
def test_points_are_those_of_the_middle_pixels(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int
) -> None:
    case = random_case(rng, size, coarsest, 4, holes=0.3)
    found, expected = _points(runner, case), case.points()
    for name in FIELDS:
        scale = np.abs(expected[name].astype(np.float64)) + 1
        assert_within(found[name], expected[name], 1e-6 * scale, name)
    turned = np.roll(expected["origin"], 1, axis=0)
    assert_not_within(found["origin"], turned, 1e-6 * (np.abs(turned) + 1))
    plain = _points(runner, case, glossy=False)
    assert not plain["red"].any()
    assert (plain["origin"] == found["origin"]).all()


@pytest.mark.parametrize("disc", [False, True])
@pytest.mark.parametrize("reach", [3e38, 2.0])
def test_the_mean_is_that_of_the_coarsest_texels_that_see_a_surface(
    runner: Runner, rng: np.random.Generator, disc: bool, reach: float
) -> None:
    case = random_case(rng, (80, 60), 2, 30, disc=disc, holes=0.9)
    case.reach = reach
    pixels = case.middles(2)[(case.states[2] & LIT) != 0]
    light, _ = case.light(pixels)
    expected = light.sum(-2).mean()
    bound = case.bounds(pixels)[0].mean()
    found = _mean(runner, case, case.points())
    assert_within(found, [expected], bound)
    assert bound < 1e-4 * expected
    whole = light.sum(-2).mean(-1).sum() / case.states[2].size
    assert_not_within(found, [whole], bound)


@pytest.mark.parametrize("threshold", [0.25, -1.0])
def test_the_table_says_what_a_difference_may_be(
    runner: Runner, rng: np.random.Generator, threshold: float
) -> None:
    case = random_case(rng, (16, 16), 2, 70)
    out = runner(
        STEM,
        70,
        entry="table",
        params=record(VPL_POINTS, lights=70, threshold=threshold),
        virtual_lights=case.lights.view(np.float32).reshape(-1, 4),
        mean_irradiance=np.array([3.0], np.float32),
        short_lights=np.zeros((70 * 3, 4), np.float32),
    )
    found = read(out, "short_lights", np.float32, -1, 4)
    limit = threshold * 3 / np.sqrt(70) if threshold > 0 else 3e38
    expected = case.short_lights(limit)
    assert_within(found, expected, 1e-6 * np.abs(expected))
    assert_not_within(found, case.short_lights(limit * 1.01), 1e-6 * np.abs(expected))
