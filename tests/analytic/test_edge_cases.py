"""Scenes with something missing or in the way: a correct frame, perhaps a black one."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml
from tests.analytic.closed_forms import floor_scene, view_down

CAMERA = view_down(10, 8)


@pytest.fixture
def settings() -> ml.Settings:
    """Everything that a frame may have."""
    return ml.Settings.preset("brute-force").replace(
        light_samples=16, indirect="final-gather", gather_rays=4, bounces=2
    )


def lamp() -> ml.AreaLight:
    """A light above the floor that looks down."""
    return ml.AreaLight((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), (3, 3, 3))


def test_without_lights_it_is_dark(renderer: ml.Renderer, settings: ml.Settings) -> None:
    frame = renderer.render(floor_scene(), CAMERA, settings)
    assert frame.surface_mask.all()
    assert not frame.image.any()
    assert np.allclose(frame.depth, 3)
    assert np.allclose(frame.albedo, (0.8, 0.6, 0.4))


def test_without_meshes_only_lights_are_seen(renderer: ml.Renderer, settings: ml.Settings) -> None:
    scene = ml.Scene()
    scene.add_light(ml.AreaLight((-0.5, 0, 0.5), (1, 0, 0), (0, 0, -1), (3, 2, 1)))
    frame = renderer.render(scene, CAMERA, settings)
    assert frame.light_mask.any()
    assert not frame.light_mask.all()
    assert (frame.image[frame.light_mask] == (3, 2, 1)).all()
    assert not frame.image[~frame.light_mask].any()
    assert np.isinf(frame.depth[~frame.light_mask]).all()
    assert not frame.direct.any()


def test_an_empty_scene_is_black(renderer: ml.Renderer, settings: ml.Settings) -> None:
    before = renderer.render(floor_scene(lamp()), CAMERA, settings).image
    frame = renderer.render(ml.Scene(), CAMERA, settings)
    assert before.any()
    assert not frame.image.any(), "nothing is left of the frame before"
    assert not (frame.light_mask | frame.surface_mask).any()
    assert np.isinf(frame.depth).all()


def test_a_camera_that_looks_away_sees_nothing(renderer: ml.Renderer, settings: ml.Settings) -> None:
    away = ml.Camera.look_at((0, 3, 0), (0, 9, 0), (0, 0, 1), 40, 10, 8)
    frame = renderer.render(floor_scene(lamp()), away, settings)
    assert not frame.image.any()
    assert not frame.surface_mask.any()
    assert frame.stats.light_evaluations == 0


def test_a_camera_inside_an_object_sees_its_inside(renderer: ml.Renderer, settings: ml.Settings) -> None:
    scene = floor_scene(lamp())
    scene.add_mesh(trimesh.creation.icosphere(2, 0.5), name="ball", shading="flat")
    inside = ml.Camera.look_at((0, 0.1, 0), (1, 0.1, 0), fov_y=60, width=12, height=12)
    frame = renderer.render(scene, inside, settings)
    assert frame.surface_mask.all()
    assert frame.depth.max() < 0.5
    to_wall = (frame.position - [0, 0.1, 0]) * frame.normal
    assert (to_wall.sum(axis=-1) < 0).all(), "normals look at the viewer"
    # the lower half of the ball is under the floor, which cuts through it: nothing but the ball lets light in
    assert not frame.image.any()
    scene.add_light(ml.SpotLight((0, 0.2, 0), (1, 0.2, 0), (1, 1, 1), 60))
    assert renderer.render(scene, inside, settings).image.any()


def test_lights_behind_everything_light_nothing(renderer: ml.Renderer, settings: ml.Settings) -> None:
    """Below the floor, on the far side of what is seen; and a spot that looks the other way."""
    below = ml.AreaLight((-0.5, -2, -0.5), (0, 0, 1), (1, 0, 0), (3, 3, 3), two_sided=True)
    away = ml.SpotLight((0, 1, 0), (0, 5, 0), (9, 9, 9), 70)
    frame = renderer.render(floor_scene(below, away), CAMERA, settings)
    assert frame.surface_mask.all()
    assert not frame.image.any()


def test_a_light_lying_in_the_floor_does_not_light_it(renderer: ml.Renderer, settings: ml.Settings) -> None:
    flat = ml.AreaLight((-0.5, 0, 0.5), (1, 0, 0), (0, 0, -1), (3, 3, 3), two_sided=True, visible=False)
    frame = renderer.render(floor_scene(flat), CAMERA, settings.replace(indirect="off"))
    assert frame.image.max() < 1e-3
    assert np.isfinite(frame.image).all()


def test_a_camera_on_a_surface_or_on_a_light(renderer: ml.Renderer, settings: ml.Settings) -> None:
    """Where a distance is zero, numbers stay finite."""
    scene = floor_scene(lamp(), ml.SpotLight((0, 0, 0), (0, 1, 0), (1, 1, 1), 40))
    for origin in ((0, 0, 0), (0, 2, 0), (0.3, 1e-7, 0.2)):
        camera = ml.Camera.look_at(origin, (1, 1, 1), fov_y=60, width=8, height=8)
        image = renderer.render(scene, camera, settings).image
        assert np.isfinite(image).all()


@pytest.mark.parametrize("fov_y", [1e-3, 179.0])
def test_extreme_fields_of_view(renderer: ml.Renderer, settings: ml.Settings, fov_y: float) -> None:
    camera = ml.Camera.look_at((0, 3, 0), (0, 0, 0), (0, 0, -1), fov_y, 15, 15)
    frame = renderer.render(floor_scene(lamp()), camera, settings)
    assert np.isfinite(frame.image).all()
    assert frame.depth[7, 7] == pytest.approx(1.0 if frame.light_mask[7, 7] else 3.0, rel=1e-5)


def test_hundreds_of_lights(renderer: ml.Renderer, settings: ml.Settings) -> None:
    """A hundred of each kind add up to the same as one of each a hundred times as bright."""
    many, one = floor_scene(), floor_scene()
    settings = settings.replace(indirect="off", light_pattern="grid")
    for _ in range(100):
        light = lamp()
        light.radiance, light.visible = (0.03, 0.03, 0.03), False
        many.add_light(light)
        many.add_light(ml.SpotLight((0.5, 2, 0), (0, 0, 0), (0.05, 0.05, 0.05), 50))
    bright = lamp()
    bright.visible = False
    one.add_light(bright)
    one.add_light(ml.SpotLight((0.5, 2, 0), (0, 0, 0), (5, 5, 5), 50))
    images = [renderer.render(scene, CAMERA, settings).image for scene in (many, one)]
    assert np.allclose(images[0], images[1], rtol=2e-5)
