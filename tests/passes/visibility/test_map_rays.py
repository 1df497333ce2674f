"""`map_rays`: rays of the texels of a light's shadow maps, and the distances that come back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.shadow_maps import direction, place
from tests.passes.reference.structs import HIT, MAP, MISS, RAY, record

FAR = np.float32(1e30)


def _unit(rng: np.random.Generator) -> NDArray[np.float64]:
    v = rng.normal(size=3)
    made: NDArray[np.float64] = (v / np.linalg.norm(v)).astype(np.float32).astype(np.float64)
    return made


@pytest.mark.parametrize(("sides", "resolution", "first"), [(1, 8, 0), (2, 8, 64), (2, 13, 300)])
@pytest.mark.parametrize("tan_half", [0.0, 0.7])
def test_rays_go_through_the_middles_of_texels(
    runner: Runner, rng: np.random.Generator, sides: int, resolution: int, first: int, tan_half: float
) -> None:
    normal, count = _unit(rng), 500
    points = rng.normal(size=(20, 4)).astype(np.float32)
    shape = {"resolution": resolution, "sides": sides, "first": first, "tan_half": tan_half}
    params = record(MAP, normal=normal, offset=0.01, **shape)
    out = runner("passes/visibility/map_rays", count, params=params, points=points, rays=np.zeros(count, RAY))
    rays = read(out, "rays", RAY)
    texel = first + np.arange(count)
    within, number = texel % resolution**2, texel // resolution**2
    back = number % sides == 1
    ways = [
        direction(n, np.stack([within % resolution, within // resolution], -1), resolution, tan_half)
        for n in (normal, -normal)
    ]
    expected = np.where(back[:, None], ways[1], ways[0])
    start = points[number // sides, :3] + 0.01 * np.where(back, -1, 1)[:, None] * normal
    assert_within(rays["direction"], expected, 40 * ULP, "directions")
    assert_within(rays["origin"], start, 1e-6, "origins")
    assert (rays["t_min"] == 0).all()
    assert (rays["t_max"] == FAR).all()
    assert (rays["direction"] @ normal * np.where(back, -1, 1) > 0).all()
    assert_not_within(rays["direction"], np.roll(expected, 1, 0), 40 * ULP)


def test_a_frustum_holds_its_cone(rng: np.random.Generator) -> None:
    """The reference itself: of directions within the cone none lies outside, and no place is left out."""
    normal, tan_half, resolution = _unit(rng), 0.7, 16
    texels = np.stack(np.meshgrid(np.arange(resolution), np.arange(resolution)), -1).reshape(-1, 2)
    ways = direction(normal, texels, resolution, tan_half)
    assert_within(place(normal, ways, resolution, tan_half), texels + 0.5, 1e-5)
    d = rng.normal(size=(20000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    found = place(normal, d[d @ normal > 1 / np.sqrt(1 + tan_half**2)], resolution, tan_half)
    assert found.min() >= 0
    assert found.max() <= resolution
    assert found.min() < 0.2
    assert found.max() > resolution - 0.2


@pytest.mark.parametrize("resolution", [8, 13])
def test_the_map_is_a_square_over_the_whole_hemisphere(rng: np.random.Generator, resolution: int) -> None:
    """The reference itself: texels and directions are each other's inverse, and no place is left out."""
    normal = _unit(rng)
    texels = np.stack(np.meshgrid(np.arange(resolution), np.arange(resolution)), -1).reshape(-1, 2)
    back = place(normal, direction(normal, texels, resolution), resolution)
    assert_within(back, texels + 0.5, 1e-5)
    d = rng.normal(size=(4000, 3))
    d = d * np.sign(d @ normal)[:, None]
    found = np.floor(place(normal, d, resolution)).astype(int)
    assert len(np.unique(found, axis=0)) == resolution**2
    assert found.min() >= 0
    assert found.max() < resolution


def test_distances_are_stored_where_they_belong(runner: Runner, rng: np.random.Generator) -> None:
    count, first = 100, 37
    hits = np.zeros(count, HIT)
    hits["t"], hits["instance"] = rng.uniform(1, 5, count), 2
    hits["instance"][::7] = MISS
    params = record(MAP, resolution=8, sides=1, first=first)
    before = np.full(200, 9, np.float32)
    out = runner(
        "passes/visibility/map_rays", count, entry="store", params=params, hits=hits, distances=before
    )
    found = read(out, "distances", np.float32)
    expected = before.copy()
    expected[first : first + count] = np.where(hits["instance"] == MISS, FAR, hits["t"])
    assert (found == expected).all()
    assert (found[first::7][:10] == FAR).all()
