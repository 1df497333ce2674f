"""`bilateral`: pixels of the finest fragments take the light of the nodes around them on their surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, plane_gbuffer, wavy_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import RECEIVER, SURFACE

Array = NDArray[np.float64]
COARSEST, FINEST = 4, 2


def _nodes(
    rng: np.random.Generator, view: NDArray[Any], g: GBuffer
) -> tuple[NDArray[np.uint32], NDArray[Any], NDArray[np.int64]]:
    """A node for every texel of the coarsest level with a surface, and for the texels below half of them."""
    width, height = int(view["width"][0]), int(view["height"][0])
    levels = sizes(width, height)
    at = np.zeros(sum(row[3] for row in levels[: COARSEST + 1]), np.uint32)
    kinds = (g.kind == SURFACE).reshape(height, width)
    split = rng.uniform(size=(height // 16 + 1, width // 16 + 1)) < 0.6
    pixels: list[int] = []
    finest = np.zeros((height, width), np.int64)
    for level in range(COARSEST, FINEST - 1, -1):
        columns, lines, first, _ = levels[level]
        for y in range(lines):
            for x in range(columns):
                block = np.s_[y << level : (y + 1) << level, x << level : (x + 1) << level]
                parent = split[(y << level) // 16, (x << level) // 16]
                rows, cols = np.nonzero(kinds[block])
                if len(rows) == 0 or (level < COARSEST and not parent):
                    continue
                pick = rng.integers(len(rows))
                pixels.append(((y << level) + int(rows[pick])) * width + (x << level) + int(cols[pick]))
                at[first + y * columns + x] = len(pixels)
                finest[block] = level
    receivers = np.zeros(len(pixels), RECEIVER)
    receivers["origin"], receivers["normal_geo"] = g.origin[pixels], g.geometric[pixels]
    receivers["normal_shade"], receivers["pixel"] = g.normal[pixels], pixels
    return at, receivers, finest


def _alike(g: GBuffer, pixel: int, other: Any) -> bool:
    """Slope of the step over the tangent plane at most 1/2, normals less than 0.7 apart."""
    step = other["origin"].astype(np.float64) - g.position[pixel]
    off = abs(float(g.geometric[pixel] @ step))
    turned = float(np.linalg.norm(other["normal_shade"] - g.normal[pixel]))
    return off <= 0.5 * float(np.linalg.norm(step)) and turned < 0.7


def _smooth(
    view: NDArray[Any], g: GBuffer, at: Any, receivers: Any, finest: Any, light: Array, before: Array
) -> Array:
    width, height = int(view["width"][0]), int(view["height"][0])
    levels = sizes(width, height)
    out = before.copy()
    for pixel in np.flatnonzero((finest == FINEST).ravel() & (g.kind == SURFACE)):
        y, x = divmod(int(pixel), width)
        total, weight = np.zeros(3), 0.0
        for line in range((y >> FINEST) - 2, (y >> FINEST) + 3):
            for column in range((x >> FINEST) - 2, (x >> FINEST) + 3):
                if not (0 <= line < levels[FINEST][1] and 0 <= column < levels[FINEST][0]):
                    continue
                node = 0
                for level in range(FINEST, COARSEST + 1):
                    up = level - FINEST
                    node = node or int(
                        at[levels[level][2] + (line >> up) * levels[level][0] + (column >> up)]
                    )
                if node == 0 or not _alike(g, int(pixel), receivers[node - 1]):
                    continue
                there = divmod(int(receivers["pixel"][node - 1]), width)
                apart = ((there[0] - y) ** 2 + (there[1] - x) ** 2) / (0.6 * 2**FINEST) ** 2
                total += np.exp(-0.5 * apart) * light[node - 1]
                weight += float(np.exp(-0.5 * apart))
        if weight > 1e-12:
            out[pixel] = total / weight
    return out


def _run(
    runner: Runner, view: Any, g: GBuffer, at: Any, receivers: Any, finest: Any, light: Any, before: Any
) -> Any:
    level_map = np.where((g.kind == SURFACE).reshape(finest.shape), finest, 255)
    rows = g.rows()
    out = runner(
        "passes/upsample/bilateral",
        g.kind.size,
        pyramid=pyramid_record(view, COARSEST, FINEST),
        level_map=level_map.ravel().astype(np.uint32),
        node_at=at,
        node_receivers=receivers,
        node_irradiance=np.pad(light, ((0, 0), (0, 1))).astype(np.float32),
        direct_irradiance=np.pad(before, ((0, 0), (0, 1))).astype(np.float32),
        **rows,
    )
    return read(out, "direct_irradiance", np.float32, -1, 4)[:, :3]


@pytest.mark.parametrize("size", [(37, 21), (1, 40), (50, 3)])
def test_the_image_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=0.02, step=0.5)
    at, receivers, finest = _nodes(rng, view, g)
    light = rng.uniform(0, 2, (len(receivers), 3)).astype(np.float32).astype(np.float64)
    before = rng.uniform(0, 2, (g.kind.size, 3)).astype(np.float32).astype(np.float64)
    found = _run(runner, view, g, at, receivers, finest, light, before)
    expected = _smooth(view, g, at, receivers, finest, light, before)
    # a neighbour on the edge of being alike may fall either way
    off = (np.abs(found - expected) > 1e-4).any(axis=1)
    assert off.mean() < 0.01
    assert_within(found[~off], expected[~off], 1e-4, "irradiance")
    if (expected != before).any():
        assert_not_within(found, before, 1e-4)


def test_constant_light_stays_constant(runner: Runner, rng: np.random.Generator) -> None:
    view = random_view(rng, 40, 30)
    g = wavy_gbuffer(rng, view, holes=0.02, step=0.5)
    at, receivers, finest = _nodes(rng, view, g)
    light, before = np.full((len(receivers), 3), 0.7), np.full((g.kind.size, 3), 0.7)
    found = _run(runner, view, g, at, receivers, finest, light, before)
    assert_within(found, np.full_like(before, 0.7), 1e-6, "a constant")


def test_nothing_crosses_an_edge(runner: Runner, rng: np.random.Generator) -> None:
    """Two planes that stand on each other: each keeps its own light."""
    view = random_view(rng, 48, 32)
    g = plane_gbuffer(view, 20.0)
    right = np.arange(g.kind.size) % 48 >= 24
    other = np.cross(g.normal[0], (0.3, 0.8, 0.5))
    g.normal[right] = g.geometric[right] = other / np.linalg.norm(other)
    at, receivers, finest = _nodes(rng, view, g)
    light = np.where(right[receivers["pixel"]], 2.0, 1.0)[:, None] * np.ones(3)
    before = np.where(right, 2.0, 1.0)[:, None] * np.ones(3)
    found = _run(runner, view, g, at, receivers, finest, light, before)
    assert_within(found, before, 1e-6, "both sides")
