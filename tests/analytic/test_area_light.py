"""Direct light of area lights through the whole renderer, against Lambert's polygon formula."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike

import miplight as ml
from tests.analytic.closed_forms import (
    add_quad,
    floor_points,
    floor_scene,
    light_irradiance,
    polygon_irradiance,
    relative,
    view_down,
)

ALBEDO = np.array([0.8, 0.6, 0.4])
UP = np.array([0.0, 1, 0])


def lamp(
    radiance: ArrayLike = (5.0, 3.0, 1.0), height: float = 2.0, two_sided: bool = False, visible: bool = False
) -> ml.AreaLight:
    """A skew light above the floor that looks down and is not seen."""
    corner, edges = (-0.6, height, -0.4), ((1.2, 0.2, 0), (0.3, 0, 0.8))
    return ml.AreaLight(corner, *edges, radiance, two_sided=two_sided, visible=visible)


def _flipped(light: ml.AreaLight) -> ml.AreaLight:
    return ml.AreaLight(light.corner, light.edge_v, light.edge_u, light.radiance, visible=light.visible)


def test_polygon_formula_by_hand() -> None:
    """A tiny light straight above, a light that fills half the sky, one below the horizon, one cut by it."""
    origin = np.zeros(3)
    tiny = np.array([(-0.5, 100, -0.5), (0.5, 100, -0.5), (0.5, 100, 0.5), (-0.5, 100, 0.5)])
    assert polygon_irradiance(origin, UP, tiny) == pytest.approx(1e-4, rel=1e-3)
    huge = tiny * [1e4, 1e-2, 1e4]
    assert polygon_irradiance(origin, UP, huge) == pytest.approx(np.pi, rel=1e-3)
    assert polygon_irradiance(origin, UP, -tiny) == 0
    # an endless wall up from the horizon covers half of the sky: E = π/2
    wall = np.array([(1, -9, -1e4), (1, -9, 1e4), (1, 1e4, 1e4), (1, 1e4, -1e4)])
    assert polygon_irradiance(origin, UP, wall) == pytest.approx(np.pi / 2, rel=1e-3)
    # two parallel unit squares one unit apart: the view factor is 0.1998
    side = (np.arange(20) + 0.5) / 20
    above = np.array([(0.0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)])
    factors = [polygon_irradiance(np.array([x, 0, z]), UP, above) for x in side for z in side]
    assert np.mean(factors) / np.pi == pytest.approx(0.1998, abs=2e-4)


def test_a_floor_under_a_light(renderer: ml.Renderer, grid: ml.Settings) -> None:
    light, camera = lamp(), view_down()
    assert light.normal[1] < 0
    frame = renderer.render(floor_scene(light), camera, grid)
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    found = frame.image.reshape(-1, 3)
    assert relative(found, expected).max() < 2e-4
    assert relative(found, expected * 1.001).max() > 2e-4
    assert (frame.image == frame.direct).all()
    assert not frame.indirect.any()


def test_jittered_samples_have_no_bias(renderer: ml.Renderer) -> None:
    light, camera = lamp(), view_down(48, 40)
    frame = renderer.render(floor_scene(light), camera, "brute-force")
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    found = frame.image.reshape(-1, 3).astype(np.float64)
    assert relative(found, expected).mean() < 2e-3
    assert abs((found - expected).mean() / expected.mean()) < 2e-4
    assert abs((found - 1.001 * expected).mean() / expected.mean()) > 2e-4


def test_a_ball_cut_by_its_horizon(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """Faces of every slope: for many the light is half below their horizon, for many it is not seen."""
    scene, light = ml.Scene(), lamp(height=1.6)
    ball = trimesh.creation.icosphere(2, 0.5)
    scene.add_mesh(ball, name="ball", material=ml.Material(ALBEDO), shading="flat")
    scene.add_light(light)
    camera = ml.Camera.look_at((0.3, 1.2, 2), (0, 0, 0), fov_y=32, width=40, height=40)
    frame = renderer.render(scene, camera, grid, keep=("triangle",))
    seen = frame.surface_mask
    face = frame["triangle"][seen]
    normals = ball.face_normals[face]
    expected = ALBEDO / np.pi * light_irradiance(light, frame.position[seen].astype(np.float64), normals)
    off = relative(frame.image[seen], expected)
    # a stratum at the horizon counts or not: at most a row of 32 of them, at grazing angles
    assert off.max() < 4e-3
    assert off.mean() < 2e-4
    assert 0.1 < (expected.max(axis=1) == 0).mean() < 0.9
    unclipped = np.array([abs(n @ UP) for n in normals])[:, None] * expected
    assert relative(frame.image[seen], unclipped).mean() > 2e-4


def test_the_back_of_a_light_is_dark(renderer: ml.Renderer, grid: ml.Settings) -> None:
    camera = view_down()
    lit = renderer.render(floor_scene(lamp()), camera, grid).image
    assert lit.min() > 0
    assert not renderer.render(floor_scene(_flipped(lamp())), camera, grid).image.any()

    seen = _flipped(lamp(visible=True))
    scene = ml.Scene()
    scene.add_light(seen)
    above = renderer.render(scene, camera, grid)
    assert above.light_mask.any()
    assert (above.image[above.light_mask] == seen.radiance).all(), "its lit side looks up"
    scene = ml.Scene()
    scene.add_light(lamp(visible=True))
    below = renderer.render(scene, camera, grid)
    assert (below.light_mask == above.light_mask).all()
    assert not below.image.any()


def test_a_two_sided_light_emits_alike(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """Floor and ceiling at the same distance; seen from both sides it shows its radiance."""
    camera = view_down(up=0.9)
    one = renderer.render(floor_scene(lamp(height=1.0)), camera, grid).image
    for light in (lamp(height=1.0), _flipped(lamp(height=1.0))):
        light.two_sided = True
        assert relative(renderer.render(floor_scene(light), camera, grid).image, one).max() < 1e-5
    shown = ml.AreaLight((-1, 1, -1), (2, 0, 0), (0, 0, 2), (1, 2, 3), two_sided=True)
    scene = ml.Scene()
    scene.add_light(shown)
    for height in (-3.0, 3.0):
        camera = ml.Camera.look_at((0, 1 + height, 0), (0, 1, 0), (0, 0, 1), 60, 9, 9)
        frame = renderer.render(scene, camera, grid)
        assert frame.light_mask[4, 4]
        assert (frame.image[frame.light_mask] == shown.radiance).all()
    one_sided = renderer.render(floor_scene(_flipped(lamp(height=1.0))), view_down(up=0.9), grid).image
    assert relative(one_sided, one).max() > 0.5


def test_an_invisible_light_is_no_surface(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """It is not seen and casts no shadow; a visible one does both. It lights the same."""
    spot = ml.SpotLight((0, 2, 0), (0, 0, 0), (30, 30, 30), 60)
    camera = view_down(up=3.0)
    alone = renderer.render(floor_scene(spot), camera, grid).image
    black = (0.0, 0.0, 0.0)
    unseen = renderer.render(floor_scene(spot, lamp(black, 1.0)), camera, grid)
    assert (unseen.image == alone).all()
    assert not unseen.light_mask.any()
    seen = renderer.render(floor_scene(spot, lamp(black, 1.0, visible=True)), camera, grid)
    assert seen.light_mask.any()
    free = seen.surface_mask
    shadow = free & (seen.image.max(axis=-1) == 0) & (alone.max(axis=-1) > 0)
    assert shadow.any(), "a visible light casts a shadow"
    assert (seen.image[free & ~shadow] == alone[free & ~shadow]).all()
    # the shadow is the light's outline seen from the spot, about twice its size on the floor
    light = lamp(black, 1.0)
    points = floor_points(camera)
    to = points - spot.position
    n = light.normal
    t = np.divide((light.corner - spot.position) @ n, to @ n)
    hit = spot.position + t.reshape(-1, 1) * to - light.corner
    ab = np.linalg.lstsq(np.stack([light.edge_u, light.edge_v], -1), hit.T, rcond=None)[0].T
    inside = np.logical_and(ab > 0, ab < 1).min(axis=1).reshape(free.shape)
    assert (shadow[free] == inside[free]).all()

    under = view_down(up=0.9)
    images = [
        renderer.render(floor_scene(lamp(height=1.0, visible=visible)), under, grid).image
        for visible in (False, True)
    ]
    assert (images[0] == images[1]).all()
    assert images[0].any()


def test_a_quad_between_light_and_floor(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """A wall that hides all of the light from one half of the floor, and nothing from the other."""
    light = ml.AreaLight((-3, 1, -0.5), (0, 0, 1), (0.5, 0.5, 0), (4, 4, 4), visible=False, two_sided=True)
    scene = floor_scene(light)
    add_quad(scene, (0, -0.1, -4), (0, 0, 8), (0, 3, 0), name="wall")
    camera = ml.Camera.look_at((0.01, 8, 0), (0.01, 0, 0), (0, 0, -1), 40, 24, 20)
    frame = renderer.render(scene, camera, grid)
    on_floor = np.abs(frame.position[..., 1]) < 1e-4
    beyond = on_floor & (frame.position[..., 0] > 1e-3)
    assert beyond.any()
    assert not frame.image[beyond].any()
    before = on_floor & (frame.position[..., 0] < -0.05)
    points = frame.position[before].astype(np.float64)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    assert relative(frame.image[before], expected).max() < 1e-3
