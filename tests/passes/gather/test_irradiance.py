"""`irradiance`: E += L · E_polygon · share, each tile by the form of the integral that it needs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import irradiances as ir
from tests.passes.reference.gbuffers import GBuffer, random_gbuffer
from tests.passes.reference.lights import Area, random_area, random_spot
from tests.passes.reference.polygons import parallelogram_irradiance
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.reference.structs import SURFACE

Array = NDArray[np.float64]


def _polygons(light: Area, g: GBuffer) -> tuple[Array, Array]:
    """Unshadowed irradiance of unit radiance, and the distance in light sizes."""
    corner = light.corner - g.position
    emits = (g.kind == SURFACE) & (light.two_sided | (corner @ light.normal < 0))
    found = np.zeros(len(corner))
    for i in np.flatnonzero(emits):
        found[i] = parallelogram_irradiance(g.normal[i], g.geometric[i], corner[i], light.u, light.v)
    size = max(np.linalg.norm(light.u), np.linalg.norm(light.v))
    return found, np.linalg.norm(corner + (light.u + light.v) / 2, axis=1) / size


def _gap(light: Area, g: GBuffer) -> Array:
    """Distance from the light's nearest point or so, in light sizes."""
    from_corner = g.position - light.corner
    edges = np.stack([light.u, light.v])
    ab = np.linalg.solve(edges @ edges.T, edges @ from_corner.T).T.clip(0, 1)
    size = np.linalg.norm(edges, axis=1).max()
    return np.asarray(np.linalg.norm(light.point(ab) - g.position, axis=1) / size)


def _bound(scene: ir.Scene, light: Area, expected: Array, distance: Array) -> Array:
    """Near: angles to 1e-7 each, and cosines; far: the quadrature, and the rounding of cosines.

    A horizon that cuts a light at contact with it turns as fast as that is near: rounding of places,
    3e-7 / gap.
    """
    near = 1e-6 + np.where(
        (scene.flags[scene.tile_of] & ir.CLIPPED) != 0, 3e-7 / _gap(light, scene.gbuffer), 0
    )
    absolute = np.where(distance < 5.001, np.minimum(near, 3e-3), 1e-6 / distance**2)
    return np.asarray(1e-5 * expected + absolute[:, None])


@pytest.mark.parametrize("two_sided", [False, True])
def test_irradiance_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, two_sided: bool
) -> None:
    light = random_area(rng, two_sided=two_sided)
    scene = ir.scene(rng, light)
    before = rng.uniform(size=(len(scene.share), 4)).astype(np.float32)
    polygons, distance = _polygons(light, scene.gbuffer)
    unit, dark = polygons[:, None] * scene.seen, np.zeros_like(before)
    found = ir.irradiance(runner, scene, dark)[:, :3] / light.radiance
    bound = _bound(scene, light, unit, distance)
    assert ((unit > 0).any(axis=1)).mean() > 0.2
    assert_within(found, unit, bound, "irradiance")
    assert_not_within(found, unit * 1.0005, bound)
    assert_not_within(found, polygons[:, None] * np.ones(3), bound)
    added = ir.irradiance(runner, scene, before)[:, :3]
    assert_within(added, before[:, :3] + unit * light.radiance, 1e-6 + 10 * bound, "sums")


@pytest.mark.parametrize("light_size", [1e-6, 1e6])
def test_scale_does_not_matter(runner: Runner, rng: np.random.Generator, light_size: float) -> None:
    light = random_area(rng)
    scene = ir.scene(rng, light, (48, 40))
    sized = dataclasses.replace(
        light, corner=light.corner * light_size, u=light.u * light_size, v=light.v * light_size
    )
    g = dataclasses.replace(
        scene.gbuffer, position=(scene.gbuffer.position * light_size).astype(np.float32) * 1.0
    )
    scene = dataclasses.replace(scene, light=sized, gbuffer=g)
    unit, distance = _polygons(sized, g)
    unit = unit[:, None] * scene.seen
    found = ir.irradiance(runner, scene, np.zeros((len(unit), 4), np.float32))[:, :3] / light.radiance
    bound = _bound(scene, sized, unit, distance)
    assert_within(found, unit, bound, "irradiance")
    assert_not_within(found, 1.001 * unit, bound)


def test_tiles_are_listed_once_by_what_they_need(runner: Runner, rng: np.random.Generator) -> None:
    """In ascending order, those of no use left out, no tile named behind the last."""
    scene = ir.scene(rng, random_area(rng), (1000, 333))
    lists, arguments = ir.sort(runner, scene)
    flags = scene.flags
    use = ((flags & ir.FACING) != 0) & ((flags & ir.DARK) == 0)
    need = flags & (ir.NEAR | ir.FAR | ir.CLIPPED)
    kinds = [use & (need == k) for k in (ir.NEAR, ir.FAR, ir.NEAR | ir.CLIPPED)]
    kinds.append(use & ~np.any(kinds, axis=0))
    for listed, words, fours, wanted in zip(lists, arguments[:4], arguments[4:], kinds, strict=True):
        expected = np.flatnonzero(wanted)
        assert (fours == [-(-len(expected) // 4), 1, 1, len(expected)]).all()
        assert len(expected) > 100
        assert (words == [len(expected), 1, 1, len(expected)]).all()
        assert (listed[: len(expected)] == expected).all()
        assert (listed[len(expected) : len(expected) + ir.MOST_ROWS] == ir.NO_TILE).all()
    assert not (lists[0] == np.flatnonzero(flags)[: lists.shape[1]][:1]).all(), (
        "not all tiles are of one kind"
    )


def _flat(positions: Array, normal: Array) -> GBuffer:
    """One row of tiles: surfaces at (n, 3) positions, all turned the same way."""
    n = np.broadcast_to(normal, positions.shape).astype(np.float64)
    return GBuffer(positions, np.zeros(len(positions)), n, n, np.full(len(positions), SURFACE))


@pytest.mark.parametrize("entry", [0, ir.CLIPPED])
def test_contact_and_the_lights_own_plane_stay_finite(
    runner: Runner, rng: np.random.Generator, entry: int
) -> None:
    """On corners, edges, the inside and the plane about a light: never NaN, never above π."""
    light = Area(np.zeros(3), np.array([1.0, 0, 0]), np.array([0.25, 2, 0]), np.ones(3), two_sided=True)
    at = rng.choice([0, 0.5, 1, 3, -1e-7], (64 * 8, 3))
    position = light.corner + at[:, :1] * light.u + at[:, 1:2] * light.v
    position[:, 2] += rng.choice([0, 1e-7, -1e-7, 1e-20], len(at))
    for normal in (light.normal, -light.normal, np.array([1.0, 0, 0]), np.array([0.6, 0, -0.8])):
        own = np.full(len(at), ir.FACING | ir.NEAR | entry, np.uint32)
        scene = ir.classed(rng, light, (64, 8), _flat(position.astype(np.float32) * 1.0, normal), own)
        scene.flags[:] = ir.FACING | ir.NEAR | ir.LIT | entry
        found = ir.irradiance(runner, scene, np.zeros((len(at), 4), np.float32))
        assert (found >= 0).all()
        assert (found <= np.pi * (1 + 1e-6)).all()
        if abs(normal[2]) == 1:
            assert found.max() > 0.9 * np.pi, "some lie on the lit side, at contact"
        level = np.abs(position[:, 2]) < 1e-8
        outside = level & ((at[:, 0] > 2) | (at[:, 1] > 2))
        assert outside.any()
        assert found[outside].max() < 3e-6, "a light in the plane of the floor adds nothing"


def test_a_light_sinks_below_the_horizon_smoothly(runner: Runner, rng: np.random.Generator) -> None:
    """Turned through the horizon in small steps, irradiance only falls, and to zero (N4)."""
    angle = np.linspace(-0.9, 0.9, 2048)
    normal = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    light = Area(
        np.array([-2, -0.5, -0.5]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), np.ones(3), two_sided=True
    )
    g = dataclasses.replace(_flat(np.zeros((2048, 3)), light.normal), normal=normal, geometric=normal)
    own = np.full(2048, ir.FACING | ir.NEAR | ir.CLIPPED, np.uint32)
    # one row of the image is one turn
    scene = ir.classed(rng, light, (2048, 1), g, own)
    scene.flags[:] = ir.FACING | ir.NEAR | ir.CLIPPED | ir.LIT
    found = ir.irradiance(runner, scene, np.zeros((2048, 4), np.float32))[:, 0]
    steps = np.diff(found)
    assert (steps <= 1e-6).all()
    assert np.abs(steps).max() < 2e-3
    assert found[0] > 0.05
    assert found[-1] == 0


def test_spots_light_their_cone(runner: Runner, rng: np.random.Generator) -> None:
    size = (77, 50)
    g = random_gbuffer(rng, size[0] * size[1])
    spot = random_spot(rng, 60.0)
    own = np.where(g.kind == SURFACE, ir.FACING | ir.NEAR | ir.FAR | ir.CLIPPED, 0).astype(np.uint32)
    scene = ir.classed(rng, spot, size, g, own)
    d = spot.position - g.position
    far = np.linalg.norm(d, axis=1)
    w = d / far[:, None]
    cos_s, cos_geo = (w * g.normal).sum(axis=1), (w * g.geometric).sum(axis=1)
    lit = (g.kind == SURFACE) & (-w @ spot.axis >= spot.cos_cutoff) & (cos_s > 0) & (cos_geo > 0)
    sure = np.minimum(np.abs(-w @ spot.axis - spot.cos_cutoff), np.abs(cos_geo)) > 1e-6
    expected = (lit * cos_s / far**2)[:, None] * spot.intensity * scene.seen
    found = ir.irradiance(runner, scene, np.zeros((len(far), 4), np.float32))[:, :3]
    bound = 1e-5 * expected + 1e-6 / far[:, None] ** 2 * spot.intensity
    assert lit.mean() > 0.05
    assert_within(found[sure], expected[sure], bound[sure], "irradiance")
    assert_not_within(found[sure], 1.001 * expected[sure], bound[sure])
