"""`point_smooth`: means of neighbouring points, as far as each holds at the other [WH92]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import gather_points as gp
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import VIEW, record

Array = NDArray[np.float64]
COLUMNS, ROWS, LEVEL = 9, 7, 3
VIEW_OF = record(VIEW, width=8 * COLUMNS - 3, height=8 * ROWS - 5, fx=60.0, fy=60.0)
REACH = 0.8


def _run(
    runner: Runner, points: NDArray[Any], at: NDArray[np.uint32], blocks: NDArray[np.uint32]
) -> NDArray[Any]:
    out = runner(
        "passes/gather_points/point_smooth",
        len(blocks),
        params=gp.params(reach=REACH, first=2, count=len(blocks)),
        pyramid=pyramid_record(VIEW_OF, 4, level=LEVEL),
        blocks=blocks,
        point_at=at,
        points=points,
        smoothed=np.zeros_like(points),
    )
    return read(out, "smoothed", gp.GATHER_POINT)


def _grid(rng: np.random.Generator, share: float) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Blocks that have points, and the table of all levels' blocks."""
    columns, rows, first, count = sizes(int(VIEW_OF["width"][0]), int(VIEW_OF["height"][0]))[LEVEL]
    assert (columns, rows) == (COLUMNS, ROWS)
    blocks = np.flatnonzero(rng.uniform(size=count) < share).astype(np.uint32)
    at = np.zeros(first + count + 64, np.uint32)
    at[first + blocks] = 3 + np.arange(len(blocks))
    return blocks, at


def _expected(points: NDArray[Any], blocks: NDArray[np.uint32]) -> dict[str, Array]:
    own = points[2 : 2 + len(blocks)]
    row, column = np.divmod(blocks.astype(np.int64), COLUMNS)
    near = (np.abs(row[:, None] - row) <= 2) & (np.abs(column[:, None] - column) <= 2)
    p, n = own["position"].astype(np.float64), own["normal"].astype(np.float64)
    there = gp.holds(own[None], REACH, p[:, None], n[:, None], 0.0)
    here = gp.holds(own[:, None], REACH, p[None], n[None], 0.0)
    weights = np.where(near, np.minimum(there, here), 0)
    _, more, total = gp.mean_at(np.broadcast_to(own, (len(own), len(own))), weights, p, n)
    found = {}
    for channel, name in enumerate(gp.CHANNELS):
        light = weights @ own[name].astype(np.float64) + more[:, channel : channel + 1] * n
        found[name] = light / total[:, None]
        found[f"{name}_slope"] = weights @ own[f"{name}_slope"].astype(np.float64) / total[:, None]
    return found


@pytest.mark.parametrize("share", [1.0, 0.5, 0.1])
def test_means_agree_with_the_reference(runner: Runner, rng: np.random.Generator, share: float) -> None:
    blocks, at = _grid(rng, share)
    points = gp.random_points(rng, 2 + len(blocks), 0.3)
    found = _run(runner, points, at, blocks)[2 : 2 + len(blocks)]
    expected = _expected(points, blocks)
    for field, values in expected.items():
        # fourth powers of differences of positions
        assert_within(found[field], values, 1e-4 * np.abs(values).max(), field)
        if share == 1:
            assert_not_within(found[field], points[2:][field], 1e-4 * np.abs(values).max())
    for field in ("position", "normal", "inverse", "met"):
        assert (found[field] == points[2 : 2 + len(blocks)][field]).all()


def test_a_sloping_field_stays_as_it_is(runner: Runner, rng: np.random.Generator) -> None:
    """Linear light on a plane, points anywhere on it, at the border and with holes: nothing changes."""
    blocks, at = _grid(rng, 0.7)
    points = gp.random_points(rng, 2 + len(blocks))
    points["position"][:, 2] = 0
    points["normal"] = (0, 0, 1)
    points["inverse"], points["met"] = 5, 10
    slope = np.array([0.3, -0.2, 0.0])
    light = 3 + points["position"].astype(np.float64) @ slope
    for name in gp.CHANNELS:
        points[name] = light[:, None] * np.array([0, 0, 1.0])
        points[f"{name}_slope"] = slope
    found = _run(runner, points, at, blocks)[2 : 2 + len(blocks)]
    assert_within(found["red"][:, 2], light[2:], 1e-5 * light.max(), "light")
    for name in gp.CHANNELS:
        points[f"{name}_slope"] = 0
    flat = _run(runner, points, at, blocks)[2 : 2 + len(blocks)]
    assert_not_within(flat["red"][:, 2], light[2:], 1e-3 * light.max())
