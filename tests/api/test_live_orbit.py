"""How a hand moves a camera and lights, against pinhole projection; and how small moving pictures become."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
from miplight.live_view.orbit import Orbit, light_center, move_light
from miplight.live_view.pace import SCALES, Pace

CAMERA = ml.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=40, width=64, height=48)
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def _pixel(camera: ml.Camera, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Column and row of a point: x right, y down, from K as `Camera.from_intrinsics` defines it."""
    x, y, z, _ = np.linalg.inv(camera.world_from_camera) @ np.append(point, 1.0)
    right, down, one = camera.K @ np.array([x, -y, -z])
    return np.array([right, down]) / one


def test_a_drag_turns_the_scene_with_the_hand() -> None:
    start = Orbit.around(CAMERA, BOX)
    np.testing.assert_allclose(start.target, 0, atol=1e-12)
    # half a height to the right is a quarter of a circle: what was at the left comes to the front
    quarter = start.turned(0.5, 0.0).camera
    np.testing.assert_allclose(quarter.origin, (-5, 0, 0), atol=1e-12)
    np.testing.assert_allclose(quarter.forward, (1, 0, 0), atol=1e-12)
    # downwards, its top comes to the front
    above = start.turned(0.0, 0.25).camera
    np.testing.assert_allclose(above.origin, 5 * np.array([0, 1, 1]) / math.sqrt(2), atol=1e-12)
    np.testing.assert_allclose(
        above.world_from_camera[:3, 1], np.array([0, 1, -1]) / math.sqrt(2), atol=1e-12
    )


def test_turning_keeps_the_target_the_distance_and_the_horizon(rng: np.random.Generator) -> None:
    skew = ml.Camera.look_at((3, 2, 4), (0.5, 0.2, 0), fov_y=40, width=64, height=48)
    orbit = Orbit.around(skew, BOX, target=(0.7, -0.3, 0.1))
    pixel, distance = _pixel(skew, orbit.target), orbit.distance
    for right, down in rng.uniform(-0.4, 0.4, (200, 2)):
        orbit = orbit.turned(right, down)
        assert orbit.distance == pytest.approx(distance, rel=1e-9)
        np.testing.assert_allclose(_pixel(orbit.camera, orbit.target), pixel, atol=1e-6)
        axes = orbit.camera.world_from_camera
        assert abs(axes[1, 0]) < 1e-9, "the horizon is not level"
        assert axes[1, 1] > 0, "upside down"
        assert abs(axes[1, 2]) <= math.cos(math.radians(2.99)), "beyond a pole"


def test_a_view_from_the_pole_and_another_up() -> None:
    down = ml.Camera.look_at((0, 5, 0), (0, 0, 0), up=(0, 0, -1), width=8, height=8)
    orbit = Orbit.around(down, BOX).turned(0.0, -0.25)  # upwards: the camera comes down
    np.testing.assert_allclose(orbit.camera.origin, 5 * np.array([0, 1, 1]) / math.sqrt(2), atol=1e-9)
    still = Orbit.around(down, BOX).turned(0.0, 0.25)
    np.testing.assert_allclose(still.camera.origin, (0, 5, 0), atol=1e-9)
    lying = ml.Camera.look_at((5, 0, 0), (0, 0, 0), up=(0, 0, 1), width=8, height=8)
    turned = Orbit.around(lying, BOX, up=(0, 0, 2)).turned(0.5, 0.0)
    np.testing.assert_allclose(turned.camera.origin, (0, -5, 0), atol=1e-12)


def test_pan_and_zoom() -> None:
    start = Orbit.around(CAMERA, BOX)
    panned = start.shifted(0.25, -0.5)
    moved = _pixel(panned.camera, start.target) - _pixel(CAMERA, start.target)
    np.testing.assert_allclose(moved, (0.25 * 48, -0.5 * 48), atol=1e-9)
    np.testing.assert_allclose(_pixel(panned.camera, panned.target), (32, 24), atol=1e-9)
    assert start.zoomed(2).distance == pytest.approx(5 * 0.81)
    np.testing.assert_allclose(start.zoomed(2).zoomed(-2).camera.origin, (0, 0, 5), atol=1e-12)
    assert start.zoomed(1e3).distance == pytest.approx(5e-3)
    assert start.zoomed(-1e3).distance == pytest.approx(5e3)


@pytest.mark.parametrize(
    "light",
    [
        ml.AreaLight((-0.5, 1.0, -0.5), (1, 0, 0), (0, 0, 1)),
        ml.SpotLight((0.4, 0.5, 2.0), (0, 0, 0), intensity=(5, 5, 5)),
    ],
    ids=["area", "spot"],
)
def test_a_light_follows_the_hand(light: ml.AreaLight | ml.SpotLight) -> None:
    orbit = Orbit.around(CAMERA, BOX)
    before = _pixel(CAMERA, light_center(light))
    moved = light.copy()
    move_light(moved, orbit.light_step(light, 0.125, 0.25))
    np.testing.assert_allclose(_pixel(CAMERA, light_center(moved)) - before, (6, 12), atol=1e-9)
    away = light.copy()
    move_light(away, orbit.light_step(light, 0.0, 0.0, 2.0))
    assert light_center(away)[2] < light_center(light)[2]
    if isinstance(moved, ml.SpotLight):
        np.testing.assert_array_equal(moved.target, (0, 0, 0))


def test_where_an_orbit_begins() -> None:
    inside = ml.Camera.look_at((0, 0, -0.9), (0, 0, -2), width=8, height=8)  # its back to the middle
    assert Orbit.around(inside, BOX).target[2] < -0.9
    assert Orbit.around(CAMERA, None).distance == 1.0
    with pytest.raises(ml.SceneError, match="target is"):
        Orbit.around(CAMERA, BOX, target=(0, 0, 5))
    with pytest.raises(ml.SceneError, match="up is"):
        Orbit.around(CAMERA, BOX, up=(0, 0, 0))


@pytest.mark.parametrize("fixed_ms", [0.0, 40.0, 80.0])
@pytest.mark.parametrize("full_ms", [20.0, 150.0, 900.0, 2500.0])
def test_moving_pictures_come_in_time_and_are_no_smaller_than_that(fixed_ms: float, full_ms: float) -> None:
    pace = Pace(budget_ms=125.0)

    def takes(scale: float) -> float:
        return fixed_ms + full_ms * scale**2

    scales = []
    for _ in range(400):
        scales.append(pace.scale)
        pace.took(takes(pace.scale), pace.scale)
    best = next((scale for scale in SCALES if takes(scale) <= 125.0), SCALES[-1])
    usual = max(set(scales[100:]), key=scales[100:].count)
    # what is larger by half may take 2.25 times as long, and is not tried when half of the time is gone
    allowed = SCALES[SCALES.index(best) : SCALES.index(best) + 2]
    assert usual in allowed
    assert scales[100:].count(usual) > 0.9 * 300, "it does not settle"
    assert sum(takes(scale) > 125.0 for scale in scales[30:]) < 0.03 * 370, "too many come too late"


def test_one_late_picture_is_luck_and_two_are_not() -> None:
    pace = Pace(budget_ms=125.0)
    for ms in (90.0, 90.0, 200.0, 90.0, 110.0, 200.0, 90.0):
        pace.took(ms, 1.0)
        assert pace.scale == 1.0
    pace.took(200.0, 1.0)
    pace.took(200.0, 1.0)
    assert pace.scale < 1.0
    pace.took(900.0, 1.0)  # a still picture, which says nothing about moving ones
    assert pace.scale >= 0.5


def test_indirect_light_is_left_out_where_no_size_helps() -> None:
    pace = Pace(budget_ms=125.0)
    pace.took(2000.0, 1.0, can_be_lean=True)
    assert pace.lean
    assert pace.scale == 1.0
    pace.forget()
    assert not pace.lean
    pace.took(2000.0, 1.0, can_be_lean=False)
    assert not pace.lean
    assert pace.scale < 0.3
    for _ in range(8):
        pace.took(2000.0, pace.scale)
    assert pace.at_the_end
