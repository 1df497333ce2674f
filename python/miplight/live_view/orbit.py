"""How a hand moves a camera: around a point, along the picture, towards the point; and a light with it.

Distances of the hand are fractions of the picture's height, so that they mean the same at any size on a
screen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from trimesh.transformations import rotation_matrix

from miplight._vectors import unit
from miplight.camera import Camera
from miplight.light import AreaLight, Light
from miplight.validate import as_vector, fail

# A hand that goes over the whole height turns the camera by half a circle.
_TURN = math.pi
# The view keeps this far from straight up and straight down, where a drag to the side would only spin it.
_POLE = math.radians(3.0)
# One notch of a wheel, and how far zooming may go from where it began.
_NOTCH = 0.9
_NEAREST, _FARTHEST = 1e-3, 1e3
# A light behind the camera is moved as if it were this much of the target's distance in front of it.
_CLOSEST_LIGHT = 0.05


@dataclass(frozen=True, eq=False)
class Orbit:
    """A camera, the point that it turns around, and the direction that stays up.

    Parameters
    ----------
    camera
        From where.
    target
        (3,) float64, scene units.
    up
        (3,) float64, a unit vector.
    reach
        Distance between camera and target at the start, scene units.
    """

    camera: Camera
    target: NDArray[np.float64]
    up: NDArray[np.float64]
    reach: float

    @classmethod
    def around(
        cls,
        camera: Camera,
        bounds: NDArray[np.float64] | None,
        target: ArrayLike | None = None,
        up: ArrayLike = (0.0, 1.0, 0.0),
    ) -> Orbit:
        """Begin at `camera`.

        Parameters
        ----------
        camera
            Where to begin.
        bounds
            (2, 3) float64: the scene's box, or None for an empty scene.
        target
            (3,), scene units: what to turn around. By default the point of the view axis that is nearest to
            the middle of the scene's box.
        up
            (3,): the direction that stays up.

        Raises
        ------
        SceneError
            If `target` or `up` is no vector, `up` is zero, or `target` is where the camera is.
        """
        upward = as_vector(up, "up")
        if not upward.any():
            fail("up", upward, "a direction, not zero")
        origin, forward = camera.origin, camera.forward
        if target is not None:
            aim = as_vector(target, "target")
            if not np.linalg.norm(aim - origin) > 0:
                fail("target", aim, "a point away from the camera")
        else:
            aim = origin + _depth_of_box(origin, forward, bounds) * forward
        return cls(camera, aim, unit(upward), float(np.linalg.norm(aim - origin)))

    @property
    def distance(self) -> float:
        """Distance between camera and target, scene units."""
        return float(np.linalg.norm(self.target - self.camera.origin))

    def turned(self, right: float, down: float) -> Orbit:
        """Turn around the target, as if the hand held the scene; fractions of the picture's height."""
        pose = self.camera.world_from_camera
        yaw = rotation_matrix(-right * _TURN, self.up, self.target)
        forward = -pose[:3, 2]
        from_up = math.acos(float(np.clip(forward @ self.up, -1.0, 1.0)))
        # a view that begins beyond a pole may stay there, and come back
        lowest, highest = min(_POLE, from_up), max(math.pi - _POLE, from_up)
        angle = from_up - float(np.clip(from_up + down * _TURN, lowest, highest))
        level = np.cross(forward, self.up)
        axis = level if np.linalg.norm(level) > 1e-6 else pose[:3, 0]
        # of an upside-down camera right is left
        axis = axis if axis @ pose[:3, 0] >= 0 else -axis
        sign = 1.0 if np.cross(axis, forward) @ self.up >= 0 else -1.0
        pitch = rotation_matrix(sign * angle, axis, self.target)
        return replace(self, camera=self.camera.replace(world_from_camera=yaw @ pitch @ pose))

    def shifted(self, right: float, down: float) -> Orbit:
        """Move camera and target along the picture; what is at the target follows the hand."""
        step = -self.along_picture(right, down, self.distance)
        pose = np.array(self.camera.world_from_camera)
        pose[:3, 3] += step
        return replace(self, camera=self.camera.replace(world_from_camera=pose), target=self.target + step)

    def zoomed(self, notches: float) -> Orbit:
        """Move the camera towards the target, a tenth of the distance a notch; negative: away from it."""
        factor = _NOTCH ** float(np.clip(notches, -100.0, 100.0))
        allowed = np.clip(self.distance * factor, _NEAREST * self.reach, _FARTHEST * self.reach)
        pose = np.array(self.camera.world_from_camera)
        pose[:3, 3] = self.target + (pose[:3, 3] - self.target) * (float(allowed) / self.distance)
        return replace(self, camera=self.camera.replace(world_from_camera=pose))

    def along_picture(self, right: float, down: float, depth: float) -> NDArray[np.float64]:
        """Way in the scene of a hand over the picture, for what is `depth` scene units away: (3,) float64."""
        pose = self.camera.world_from_camera
        height = depth * self.camera.height / float(self.camera.K[1, 1])
        step: NDArray[np.float64] = height * (right * pose[:3, 0] - down * pose[:3, 1])
        return step

    def light_step(
        self, light: Light, right: float, down: float, notches: float = 0.0
    ) -> NDArray[np.float64]:
        """Way of a light that follows the hand, and goes away from the camera with a wheel: (3,) float64."""
        depth = float((light_center(light) - self.camera.origin) @ self.camera.forward)
        depth = max(depth, _CLOSEST_LIGHT * self.distance)
        away = (1.0 - _NOTCH) * notches * depth * self.camera.forward
        return self.along_picture(right, down, depth) + away


def light_center(light: Light) -> NDArray[np.float64]:
    """Middle of an area light, or position of a spot light: (3,) float64, scene units."""
    if isinstance(light, AreaLight):
        return np.asarray(light.corner + 0.5 * (light.edge_u + light.edge_v))
    return light.position


def move_light(light: Light, step: NDArray[np.float64]) -> None:
    """Move a light by `step`, (3,) scene units; a spot light goes on pointing at its target.

    Raises
    ------
    SceneError
        If a spot light would be at its target.
    """
    if isinstance(light, AreaLight):
        light.corner = light.corner + step
    else:
        light.position = light.position + step


def _depth_of_box(
    origin: NDArray[np.float64], forward: NDArray[np.float64], bounds: NDArray[np.float64] | None
) -> float:
    if bounds is None:
        return 1.0
    size = float(np.linalg.norm(bounds[1] - bounds[0]))
    depth = float((bounds.mean(axis=0) - origin) @ forward)
    # inside of the scene, or with its middle behind: something that is surely in front
    return depth if depth > 0.05 * size else max(0.25 * size, 1e-6)
