"""`direct_estimator="ratio"`: exact where all of a light is seen, right in penumbrae."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml
from tests.analytic.closed_forms import (
    add_quad,
    floor_points,
    floor_scene,
    light_irradiance,
    relative,
    view_down,
)

ALBEDO = np.array([0.8, 0.6, 0.4])
UP = np.array([0.0, 1, 0])


def lamp(height: float = 2.0, *, two_sided: bool = False, visible: bool = False) -> ml.AreaLight:
    """A skew light above the floor that looks down."""
    corner, edges = (-0.6, height, -0.4), ((1.2, 0.2, 0), (0.3, 0, 0.8))
    return ml.AreaLight(corner, *edges, (5.0, 3.0, 1.0), two_sided=two_sided, visible=visible)


def ratio(samples: int) -> ml.Settings:
    """Few samples."""
    return ml.Settings.preset("brute-force").replace(direct_estimator="ratio", light_samples=samples)


@pytest.mark.parametrize("samples", [1, 16])
@pytest.mark.parametrize("height", [0.05, 2.0, 30.0])
def test_an_unshadowed_floor_is_exact(renderer: ml.Renderer, samples: int, height: float) -> None:
    """Also close to the light, where a sum over samples spikes (N2), and far away."""
    light = lamp(height)
    camera = view_down(up=min(3.0, height / 2))
    frame = renderer.render(floor_scene(light), camera, ratio(samples))
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    # rays start 32 roundings of the floor's half size above it
    bound = 2e-5 + 2 * 8e-6 / height
    assert relative(frame.image.reshape(-1, 3), expected).max() < bound
    assert relative(frame.image.reshape(-1, 3), expected * (1 + 2 * bound)).max() > bound


def test_a_ball_cut_by_its_horizon(renderer: ml.Renderer) -> None:
    scene, light = ml.Scene(), lamp(1.6)
    ball = trimesh.creation.icosphere(2, 0.5)
    scene.add_mesh(ball, name="ball", material=ml.Material(ALBEDO), shading="flat")
    scene.add_light(light)
    camera = ml.Camera.look_at((0.3, 1.2, 2), (0, 0, 0), fov_y=32, width=40, height=40)
    frame = renderer.render(scene, camera, ratio(64), keep=("triangle",))
    seen = frame.surface_mask
    normals = ball.face_normals[frame["triangle"][seen]]
    expected = ALBEDO / np.pi * light_irradiance(light, frame.position[seen].astype(np.float64), normals)
    assert relative(frame.image[seen], expected).max() < 3e-5
    assert 0.1 < (expected.max(axis=1) == 0).mean() < 0.9


def test_penumbrae_agree_with_the_sum_over_samples(renderer: ml.Renderer) -> None:
    """In half shadow both have the noise of visibility; in full light only the sum has any."""
    scene = floor_scene(lamp())
    add_quad(scene, (-0.4, 1, -0.3), (0.7, 0, 0), (0, 0, 0.6), name="board")
    camera = view_down(48, 40, up=0.9, fov_y=100)
    full = ml.Settings.preset("brute-force").replace(light_samples=4096, light_pattern="grid")
    truth = renderer.render(scene, camera, full).image.astype(np.float64)
    open_sky = renderer.render(scene, camera, full.replace(visibility="none")).image
    lit = (truth == open_sky).all(axis=-1)
    assert 0.1 < lit.mean() < 0.9
    images: list[NDArray[np.float64]] = [
        renderer.render(scene, camera, ratio(64).replace(direct_estimator=name)).image.astype(np.float64)
        for name in ("ratio", "samples")
    ]
    in_light, in_half = ([np.sqrt(((i - truth)[where] ** 2).mean()) for i in images] for where in (lit, ~lit))
    assert in_light[0] < 0.1 * in_light[1]
    assert in_half[0] < 1.05 * in_half[1]
    for image in images:
        assert abs(image.mean() / truth.mean() - 1) < 2e-3
    assert abs(open_sky.mean() / truth.mean() - 1) > 2e-3


def test_both_sides_and_backs(renderer: ml.Renderer) -> None:
    camera = view_down(up=0.9)
    one = renderer.render(floor_scene(lamp(1.0)), camera, ratio(16)).image
    assert one.min() > 0
    turned = ml.AreaLight((-0.6, 1, -0.4), (0.3, 0, 0.8), (1.2, 0.2, 0), (5.0, 3.0, 1.0), visible=False)
    assert not renderer.render(floor_scene(turned), camera, ratio(16)).image.any()
    turned.two_sided = True
    assert relative(renderer.render(floor_scene(turned), camera, ratio(16)).image, one).max() < 1e-5


def test_pictures_keep_their_samples(renderer: ml.Renderer) -> None:
    """A picture's radiance differs over the light: with samples enough both estimators agree."""
    texels = np.random.default_rng(3).uniform(0, 4, (4, 4, 3)).astype(np.float32)
    light = ml.AreaLight((-0.6, 0.8, -0.4), (1.2, 0, 0), (0, 0, 0.9), texels, visible=False)
    camera = view_down(up=0.7, fov_y=100)
    grid = ml.Settings.preset("brute-force").replace(light_pattern="grid", light_samples=1024)
    images = [
        renderer.render(floor_scene(light), camera, grid.replace(direct_estimator=estimator)).image
        for estimator in ("samples", "ratio")
    ]
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    for image in images:
        assert relative(image.reshape(-1, 3), expected).max() < 2e-3
    assert relative(images[0], images[1]).max() > 0


def test_spots_are_summed_as_ever(renderer: ml.Renderer) -> None:
    spot = ml.SpotLight((0, 2, 0), (0, 0, 0), (5, 5, 5), 40)
    images = [renderer.render(floor_scene(spot), view_down(), s).image for s in (ratio(4), "brute-force")]
    assert (images[0] == images[1]).all()
    assert images[0].any()
