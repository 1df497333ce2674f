"""`rsm_rays`: rays of the texels of reflective shadow maps, and what they find to be reflected [DS05]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.lights.test_light_samples import cells
from tests.passes.reference import rsm
from tests.passes.reference.lights import Area, random_area
from tests.passes.reference.rsm import FAR, Array, area_map, spot_map
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import HIT, MISS, RAY, RSM, record
from tests.passes.reference.surfaces import light_quad, pack, random_hits, random_mesh

STEM = "passes/lights/rsm_rays"
STRIDE = 16


def _maps(rng: np.random.Generator, resolution: int = 16, tiles: int = 2) -> NDArray[Any]:
    """A spot, and both sides of an area light."""
    light = random_area(rng)
    spot = spot_map(rng.normal(size=3), rng.normal(size=3), 35.0, resolution)
    sides = [area_map(light, tiles, resolution, back=back, number=1 + back) for back in (False, True)]
    return np.concatenate([spot, *sides])


def _rays(runner: Runner, maps: NDArray[Any], first: int, count: int) -> NDArray[Any]:
    params = record(RSM, first=first, stride=STRIDE)
    out = runner(STEM, count, params=params, maps=maps, rays=np.zeros(count, RAY))
    return read(out, "rays", RAY)


def _store(
    runner: Runner, maps: NDArray[Any], emitted: Array, hits: NDArray[Any], meshes: list[Any], first: int = 0
) -> Array:
    """Rows of all texels (n, 3, 4); those that are not asked for are 9."""
    count = sum(int(m["resolution"]) ** 2 for m in maps)
    out = runner(
        STEM,
        len(hits),
        entry="store",
        params=record(RSM, first=first, stride=STRIDE),
        maps=maps,
        emitted=emitted.astype(np.float32),
        hits=hits,
        rsm_texels=np.full((3 * count, 4), 9, np.float32),
        **pack(meshes),
    )
    return read(out, "rsm_texels", np.float32, count, 3, 4).astype(np.float64)


def _emitted(rng: np.random.Generator, maps: NDArray[Any]) -> tuple[Array, list[Array]]:
    """The list as shaders read it, in the order of strata, and row by row for each map."""
    made = np.full((len(maps) * STRIDE, 4), 7.0)
    each = []
    for number, m in enumerate(maps):
        tiles = int(m["tiles"])
        values = rng.uniform(0.5, 3, (tiles * tiles, 3)).astype(np.float32).astype(np.float64)
        each.append(values)
        cell = cells(tiles, tiles)
        made[number * STRIDE : number * STRIDE + tiles * tiles, :3] = values[cell[:, 1] * tiles + cell[:, 0]]
    return made, each


@pytest.mark.parametrize(("tiles", "first", "count"), [(1, 0, 768), (2, 100, 500), (4, 0, 768)])
def test_rays_go_through_the_middles_of_texels(
    runner: Runner, rng: np.random.Generator, tiles: int, first: int, count: int
) -> None:
    maps = _maps(rng, tiles=tiles)
    rays = _rays(runner, maps, first, count)
    expected = [rsm.starts_and_directions(maps[k : k + 1]) for k in range(len(maps))]
    start, way = (np.concatenate(parts)[first : first + count] for parts in zip(*expected, strict=True))
    angle = np.concatenate([rsm.solid_angles(maps[k : k + 1]) for k in range(3)])[first : first + count]
    sent = rays["t_max"] > rays["t_min"]
    assert (sent == (angle > 0)).all(), "what a cone leaves out is not asked"
    assert not sent.all()
    # the edge of the hemisphere rises steeply: an error of the place weighs by 1 / height
    assert_within(rays["direction"][sent], way[sent], 2e-4, "directions")
    assert np.median(np.abs(rays["direction"] - way)[sent]) < 2e-7
    assert_within(rays["origin"][sent], start[sent], 20 * ULP, "origins")
    assert_not_within(rays["direction"][sent], np.roll(way, 1, 0)[sent], 2e-4)
    if tiles > 1:
        assert_not_within(rays["origin"][sent], np.roll(start, 4, 0)[sent], 20 * ULP)


@pytest.mark.parametrize(("tiles", "first"), [(1, 0), (2, 200), (4, 0)])
def test_texels_hold_what_is_reflected(
    runner: Runner, rng: np.random.Generator, tiles: int, first: int
) -> None:
    maps, lamp = _maps(rng, tiles=tiles), random_area(rng)
    meshes = [random_mesh(rng, kind) for kind in ("rigid", "mirrored", "stretched")]
    meshes.append(light_quad(lamp, 0))
    count = 768 - first
    hits = random_hits(rng, meshes, count, misses=0.2)
    emitted, each = _emitted(rng, maps)
    found = _store(runner, maps, emitted, hits, meshes, first)
    assert (found[:first] == 9).all()
    whole = np.zeros(768, HIT)
    whole["instance"] = MISS
    whole[first:] = hits
    parts = [
        rsm.rows(maps[k : k + 1], each[k], meshes, whole[256 * k : 256 * (k + 1)]) for k in range(len(maps))
    ]
    expected, clear = (np.concatenate(p)[first:] for p in zip(*parts, strict=True))
    found = found[first:]
    # edge-on it is rounding that says which side is seen; a cosine's error weighs by the cosine in the area
    sure = clear > 1e-3
    assert sure.mean() > 0.95
    assert (expected[:, 0, 3] < FAR).mean() > 0.3
    assert (found[:, 0, 3] > 1e38).tolist() == (expected[:, 0, 3] > 1e38).tolist()
    assert_within(found[sure, 0], expected[sure, 0], 1e-5, "positions and distances")
    assert_within(found[sure, 1, :3], expected[sure, 1, :3], 2e-5, "normals")
    assert_within(found[:, 1, 3], expected[:, 1, 3], 2e-6 * expected[:, 1, 3], "solid angles")
    assert_within(found[sure, 2, :3], expected[sure, 2, :3], 2e-5 * expected[sure, 2, :3] + 1e-9, "flux")
    cosines = 5e-3 * expected[sure, 2, 3]
    assert_within(found[sure, 2, 3], expected[sure, 2, 3], cosines, "areas")
    error = np.abs(found[sure, 2, 3] / np.maximum(expected[sure, 2, 3], 1e-30) - 1)
    assert np.median(error[expected[sure, 2, 3] > 0]) < 1e-6
    if tiles > 1:
        wrong = [
            rsm.rows(maps[k : k + 1], each[k][::-1], meshes, whole[256 * k : 256 * (k + 1)])[0]
            for k in range(len(maps))
        ]
        other = np.concatenate(wrong)[first:][sure, 2, :3]
        assert_not_within(found[sure, 2, :3], other, 2e-5 * other + 1e-9)


def _angles(runner: Runner, map_: NDArray[Any]) -> Array:
    """Solid angles of the texels of a map whose rays all miss."""
    hits = np.zeros(int(map_["resolution"][0]) ** 2, HIT)
    hits["instance"] = MISS
    mesh = rsm.box(1.0, 1.0)
    return _store(runner, map_, np.ones((STRIDE, 4)), hits, [mesh])[:, 1, 3]


@pytest.mark.parametrize("degrees", [1.0, 20.0, 45.0, 80.0])
def test_texels_of_a_spot_sum_to_its_cone(runner: Runner, degrees: float) -> None:
    map_ = spot_map(np.zeros(3), np.array([0.3, -1, 0.2]), degrees, 64)
    angles = _angles(runner, map_)
    cone = rsm.cone_solid_angle(degrees)
    assert_within(angles.sum(), cone, 0.005 * cone, "the cone's solid angle")
    assert_not_within(angles.sum(), rsm.frustum_solid_angle(np.tan(np.radians(degrees))), 0.005 * cone)


@pytest.mark.parametrize("equal", [False, True])
def test_texels_of_a_frustum_sum_to_it(runner: Runner, equal: bool) -> None:
    """A right angle wide it is a sixth of all directions, 2π/3; its own, texels differ 5.16 to 1 (N18)."""
    map_ = spot_map(np.zeros(3), np.array([0, 0, 1.0]), 45.0, 256, equal=equal)
    map_["cos_cutoff"], map_["tan_half"] = -1, 1
    angles = _angles(runner, map_)
    assert_within(angles.sum(), 2 * np.pi / 3, 1e-4, "the frustum's solid angle")
    spread = angles.max() / angles.min()
    assert_within(spread, 1.0 if equal else 5.16, 0.01 * spread, "largest over smallest")
    mean = 2 * np.pi / 3 / 256**2
    if not equal:
        assert_within(angles.max() / mean, 1.91, 0.01, "middle over mean")
        assert_within(angles.min() / mean, 0.37, 0.01, "corner over mean")


def test_an_equal_solid_angle_is_that_of_the_frustum_cut_by_the_cone(runner: Runner) -> None:
    """Up to its cut the map of a cone is given 4/π of what fits: the option's own error [NSW09 Eq. 4]."""
    map_ = spot_map(np.zeros(3), np.array([0, 0, 1.0]), 45.0, 64, equal=True)
    expected = 2 * np.pi / 3 * np.pi / 4
    assert_within(_angles(runner, map_).sum(), expected, 0.005 * expected, "solid angle")


def _flux_in_a_box(runner: Runner, map_: NDArray[Any], emitted: Array, albedo: float) -> Array:
    """Total flux that a closed box reflects."""
    mesh = rsm.box(2.0, albedo)
    count = int(map_["resolution"][0]) ** 2
    map_["map"] = 0
    rays = _rays(runner, map_, 0, count)
    hits = rsm.first_hits(mesh, rays["origin"].astype(np.float64), rays["direction"].astype(np.float64))
    idle = rays["t_max"] <= rays["t_min"]
    assert (hits["instance"][~idle] == 0).all(), "the box is closed"
    hits[idle] = np.zeros(1, HIT)
    hits["instance"][idle] = MISS
    list_ = np.zeros((STRIDE, 4))
    list_[: len(emitted), :3] = emitted
    total: Array = _store(runner, map_, list_, hits, [mesh])[:, 2, :3].sum(0)
    return total


def test_a_closed_box_reflects_all_of_a_spot(runner: Runner) -> None:
    intensity = np.array([5.0, 3, 1])
    map_ = spot_map(np.array([0.3, 0.2, -0.5]), np.array([0.3, -1, 0.2]), 60.0, 128)
    expected = 0.5 * intensity * rsm.cone_solid_angle(60.0)
    assert_within(_flux_in_a_box(runner, map_, intensity[None], 0.5), expected, 0.005 * expected, "flux")


@pytest.mark.parametrize("tiles", [1, 4])
@pytest.mark.parametrize("back", [False, True])
def test_a_closed_box_reflects_all_of_an_area_light(runner: Runner, tiles: int, back: bool) -> None:
    """Whatever the parts emit: π times radiance times area of each, times the albedo."""
    light = Area(np.array([-0.5, 1, -0.25]), np.array([1.0, 0, 0]), np.array([0, 0, 0.5]), np.ones(3))
    parts = np.arange(1.0, 1 + tiles**2)[:, None] * np.array([1, 2, 3]) * light.area / tiles**2
    map_ = area_map(light, tiles, 64, back=back)
    expected = 0.5 * np.pi * parts.sum(0)
    total = _flux_in_a_box(runner, map_, parts, 0.5)
    assert_within(total, expected, 2e-5 * expected, "flux")
    assert_not_within(total, expected * 1.001, 2e-5 * expected)
