"""Views of every shape: fields of view from half a degree to 170, one pixel, row or column, near and far."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import add_quad, floor_scene, light_irradiance, view_down
from tests.fragment_rules import assert_partition
from tests.stress.common import (
    ALBEDO,
    PRESETS,
    Array,
    assert_sound,
    floor_light,
    lamp,
    quick,
    sized,
    worst,
)

# presets whose fragments may be coarse on a bare floor: they interpolate light over 16 pixels
COARSE = {"area-2016", "area-2010"}
SHAPES = [(1, 1), (2, 2), (1, sized(1024, 4096)), (sized(2048, 8192), 1)]


def _bound(preset: str) -> float:
    """Share of the brightest that a bare floor may be off: 64 samples, or the exact integral."""
    return 1e-4 if preset == "default" else 0.02


@pytest.mark.parametrize("fov_y", [0.5, 10.0, 120.0, 170.0])
@pytest.mark.parametrize("preset", PRESETS)
def test_any_field_of_view(renderer: ml.Renderer, preset: str, fov_y: float) -> None:
    light, camera = lamp(), view_down(40, 32, fov_y=fov_y)
    frame = renderer.render(floor_scene(light, size=200.0), camera, quick(preset))
    expected = floor_light(light, camera)
    assert_sound(frame)
    assert_partition(frame.fragments)
    culled = frame.surface_mask & (frame.fragments.level_map == 254)
    assert frame.direct[culled].max(initial=0.0) < 1e-6 * expected.max(), "what is culled is unlit"
    seen = frame.surface_mask
    assert seen.mean() > 0.9
    assert np.abs(frame.depth[seen] / 3.0 - 1).max() < 1e-5
    if preset in COARSE:
        _assert_between_neighbours(frame.direct, expected)
        return
    assert worst(frame.direct[seen], expected[seen]) < _bound(preset)
    assert worst(frame.direct[seen], 1.05 * expected[seen]) > _bound(preset), "negative control"


def _assert_between_neighbours(found: Array, expected: Array) -> None:
    """What is interpolated lies within what 48 pixels around have, and is not another light's."""
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(expected, ((24, 24), (24, 24), (0, 0)), mode="edge"), (49, 49), axis=(0, 1)
    )
    room = 0.02 * expected.max()
    assert (found >= windows.min(axis=(-2, -1)) - room).all()
    assert (found <= windows.max(axis=(-2, -1)) + room).all()
    if found.max() > 0.3 * expected.max():  # a peak between two fragments may be missed altogether
        swapped = found[..., ::-1]
        assert not (swapped <= windows.max(axis=(-2, -1)) + room).all(), "negative control"


@pytest.mark.parametrize("size", SHAPES, ids=str)
@pytest.mark.parametrize("preset", PRESETS)
def test_images_of_one_pixel_row_or_column(renderer: ml.Renderer, preset: str, size: tuple[int, int]) -> None:
    """The field of view spans 60 degrees of the longer side."""
    light, (width, height) = lamp(), size
    fov_y = 60.0 if height >= width else np.degrees(2 * np.arctan(np.tan(np.radians(30)) * height / width))
    camera = view_down(width, height, fov_y=float(fov_y))
    frame = renderer.render(floor_scene(light, size=20.0), camera, quick(preset))
    assert frame.image.shape == (height, width, 3)
    assert frame.surface_mask.all()
    assert_sound(frame)
    assert_partition(frame.fragments)
    expected = floor_light(light, camera)
    if preset in COARSE:
        _assert_between_neighbours(frame.direct, expected)
        return
    assert worst(frame.direct, expected) < _bound(preset)
    assert worst(frame.direct, 0.95 * expected) > _bound(preset), "negative control"


def _two_cards(near: float, far: float, *, around: bool) -> tuple[ml.Scene, list[ml.AreaLight]]:
    """Cards at two distances along −z, the near one in the left half of the view, each under its own lamp.

    `around`: another far wall behind the eye, which is then in the middle of the scene.
    """
    scene, lights = ml.Scene(), []
    for k, scale in enumerate((near, far)):
        corner = scale * np.array((-4.0, -4.0, -1.0))
        add_quad(scene, corner, (scale * (4.0 + 4 * k), 0, 0), (0, 8 * scale, 0), name=f"card {k}")
        place, edge = scale * np.array((-0.9 + k, -0.1, -0.6)), scale * np.array((0, 0.3, 0))
        light = ml.AreaLight(place, edge, (0.4 * scale, 0, 0), (4.0, 2.0, 1.0), visible=False)
        scene.add_light(light)
        lights.append(light)
    if around:
        add_quad(scene, (-4 * far, -4 * far, far), (8 * far, 0, 0), (0, 8 * far, 0), name="behind")
    return scene, lights


@pytest.mark.parametrize(
    ("near", "far", "around"), [(1e-3, 1e5, True), (1e-3, 10.0, False), (1e-3, 1e2, False)], ids=str
)
@pytest.mark.parametrize("preset", ["default", "brute-force"])
def test_near_and_far_in_one_view(
    renderer: ml.Renderer, preset: str, near: float, far: float, around: bool
) -> None:
    """Places are float32 numbers from the middle of the scene: that is what an eye at its rim may be off."""
    scene, lights = _two_cards(near, far, around=around)
    camera = ml.Camera.look_at((0, 0, 0), (0, 0, -1), fov_y=60, width=32, height=24)
    frame = renderer.render(scene, camera, quick(preset))
    assert frame.surface_mask.all()
    depth = np.where(np.arange(32) < 16, near, far)[None].repeat(24, axis=0)
    ulp = 0.0 if around else far * 2.0**-23
    assert (np.abs(frame.depth - depth) < 1e-6 * depth + ulp).all()
    rays = camera.ray_directions()
    points = (rays / -rays[..., 2:] * depth[..., None]).reshape(-1, 3)
    normals = np.tile((0.0, 0, 1), (len(points), 1))
    irradiance = np.sum([light_irradiance(light, points, normals) for light in lights], axis=0)
    expected = irradiance * ALBEDO / np.pi
    found = frame.direct.reshape(-1, 3)
    exact = preset == "default"
    for half, distance in ((points[:, 0] < 0, near), (points[:, 0] > 0, far)):
        # lamps are 0.4 distances away: E changes by five times what the distance does, and its cosines;
        # samples are asked from where rays start, which is a few ulp off the surface
        bound = (1e-4 if preset == "default" else 0.03) + 6 * ulp / distance * (2 if exact else 10)
        assert worst(found[half], expected[half]) < bound
        assert worst(found[half], expected[~half]) > bound, "negative control: the other card's light"
