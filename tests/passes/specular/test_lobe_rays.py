"""`lobe_rays`: samples that cover a patch, rays to them, and what each adds."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference.lobes import adds, lobe_light, reflected, sums
from tests.passes.reference.run import Runner, assert_within, read
from tests.passes.reference.structs import RAY, row
from tests.passes.specular.test_lobe_integral import SIDE, floor, screen

STEM = "passes/specular/lobe_rays"


@pytest.mark.parametrize("exponent", [2.0, 500.0])
def test_weights_add_up_to_the_integral(runner: Runner, rng: np.random.Generator, exponent: float) -> None:
    side = 16
    view, points = floor(rng, exponent)
    light = screen(rng.uniform(0.5, 1.5, (5, 4, 3)))
    pixels = SIDE * SIDE
    # one tile: its places are the pixels, row by row
    out = runner(
        STEM,
        pixels * side,
        source=lobe_light(light, side),
        view=view,
        g_position=row(points.position, np.float32(1e-6).view(np.uint32)),
        g_normal=row(points.normal, 1),
        g_geometric=row(points.geometric, 0),
        lobe_surface=np.column_stack([points.color, points.exponent]).astype(np.float32),
        light_sums=sums(light),
        lobe_list=np.arange(pixels, dtype=np.uint32),
        rays=np.zeros(pixels * side**2, RAY),
        lobe_weights=np.zeros((pixels * side**2, 4), np.float32),
    )
    rays = read(out, "rays", RAY).reshape(pixels, -1)
    weights = read(out, "lobe_weights", np.float32, pixels, -1, 4)[..., :3].astype(np.float64)
    expected = reflected(light, points)
    found = points.color * weights.sum(1)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.03 * np.sqrt(np.mean(expected**2))

    live = weights.any(-1)
    assert live.any()
    assert ((rays["t_max"] > rays["t_min"]) == live).all(), "what adds nothing asks nothing"
    ends = rays["origin"].astype(np.float64) + rays["direction"]
    dual = lobe_light(light)
    ab = np.stack([(ends - light.corner) @ dual[name][0] for name in ("dual_u", "dual_v")], -1)
    assert_within(np.clip(ab[live], 0, 1), ab[live], 1e-4, "places on the light")
    added = adds(light, points, ab)
    assert (added[live] > 0).mean() > 0.99, "where a ray goes the lobe reaches"
    assert np.ptp(ab[live], axis=0).min() > 0.3, "all over the light"


def test_only_pixels_that_a_light_reaches_ask(runner: Runner, rng: np.random.Generator) -> None:
    view, _ = floor(rng, 10.0)
    lit = rng.uniform(size=(SIDE * SIDE, 4)).astype(np.float32)
    lit[:, 3] = rng.uniform(size=SIDE * SIDE) < 0.5
    out = runner(
        STEM,
        SIDE * SIDE,
        entry="flags",
        view=view,
        lobe_light=lit,
        lobe_flags=np.full(SIDE * SIDE, 7, np.uint32),
        tile_flags=np.zeros(1, np.uint32),
        lobe_share=np.zeros((SIDE * SIDE, 4), np.float32),
    )
    assert (read(out, "lobe_flags", np.uint32) == lit[:, 3]).all()


def test_only_those_ask_again_whose_samples_disagree(runner: Runner, rng: np.random.Generator) -> None:
    view, _ = floor(rng, 10.0)
    share = rng.choice([0.0, 0.5, 1.0], (SIDE * SIDE, 1)) * np.ones(4)
    share[3] = (0, 1, 0, 1)
    before = (rng.uniform(size=SIDE * SIDE) < 0.7).astype(np.uint32)
    before[3] = 1
    out = runner(
        STEM,
        SIDE * SIDE,
        entry="again",
        view=view,
        lobe_flags=before,
        lobe_share=share.astype(np.float32),
    )
    doubt = (share[:, :3] > 0).any(1) & (share[:, :3] < 1).any(1)
    assert (read(out, "lobe_flags", np.uint32) == before * doubt).all()
