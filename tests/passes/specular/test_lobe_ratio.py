"""`lobe_ratio`: the share of a lobe's light that is seen, and what comes of it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference.lobes import lobe_light
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import row
from tests.passes.specular.test_lobe_integral import SIDE, floor, screen

STEM = "passes/specular/lobe_ratio"
PIXELS = SIDE * SIDE


@pytest.mark.parametrize("side", [6, 20])
def test_shares_are_weighted_means(runner: Runner, rng: np.random.Generator, side: int) -> None:
    view, _ = floor(rng, 10.0)
    samples, chosen = side * side, rng.permutation(PIXELS)[:50]
    weights = rng.uniform(0, 1, (50, samples, 4)) ** 4
    weights[0] = 0
    hidden = rng.uniform(size=(50, samples)) < rng.uniform(size=(50, 1))
    hidden[1], hidden[2] = True, False
    bits = np.packbits(np.pad(hidden.ravel(), (0, -hidden.size % 32)), bitorder="little").view("<u4")
    out = runner(
        STEM,
        50,
        entry="shares",
        source=lobe_light(screen(np.ones((1, 1, 3))), side),
        view=view,
        lobe_list=chosen.astype(np.uint32),
        occluded=bits,
        lobe_weights=weights.reshape(-1, 4).astype(np.float32),
        lobe_share=np.full((PIXELS, 4), -1, np.float32),
    )
    found = read(out, "lobe_share", np.float32, PIXELS, 4)
    kept = weights[..., :3]
    expected = (kept * ~hidden[..., None]).sum(1) / np.maximum(kept.sum(1), 1e-30)
    expected[0] = 1
    assert_within(found[chosen, :3], expected, 100 * ULP, "shares")
    assert_not_within(found[chosen, :3], expected + 1e-3, 100 * ULP)
    assert (np.delete(found, chosen, axis=0) == -1).all(), "other pixels are left alone"


def _add(runner: Runner, rng: np.random.Generator, share: np.ndarray, light: np.ndarray) -> np.ndarray:
    view, points = floor(rng, 10.0)
    # a floor seen from above, pixel beside pixel
    points.position[:, 0], points.position[:, 2] = np.arange(PIXELS) % SIDE, np.arange(PIXELS) // SIDE
    out = runner(
        STEM,
        PIXELS,
        view=view,
        g_position=row(points.position, 0),
        g_normal=row(points.normal, 1),
        g_geometric=row(points.geometric, 0),
        lobe_surface=np.ones((PIXELS, 4), np.float32),
        lobe_share=share.astype(np.float32),
        lobe_light=light.astype(np.float32),
        specular_radiance=np.full((PIXELS, 4), 0.25, np.float32),
    )
    return read(out, "specular_radiance", np.float32, PIXELS, 4)[:, :3] - 0.25


def test_whole_and_hidden_lights_are_exact(runner: Runner, rng: np.random.Generator) -> None:
    light = rng.uniform(1, 2, (PIXELS, 4))
    share = rng.choice([0.0, 1.0], (PIXELS, 1)) * np.ones(4)
    found = _add(runner, rng, share, light)
    assert_within(found, (share * light)[:, :3], 1e-6, "light times share")


def test_fractions_are_smoothed_no_further_than_their_noise(runner: Runner, rng: np.random.Generator) -> None:
    """The least error of n stratified samples is n^(-3/4); half of that is allowed."""
    light = np.ones((PIXELS, 4))
    share = np.clip(0.5 + 0.2 * rng.normal(size=(PIXELS, 1)), 0.05, 0.95) * np.ones(4)
    found = _add(runner, rng, share, light)
    moved = np.abs(found - share[:, :3])
    assert (moved <= np.sqrt(share * (1 - share))[:, :3] / (0.5 * 8**1.5) + 1e-5).all()
    assert moved.max() > 0.02
    assert found.std() < share[:, 0].std()
