"""`primary_rays`: one ray through the centre of every pixel, in tile order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import pixel_numbers, random_view, tile_order, view_directions
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import RAY, VIEW, record

SIZES = [(333, 217), (1, 9), (5, 1), (64, 64), (2049, 9), (1, 1)]


def _rays(runner: Runner, view: NDArray[Any], count: int | None = None) -> NDArray[Any]:
    count = int(view["tiled"][0]) if count is None else count
    rays = np.zeros(count, RAY)
    return read(runner("passes/geometry/primary_rays", count, view=view, rays=rays), "rays", RAY)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_rays_go_through_pixel_centres(
    runner: Runner, rng: np.random.Generator, width: int, height: int
) -> None:
    view = random_view(rng, width, height)
    rays = _rays(runner, view)
    at, pixels = tile_order(width, height), pixel_numbers(width, height)
    inside = pixels >= 0
    assert inside.sum() == width * height, "every pixel once"
    expected = view_directions(view, at)
    # a few roundings of numbers no larger than the direction's own components and the principal point
    size = 1.0 + np.abs(expected).max(axis=1, keepdims=True) + np.abs([view["cx"] / view["fx"]]).max()
    bound = 8 * ULP * (size + np.abs([view["cy"] / view["fy"]]).max())
    assert_within(rays["direction"][inside], expected[inside], bound[inside], "directions")
    assert (rays["origin"][inside] == view["eye"]).all()
    assert (rays["t_min"][inside] == 0).all()
    assert (rays["t_max"][inside] > 1e38).all()
    assert np.isfinite(rays["t_max"]).all()
    off = rays[~inside]
    assert (off["t_max"] < off["t_min"]).all(), "places outside of the image are inactive"

    shifted = view.copy()
    shifted["cx"] += 0.01
    assert_not_within(rays["direction"][inside], view_directions(shifted, at)[inside], bound[inside])


def test_the_middle_of_the_image_looks_along_the_view(runner: Runner) -> None:
    """A hand case: 2 × 2 pixels, 90° of view: directions (±1/2, ±1/2, −1), the top row up."""
    view = record(
        VIEW, width=2, height=2, right=(1, 0, 0), up=(0, 1, 0), backward=(0, 0, 1), fx=1, fy=1, cx=1, cy=1
    )
    view["tiled"] = 64
    directions = _rays(runner, view)["direction"]
    hand = {0: (-0.5, 0.5, -1), 1: (0.5, 0.5, -1), 8: (-0.5, -0.5, -1), 9: (0.5, -0.5, -1)}
    for place, expected in hand.items():
        assert tuple(directions[place]) == expected


def test_a_part_of_the_image_has_the_same_rays(runner: Runner, rng: np.random.Generator) -> None:
    """A list may begin anywhere in the tile order."""
    view = random_view(rng, 100, 60)
    whole = _rays(runner, view)
    for first, count in ((64, 640), (1000, 1), (len(whole) - 64, 64)):
        view["first"] = first
        assert (_rays(runner, view, count) == whole[first : first + count]).all()
    assert not (whole[64:128] == whole[128:192]).all(), "another part has other rays"
