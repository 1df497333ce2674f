"""`lobe_gather`: sums over samples or places in the lobe, and colour times light."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.lobes.cases import receivers_of, samples_of
from tests.passes.reference.lobes import adds
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import NOTHING, SURFACE, record, row
from tests.passes.specular.test_lobe_integral import floor, screen

PARAMS = np.dtype(
    [
        ("first", "<u4"),
        ("strata", "<u4"),
        ("words", "<u4"),
        ("two_sided", "<u4"),
        ("normal", "<f4", 3),
        ("places", "<u4"),
    ]
)
STEM = "passes/lobes/lobe_gather"


@pytest.mark.parametrize("exponent", [3.0, 80.0])
def test_sums_agree_with_the_reference(runner: Runner, rng: np.random.Generator, exponent: float) -> None:
    side, places = 16, 25
    view, points = floor(rng, exponent, 0.1)
    light = screen(np.full((1, 1, 3), 2.0))
    count = len(points.position)
    samples, radiance = samples_of(light, side)
    seen_bits = rng.uniform(size=(count, side**2)) < 0.6
    weights = rng.uniform(0, 1, (count, places, 4))
    weights[..., 3] = (rng.uniform(size=count) < 0.5)[:, None]
    seen = rng.uniform(0, 1, (count, places))
    out = runner(
        STEM,
        count,
        entry="sum",
        params=record(PARAMS, first=0, strata=side**2, words=8, normal=light.normal, places=places),
        view=view,
        receivers=receivers_of(points),
        points=samples,
        light_radiance=radiance,
        asked=np.packbits(seen_bits, axis=1, bitorder="little").view("<u4"),
        lobe_weights=weights.reshape(-1, 4).astype(np.float32),
        lobe_seen=seen.ravel().astype(np.float32),
        lobe_fragments=np.full((count, 4), 0.5, np.float32),
    )
    found = read(out, "lobe_fragments", np.float32, count, 4)[:, :3] - 0.5
    middles = (np.arange(side) + 0.5) / side
    b, a = np.meshgrid(middles, middles, indexing="ij")
    ab = np.broadcast_to(np.stack([a.ravel(), b.ravel()], -1), (count, side**2, 2))
    by_samples = ((adds(light, points, ab) * seen_bits).sum(1) / side**2)[:, None] * light.mean
    by_places = (weights[..., :3] * seen[..., None]).sum(1)
    expected = np.where(weights[:, :1, 3] == 0, by_samples, by_places)
    bound = 2e-4 * expected + 1e-5
    assert_within(found, expected, bound, "light")
    assert_not_within(found, expected * 1.01, bound)


def test_colours_are_those_of_the_pixels(runner: Runner, rng: np.random.Generator) -> None:
    kinds, at = rng.choice([NOTHING, SURFACE, 2], 100), rng.integers(0, 4, 100)
    lobes = rng.uniform(0, 1, (4, 4)).astype(np.float32)
    image = rng.uniform(0, 3, (100, 4)).astype(np.float32)
    out = runner(
        STEM,
        100,
        entry="apply",
        g_normal=row(np.zeros((100, 3)), kinds),
        g_albedo=row(np.zeros((100, 3)), at),
        instance_lobes=lobes,
        lobe_image=image,
        specular_radiance=np.ones((100, 4), np.float32),
    )
    found = read(out, "specular_radiance", np.float32, 100, 4)[:, :3]
    expected = 1 + np.where((kinds == SURFACE)[:, None], lobes[at, :3] * image[:, :3], 0)
    assert_within(found, expected, 1e-6, "radiance")
