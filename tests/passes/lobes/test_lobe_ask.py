"""`lobe_ask`: samples where many lie in the lobe, else places in the lobe that add up to its light."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.lobes.cases import receivers_of, samples_of
from tests.passes.reference.lobes import lobe_light, reflected, sums
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import RAY, record
from tests.passes.specular.test_lobe_integral import floor, screen

PARAMS = np.dtype([("first", "<u4"), ("strata", "<u4"), ("words", "<u4"), ("pad", "<u4")])


@pytest.mark.parametrize("exponent", [4.0, 60.0, 400.0])
@pytest.mark.parametrize("side", [5, 9])
def test_wide_lobes_ask_samples_and_narrow_ones_places(
    runner: Runner, rng: np.random.Generator, exponent: float, side: int
) -> None:
    view, points = floor(rng, exponent)
    light = screen(np.full((1, 1, 3), 2.0))
    count = len(points.position)
    samples, _ = samples_of(light)
    source = lobe_light(light, side)
    source["least"] = 0.01
    out = runner(
        "passes/lobes/lobe_ask",
        count,
        params=record(PARAMS, first=0, strata=256, words=8),
        source=source,
        view=view,
        receivers=receivers_of(points),
        points=samples,
        light_sums=sums(light),
        asked=np.full(8 * count, 7, np.uint32),
        rays=np.zeros(count * side**2, RAY),
        lobe_weights=np.full((count * side**2, 4), np.nan, np.float32),
    )
    asked = np.unpackbits(out["asked"].reshape(count, -1), axis=1, bitorder="little").astype(bool)
    weights = read(out, "lobe_weights", np.float32, count, side**2, 4)
    to = samples[:, :3] - points.position[:, None]
    cosine = (to * points.mirror[:, None]).sum(-1) / np.linalg.norm(to, axis=-1)
    heights = np.where(cosine > 0, np.clip(cosine, 1e-30, None) ** exponent, 0)
    many = (heights >= 0.1).sum(1) * 25 >= 9 * side**2
    sure = np.abs((heights >= 0.101).sum(1) - (heights >= 0.099).sum(1)) == 0
    assert ((weights[:, 0, 3] == 0) == many)[sure].all()
    worth = (heights >= 1e-3) & many[:, None]
    close = np.abs(heights / 1e-3 - 1) < 1e-2
    assert (asked == worth)[sure[:, None] & ~close].all()

    few = ~many & sure
    if few.any():
        expected = reflected(light, points)[few] / points.color[few]
        found = weights[few, :, :3].sum(1)
        # a hundredth of the lobe is left out at its border, and places are few
        assert np.sqrt(np.mean((found - expected) ** 2)) < 0.06 * np.sqrt(np.mean(expected**2)) + 1e-6
    rays = read(out, "rays", RAY).reshape(count, -1)
    live = rays["t_max"] > rays["t_min"]
    assert (live == (weights[..., :3] > 0).any(-1)).all()
    if exponent == 4.0:
        assert many.any()
    if exponent == 400.0:
        assert few.any()
