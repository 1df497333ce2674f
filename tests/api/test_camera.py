"""Cameras: conventions, bad input, immutability."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import miplight as ml


def project(camera: ml.Camera, point: Any) -> tuple[float, float, float]:
    """Column, row (pixel edges at whole numbers) and depth of a point, from API.md's words alone."""
    local = np.linalg.inv(camera.world_from_camera) @ np.append(np.asarray(point, float), 1.0)
    depth = -local[2]
    k = camera.K
    return k[0, 0] * local[0] / depth + k[0, 2], k[1, 1] * -local[1] / depth + k[1, 2], depth


def test_look_at_looks_down_minus_z_with_y_up() -> None:
    camera = ml.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=90, width=200, height=100)
    np.testing.assert_allclose(
        camera.world_from_camera, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]
    )
    assert camera.forward.tolist() == [0, 0, -1]
    assert project(camera, (0, 0, 0)) == pytest.approx((100, 50, 5))
    assert project(camera, (0, 5, 0)) == pytest.approx((100, 0, 5))  # 45 degrees up: the top edge
    assert project(camera, (5, 0, 0)) == pytest.approx((150, 50, 5))  # square pixels


def test_ray_directions_go_through_pixel_centres() -> None:
    camera = ml.Camera.look_at((1, 2, 3), (-2, 0, 1), up=(0.1, 1, 0), fov_y=50, width=7, height=5)
    rays = camera.ray_directions()
    assert rays.shape == (5, 7, 3)
    for row, column in ((0, 0), (2, 3), (4, 6)):
        seen = project(camera, camera.origin + 2.5 * rays[row, column])
        assert seen == pytest.approx((column + 0.5, row + 0.5, 2.5))


def test_intrinsics_as_in_the_api() -> None:
    k = [[120.0, 0.0, 30.5], [0.0, 110.0, 20.25], [0.0, 0.0, 1.0]]
    camera = ml.Camera.from_intrinsics(k, np.eye(4), 64, 48)
    assert camera.K.tolist() == k
    direction = camera.ray_directions()[10, 40]
    assert direction == pytest.approx(((40.5 - 30.5) / 120, -(10.5 - 20.25) / 110, -1))
    assert not camera.is_centered
    # the same camera by its field of view
    same = ml.Camera(np.eye(4), 60.0, 64, 48)
    assert ml.Camera.from_intrinsics(same.K, np.eye(4), 64, 48) == same
    assert same.fov_y == pytest.approx(60.0)
    assert camera != same


@pytest.mark.parametrize(
    "change",
    [
        {"fov_y": 0.0},
        {"fov_y": 180.0},
        {"fov_y": -30},
        {"fov_y": np.nan},
        {"fov_y": "wide"},
        {"width": 0},
        {"height": -1},
        {"width": 12.5},
        {"width": True},
        {"up": (0, 0, 1)},
        {"up": (0, 0, -3)},
        {"up": (0, 0, 0)},
        {"target": (0, 0, 5)},
        {"origin": (0, 0, np.inf)},
        {"origin": (0, 0)},
    ],
)
def test_bad_look_at(change: dict[str, Any]) -> None:
    good: dict[str, Any] = {"origin": (0, 0, 5), "target": (0, 0, 0)}
    name = next(iter(change))
    with pytest.raises(ml.SceneError, match=f"{name} is .*allowed"):
        ml.Camera.look_at(**{**good, **change})


def test_far_away_cameras_still_know_where_they_look() -> None:
    camera = ml.Camera.look_at((1e6, 0, 1e6 + 2), (1e6, 0, 1e6))
    assert camera.forward.tolist() == [0, 0, -1]


@pytest.mark.parametrize(
    ("matrix", "why"),
    [
        (np.diag([2.0, 2.0, 2.0, 1.0]), "scaled or sheared"),
        (np.diag([-1.0, 1.0, 1.0, 1.0]), "mirrored"),
        (np.diag([1.0, 1.0, 0.0, 1.0]), "inverted"),
        (np.eye(4) + np.eye(4, k=1) * 0.2, "allowed"),
        (np.full((4, 4), np.nan), "finite"),
        (np.eye(3), r"\(4, 4\)"),
        (None, r"\(4, 4\)"),
    ],
)
def test_bad_poses(matrix: Any, why: str) -> None:
    with pytest.raises(ml.SceneError, match=f"world_from_camera is .*{why}"):
        ml.Camera(matrix, 45, 8, 8)


def test_a_rounded_rotation_is_straightened_and_an_exact_one_kept() -> None:
    exact = ml.Camera.look_at((3, 4, 5), (0, 1, 0)).world_from_camera
    assert np.array_equal(ml.Camera(exact, 45, 8, 8).world_from_camera, exact)
    straight = ml.Camera(exact.round(4), 45, 8, 8).world_from_camera
    rotation = straight[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(straight, exact, atol=2e-4)
    single = ml.Camera(exact.astype(np.float32).T.copy().T, 45, 8, 8)
    np.testing.assert_allclose(single.world_from_camera, exact, atol=1e-6)


@pytest.mark.parametrize(
    "k",
    [
        np.eye(4),
        [[100, 0.5, 32], [0, 100, 24], [0, 0, 1]],
        [[0, 0, 32], [0, 100, 24], [0, 0, 1]],
        [[100, 0, 32], [0, -100, 24], [0, 0, 1]],
        [[100, 0, np.nan], [0, 100, 24], [0, 0, 1]],
    ],
)
def test_bad_intrinsics(k: Any) -> None:
    with pytest.raises(ml.SceneError, match="K is .*allowed"):
        ml.Camera.from_intrinsics(k, np.eye(4), 64, 48)


def test_immutable_equal_hashable_picklable() -> None:
    camera = ml.Camera.look_at((0, 1, 5), (0, 1, 0), fov_y=40, width=640, height=480)
    with pytest.raises(AttributeError, match="replace"):
        camera.width = 3  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        camera.world_from_camera[0, 0] = 2
    for other in (camera, ml.Camera.from_intrinsics([[50, 0, 3], [0, 60, 4], [0, 0, 1]], np.eye(4), 9, 8)):
        again = pickle.loads(pickle.dumps(other))
        assert again == other
        assert hash(again) == hash(other)
        assert not again.world_from_camera.flags.writeable
        assert copy.deepcopy(other) is other
    assert eval(repr(camera), {"Camera": ml.Camera}) == camera
    assert "from_intrinsics" in repr(other)


def test_replace() -> None:
    camera = ml.Camera.look_at((0, 1, 5), (0, 1, 0), fov_y=40, width=640, height=480)
    small = camera.replace(width=320, height=240)
    assert small.fov_y == pytest.approx(40)
    assert small.is_centered
    assert (small.width, small.height) == (320, 240)
    assert camera.replace(fov_y=50).fov_y == pytest.approx(50)
    assert camera.replace(world_from_camera=np.eye(4)).origin.tolist() == [0, 0, 0]
    assert camera.replace(K=[[9, 0, 1], [0, 9, 2], [0, 0, 1]]).K[0, 0] == 9
    assert camera.replace() == camera
    for bad in ({"fov": 3}, {"fov_y": 40, "K": np.eye(3)}, {"width": 0}):
        with pytest.raises(ml.SceneError):
            camera.replace(**bad)


def test_the_core_gets_what_it_asks_for() -> None:
    camera = ml.Camera(np.eye(4), 90, 8, 6)
    core = camera._core_camera()
    assert {name: core[name] for name in ("fx", "fy", "cx", "cy", "width", "height")} == {
        "fx": pytest.approx(3.0),
        "fy": pytest.approx(3.0),
        "cx": 4.0,
        "cy": 3.0,
        "width": 8,
        "height": 6,
    }
