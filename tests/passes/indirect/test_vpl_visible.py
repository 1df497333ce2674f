"""`vpl_visible`: the share of its irradiance from virtual lights that a fragment sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import MISS, NOTHING, RECEIVER, SURFACE, VIEW, record, row

RAYS = 8


def _sum_up(
    runner: Runner, receivers: NDArray[Any], hidden: NDArray[np.bool_], weights: NDArray[np.float32]
) -> Any:
    count = len(receivers)
    out = runner(
        "passes/indirect/vpl_visible",
        count,
        entry="sum_up",
        params=np.array([RAYS, 0, 0, 0], np.uint32),
        receivers=receivers,
        occluded=np.packbits(hidden.reshape(-1), bitorder="little").view(np.uint32),
        ray_weights=weights,
        seen_sums=np.full((2 * count, 4), np.nan, np.float32),
    )
    return read(out, "seen_sums", np.float32, count, 2, 4)


def test_sums_what_arrives_and_what_was_asked(runner: Runner, rng: np.random.Generator) -> None:
    count = 256
    receivers = np.zeros(count, RECEIVER)
    receivers["pixel"] = rng.permutation(count)
    receivers["pixel"][7] = MISS
    hidden = rng.uniform(size=(count, RAYS)) < 0.4
    weights = rng.uniform(0, 2, (count * RAYS, 4)).astype(np.float32)
    sums = _sum_up(runner, receivers, hidden, weights)
    per_ray = weights.reshape(count, RAYS, 4)[..., :3].astype(np.float64)
    expected = np.stack([(per_ray * ~hidden[..., None]).sum(axis=1), per_ray.sum(axis=1)], axis=1)
    there = receivers["pixel"] != MISS
    got = sums[receivers["pixel"][there]][..., :3]
    assert_within(got, expected[there], 2 * RAYS * ULP * RAYS)
    assert_not_within(got[:, 0], expected[there, 1], 1e-3)
    assert np.isnan(sums[:, :, 0]).all(axis=1).sum() == 1


def _apply(
    runner: Runner,
    kinds: NDArray[Any],
    heights: NDArray[Any],
    sums: NDArray[np.float32],
    light: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Every pixel a fragment; a floor of steps seen from above, pixels a tenth of a unit wide."""
    height, width = kinds.shape
    y, x = np.indices(kinds.shape)
    position = np.stack([0.1 * x, 0.1 * y, heights], axis=-1).reshape(-1, 3)
    up = np.tile([0.0, 0.0, 1.0], (width * height, 1))
    view = record(VIEW, eye=[0, 0, 1], backward=[0, 0, 1], width=width, height=height, fx=10, fy=10)
    out = runner(
        "passes/indirect/vpl_visible",
        width * height,
        entry="apply",
        constants={"PIXELS": 1},
        pyramid=pyramid_record(view, 0),
        view=view,
        g_position=row(position, 0),
        g_normal=row(up, kinds.reshape(-1)),
        g_geometric=row(up, 0),
        sums=sums.reshape(-1, 4),
        irradiance=light,
        fragment_list=np.zeros(1, np.uint32),
        level_map=np.zeros(1, np.uint32),
        fragment_at=np.zeros(1, np.uint32),
    )
    return read(out, "irradiance", np.float32, height, width, 4)


def test_averages_over_neighbours_on_the_same_surface(runner: Runner, rng: np.random.Generator) -> None:
    height, width = 9, 13
    kinds = np.where(rng.uniform(size=(height, width)) < 0.9, SURFACE, NOTHING)
    heights = np.where(np.arange(width) < 6, 0.0, 5.0)[None] + np.zeros((height, 1))
    sums = rng.uniform(0.1, 1, (height, width, 2, 4)).astype(np.float32)
    sums[:, :, 0] *= sums[:, :, 1]
    light = rng.uniform(1, 2, (height * width, 4)).astype(np.float32)
    out = _apply(runner, kinds, heights, sums, light)
    weights = {(0, 0): 1.0, (0, 1): 1.0, (0, -1): 1.0, (1, 0): 1.0, (-1, 0): 1.0}
    for i in range(height):
        for j in range(width):
            before = light.reshape(height, width, 4)[i, j]
            if kinds[i, j] != SURFACE:
                assert (out[i, j] == before).all()
                continue
            total = np.zeros((2, 3))
            for di in (-1, 0, 1):
                for dj in (-1, 0, 1):
                    k, m = i + di, j + dj
                    inside = 0 <= k < height and 0 <= m < width
                    if inside and kinds[k, m] == SURFACE and heights[k, m] == heights[i, j]:
                        total += weights.get((di, dj), 0.5) * sums[k, m, :, :3].astype(np.float64)
            expected = before[:3] * total[0] / total[1]
            assert_within(out[i, j, :3], expected, 1e-5)


def test_all_seen_changes_nothing_and_nothing_asked_neither(runner: Runner, rng: np.random.Generator) -> None:
    kinds, heights = np.full((4, 4), SURFACE), np.zeros((4, 4))
    light = rng.uniform(1, 2, (16, 4)).astype(np.float32)
    sums = np.ones((4, 4, 2, 4), np.float32)
    assert_within(_apply(runner, kinds, heights, sums, light).reshape(16, 4), light, 1e-6)
    assert_within(_apply(runner, kinds, heights, 0 * sums, light).reshape(16, 4), light, 1e-6)
    sums[:, :, 0] = 0
    assert_within(_apply(runner, kinds, heights, sums, light).reshape(16, 4)[:, :3], np.zeros((16, 3)), 1e-6)
