"""`iterative`: only what rough texels were split into is tested; the fragments are those of one pass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, plane_gbuffer, wavy_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.lights import Spot
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.refining import LIT, choose, listed_states, pixel_bits, texel_states
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import ONE_PASS, record
from tests.passes.refine.test_one_pass import (
    CASES,
    chosen,
    constants,
    culled,
    numbers_of,
    refine,
    rough_texels,
    some_lights,
)
from tests.passes.refine.test_pyramid import run as run_pyramid

STEM = "passes/refine/iterative"
Rows = NDArray[Any]


def split_all(
    runner: Runner,
    view: Rows,
    g: GBuffer,
    state: Rows,
    coarsest: int,
    finest: int,
    params: Rows,
    metrics: tuple[int, int],
    children: int = 4,
) -> tuple[Rows, int]:
    """States of all texels, and how many were tested; of each four the first `children` are listed."""
    levels = sizes(int(view["width"][0]), int(view["height"][0]))
    means, ranges, spreads = run_pyramid(runner, view, g, coarsest)
    begun = runner(
        STEM,
        levels[coarsest][3],
        entry="begin",
        pyramid=pyramid_record(view, coarsest, finest),
        texel_state=state,
        listed=np.full(levels[coarsest][3], 9, np.uint32),
    )
    flags, tested = read(begun, "listed", np.uint32), 0
    for level in range(coarsest, finest, -1):
        columns, _, _, count = levels[level]
        numbers = np.flatnonzero(flags[:count] & LIT)
        if level < coarsest:
            numbers = numbers[(numbers % columns % 2) + 2 * (numbers // columns % 2) < children]
        tested += len(numbers)
        out = runner(
            STEM,
            len(numbers) + 64,
            entry="split",
            params=params,
            constants=constants(metrics),
            pyramid=pyramid_record(view, coarsest, finest, level),
            view=view,
            means=means.reshape(-1, 4),
            ranges=ranges.reshape(-1, 4),
            spreads=spreads.ravel(),
            texel_state=state,
            listed=np.zeros(levels[max(level - 1, finest + 1)][3], np.uint32),
            list=np.append(numbers, 0).astype(np.uint32),
            arguments=np.array([0, 0, 0, len(numbers)], np.uint32),
        )
        state, flags = read(out, "texel_state", np.uint32), read(out, "listed", np.uint32)
    return state, tested


@pytest.mark.parametrize(("size", "coarsest", "finest"), [case for case in CASES if case[1] > case[2]])
@pytest.mark.parametrize("metrics", [("range", "component"), ("derivative", "curvature"), ("plane", "cone")])
def test_states_agree_with_the_loops_and_fragments_with_one_pass(
    runner: Runner,
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    finest: int,
    metrics: tuple[str, str],
) -> None:
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=0.01, step=0.5)
    lights = some_lights(rng, view)
    limits, rough = rough_texels(view, g, coarsest, metrics)
    numbers = numbers_of(metrics)
    params, pyramid = record(ONE_PASS, lights=len(lights), **limits), pyramid_record(view, coarsest, finest)
    total = sum(row[3] for row in sizes(*size)[: coarsest + 1])
    lit = culled(runner, view, g, lights, {"params": params, "pyramid": pyramid}, total)
    state, tested = split_all(runner, view, g, lit, coarsest, finest, params, numbers)
    once = refine(runner, view, g, lights, coarsest, finest, numbers, **limits)

    whole = texel_states(view, g, pixel_bits(g, lights), rough, coarsest)
    expected = listed_states(whole, coarsest, finest)
    assert (state == np.concatenate([level.ravel() for level in expected])).all()
    found = chosen(runner, view, g, pyramid, state)
    levels, reasons, fragments = choose(g, expected, coarsest, finest)
    assert (found.level_map == levels).all()
    assert (found.reason_map == reasons).all()
    assert found.fragments == fragments
    for name in ("level_map", "reason_map", "at"):
        assert (getattr(found, name) == getattr(once, name)).all(), name
    assert found.fragments == once.fragments
    above = once.state[size[0] * size[1] :]
    assert tested <= np.count_nonzero(above & LIT)
    if min(size) > 1:
        assert (state != np.concatenate([level.ravel() for level in whole])).any(), "not all is tested"
        fewer, _ = split_all(runner, view, g, lit, coarsest, finest, params, numbers, children=3)
        if coarsest > finest + 1:
            assert (chosen(runner, view, g, pyramid, fewer).level_map != levels).any()


def test_of_a_bare_plane_only_the_coarsest_level_is_tested(runner: Runner, rng: np.random.Generator) -> None:
    view = random_view(rng, 64, 64)
    view["cx"], view["cy"], view["fx"], view["fy"] = 32, 32, 200, 200
    g = plane_gbuffer(view, 60.0)
    eye, backward = (view[name][0].astype(np.float64) for name in ("eye", "backward"))
    light = [Spot(eye + backward * 0.1, -backward, np.ones(3), 0.1)]
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25}
    for metric, tests in ((3, 16), (1, None)):
        params = record(ONE_PASS, lights=1, **limits)
        given = {"params": params, "pyramid": pyramid_record(view, 4)}
        lit = culled(runner, view, g, light, given, sum(row[3] for row in sizes(64, 64)[:5]))
        _, tested = split_all(runner, view, g, lit, 4, 0, params, (metric, 2))
        assert tested == tests or (tests is None and tested > 16)
