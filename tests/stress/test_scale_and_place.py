"""Scale and place: every preset and every kind of indirect light, area lights and a spot."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import floor_scene, view_down
from tests.analytic.test_invariance import room, view
from tests.stress.common import PRESETS, floor_light, lamp, quick, sized, variants, worst

SIZE = sized((48, 36), (160, 120))
SCALES = sized([1e-4, 3e-3, 37.0, 1e5], [1e-4, 7e-4, 3e-3, 0.11, 37.0, 999.0, 2.3e4, 1e5])
BOUND = 1e-3  # of the acceptance table


def _image(renderer: ml.Renderer, settings: ml.Settings, matrix: np.ndarray, spot_scale: float) -> np.ndarray:
    camera = view(matrix, width=SIZE[0], height=SIZE[1])
    image = renderer.render(room(matrix, spot_scale), camera, settings).image
    assert np.isfinite(image).all()
    return image


def _off(found: np.ndarray, plain: np.ndarray) -> float:
    return ml.metrics.relative_rmse(found, plain, trim=0.001)


@pytest.mark.parametrize("name", variants())
def test_size_does_not_matter(renderer: ml.Renderer, name: str) -> None:
    """A scene with its lights in other units, a spot's intensity with the square of them."""
    settings = variants()[name]
    if settings.indirect == "splat":
        # a virtual light on an edge falls to either side as numbers round: a share of 1 in their number
        settings = settings.replace(vpls=4096)
    plain = _image(renderer, settings, np.eye(4), 1.0)
    for scale in SCALES:
        matrix = np.diag([scale, scale, scale, 1.0])
        assert _off(_image(renderer, settings, matrix, scale), plain) < BOUND, scale
    wrong = _image(renderer, settings, matrix, 1.01 * scale)
    assert _off(wrong, plain) > BOUND, "negative control: a spot a hundredth too bright"


@pytest.mark.parametrize("name", variants())
def test_place_does_not_matter(renderer: ml.Renderer, name: str) -> None:
    """A million units away, with vertices and camera in float64."""
    settings = variants()[name]
    plain = _image(renderer, settings, np.eye(4), 1.0)
    for shift in sized([(1e6, -2e6, 5e5)], [(1e6, -2e6, 5e5), (123.4, 0, 0), (-1e6, 1e6, 1e6), (0, 1e5, 0)]):
        matrix = np.eye(4)
        matrix[:3, 3] = shift
        assert _off(_image(renderer, settings, matrix, 1.0), plain) < BOUND, shift


@pytest.mark.parametrize("preset", PRESETS)
def test_float32_vertices_far_away_are_exact_where_they_can_be(renderer: ml.Renderer, preset: str) -> None:
    """Multiples of 1/16 are float32 numbers at 1e6, too: nothing may be lost on the way to the renderer."""
    shift = np.array([1e6, -1e6, 5e5])
    light = ml.AreaLight((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), (5.0, 3.0, 1.0), visible=False)
    moved = ml.AreaLight(light.corner + shift, light.edge_u, light.edge_v, light.radiance, visible=False)
    near, far = floor_scene(light), ml.Scene()
    floor = near.meshes["floor"]
    vertices = (floor.positions + shift).astype(np.float32)
    assert (vertices - shift == floor.positions).all()
    far.add_arrays(vertices, floor.triangles, material=floor.material, shading="flat")
    far.add_light(moved)
    camera = view_down(*SIZE)
    there = camera.world_from_camera.copy()
    there[:3, 3] += shift
    images = [
        renderer.render(scene, eye, quick(preset)).image
        for scene, eye in ((near, camera), (far, camera.replace(world_from_camera=there)))
    ]
    assert (images[0] == images[1]).all()
    assert worst(images[1], 1.03 * floor_light(light, camera)) > 0.02, "negative control"


@pytest.mark.parametrize("relative", [1e-3, 1e-6, 1e-7])
@pytest.mark.parametrize("preset", PRESETS)
def test_a_camera_a_hair_above_a_floor(renderer: ml.Renderer, preset: str, relative: float) -> None:
    """It sees one spot of the floor; the light there is Lambert's."""
    scale = 250.0
    light = lamp(size=scale)
    camera = view_down(12, 12, up=relative * scale)
    frame = renderer.render(floor_scene(light, size=8 * scale), camera, quick(preset))
    assert frame.surface_mask.all()
    expected = floor_light(light, camera)
    bound = 1e-4 if preset == "default" else 0.01
    assert worst(frame.direct, expected) < bound
    assert worst(frame.direct, 1.02 * expected) > bound, "negative control"
    depth = relative * scale
    # the floor is known to an ulp or so of its own size
    assert np.abs(frame.depth / depth - 1).max() < 1e-5 + 1e-7 / relative


@pytest.mark.parametrize("preset", PRESETS)
def test_a_camera_a_hair_beside_a_ball(renderer: ml.Renderer, preset: str) -> None:
    """Grazing along a curved surface, a millionth off it: finite, bounded, and the ball is seen."""
    scene = room(np.eye(4))
    ball = scene.meshes["ball"]
    corner = ball.positions[ball.triangles[0]].mean(axis=0)
    outwards = corner - ball.positions.mean(axis=0)
    outwards /= np.linalg.norm(outwards)
    for target in (np.cross(outwards, (0, 1, 0.1)), -outwards, outwards):
        eye = corner + 1e-6 * outwards
        camera = ml.Camera.look_at(eye, eye + target, (0.1, 1, 0.3), 80, 32, 24)
        frame = renderer.render(scene, camera, quick(preset))
        assert np.isfinite(frame.image).all()
        assert frame.image.min() >= 0
        assert frame.image.max() <= 1e3
