"""The pinhole camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._vectors import format_vector, unit
from .validate import as_count, as_matrix, as_number, as_numbers, as_vector, fail, freeze

__all__ = ["Camera"]

# A rotation read back from a text file is off by its last digits: up to here it is taken for the nearest one.
_ROTATION_SLACK = 1e-3
_ROTATION_EXACT = 1e-7
# Up and the viewing direction are parallel when the sine of their angle is below this.
_PARALLEL_SINE = 1e-6


class Camera:
    """A pinhole camera; immutable.

    Right-handed, as trimesh and glTF: it looks down its −Z, +Y is up. A pixel is shaded at its centre, and
    row 0 is at the top.

    Parameters
    ----------
    world_from_camera : array_like, (4, 4)
        Rigid transform (a rotation and a translation, column vectors), scene units, any dtype.
        A rotation that is off by rounding (up to 1e-3) is replaced by the nearest exact one.
    fov_y : float
        Vertical field of view, degrees, in (0, 180). Pixels are square.
    width, height : int
        Image size in pixels, 1 or more.

    Raises
    ------
    SceneError
        For a matrix that is not rigid (scaled, sheared or mirrored), a field of view outside (0, 180) or
        an empty image.

    Examples
    --------
    >>> import miplight as ml
    >>> camera = ml.Camera.look_at((0, 1, 5), (0, 1, 0), fov_y=40, width=640, height=480)
    >>> camera.replace(width=320, height=240)
    Camera.look_at(origin=(0, 1, 5), target=(0, 1, 4), up=(0, 1, 0), fov_y=40, width=320, height=240)
    """

    __slots__ = ("__weakref__", "_cx", "_cy", "_fx", "_fy", "_height", "_width", "_world_from_camera")

    _world_from_camera: NDArray[np.float64]
    _fx: float
    _fy: float
    _cx: float
    _cy: float
    _width: int
    _height: int

    def __init__(self, world_from_camera: ArrayLike, fov_y: float, width: int, height: int) -> None:
        angle = as_number(fov_y, "fov_y", above=0.0, below=180.0, unit="degrees")
        columns, rows = as_count(width, "width"), as_count(height, "height")
        focal = 0.5 * rows / math.tan(0.5 * math.radians(angle))
        self._assign(world_from_camera, (focal, focal, 0.5 * columns, 0.5 * rows), columns, rows)

    @classmethod
    def look_at(
        cls,
        origin: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0.0, 1.0, 0.0),
        fov_y: float = 45.0,
        width: int = 512,
        height: int = 512,
    ) -> Camera:
        """Place a camera at `origin` that looks at `target`.

        Parameters
        ----------
        origin, target : array_like, (3,)
            Scene units; they must differ.
        up : array_like, (3,), default (0, 1, 0)
            Direction that points up in the image; not along the view, any length but zero.
        fov_y : float, default 45
            Vertical field of view, degrees, in (0, 180).
        width, height : int, default 512
            Image size in pixels.

        Raises
        ------
        SceneError
            If `target` is `origin`, or `up` is zero or along the view; and as for `Camera`.
        """
        eye, aim, upward = as_vector(origin, "origin"), as_vector(target, "target"), as_vector(up, "up")
        if not np.abs(aim - eye).max() > 1e-15 * np.abs(eye).max():
            fail("target", aim, f"a point away from origin, {format_vector(eye)}")
        backward = unit(eye - aim)
        if not upward.any():
            fail("up", upward, "a direction, not zero")
        right = np.cross(unit(upward), backward)
        if np.linalg.norm(right) < _PARALLEL_SINE:
            fail("up", upward, f"a direction that is not along the view, {format_vector(-backward)}")
        right = unit(right)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = (
            right,
            np.cross(backward, right),
            backward,
            eye,
        )
        return cls(matrix, fov_y, width, height)

    @classmethod
    def from_intrinsics(cls, K: ArrayLike, world_from_camera: ArrayLike, width: int, height: int) -> Camera:
        """Take over a calibrated camera.

        Parameters
        ----------
        K : array_like, (3, 3)
            ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`` in pixels, with x = (column + 0.5 − cx) / fx, so the
            middle of the image is (width/2, height/2). Its axes are x right, y down, z forward; fx and fy are
            above 0, no skew.
        world_from_camera : array_like, (4, 4)
            As for `Camera`: the axes of this matrix are x right, y **up**, z **backward**. The pose of a
            camera that looks down +Z (OpenCV, COLMAP) is ``pose @ np.diag([1, -1, -1, 1])``.
        width, height : int
            Image size in pixels.

        Raises
        ------
        SceneError
            If `K` has another form; and as for `Camera`.
        """
        allowed = "a finite [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx and fy above 0, no skew"
        array = as_numbers(K, "K", allowed)
        if array.shape != (3, 3):
            fail("K", K, allowed)
        k = array.astype(np.float64)
        rest = k[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]]
        if not (np.isfinite(k).all() and (rest == (0, 0, 0, 0, 1)).all() and k[0, 0] > 0 and k[1, 1] > 0):
            fail("K", K, allowed)
        camera = object.__new__(cls)
        intrinsics = (float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]))
        camera._assign(world_from_camera, intrinsics, as_count(width, "width"), as_count(height, "height"))
        return camera

    def _assign(
        self,
        world_from_camera: ArrayLike,
        intrinsics: tuple[float, float, float, float],
        width: int,
        height: int,
    ) -> None:
        fields: dict[str, Any] = {
            "_world_from_camera": _as_rigid(world_from_camera),
            **dict(zip(("_fx", "_fy", "_cx", "_cy"), intrinsics, strict=True)),
            "_width": width,
            "_height": height,
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a Camera is immutable; use camera.replace({name}=…)")

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """Rigid transform from camera to world space: read-only float64 of shape (4, 4)."""
        return self._world_from_camera

    @property
    def width(self) -> int:
        """Image width, pixels."""
        return self._width

    @property
    def height(self) -> int:
        """Image height, pixels."""
        return self._height

    @property
    def fov_y(self) -> float:
        """Vertical field of view, degrees (of the whole image, even where its centre is shifted)."""
        below, above = (self._height - self._cy) / self._fy, self._cy / self._fy
        return math.degrees(math.atan(below) + math.atan(above))

    @property
    def K(self) -> NDArray[np.float64]:  # noqa: N802 (the letter that everyone uses)
        """Intrinsics ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``, pixels: float64 of shape (3, 3)."""
        return np.array([[self._fx, 0.0, self._cx], [0.0, self._fy, self._cy], [0.0, 0.0, 1.0]])

    @property
    def is_centered(self) -> bool:
        """Whether pixels are square and the view axis meets the middle: then `fov_y` says it all."""
        middle = self._cx == 0.5 * self._width and self._cy == 0.5 * self._height
        return middle and self._fx == self._fy

    @property
    def origin(self) -> NDArray[np.float64]:
        """Where the camera is, world space: read-only float64 of shape (3,)."""
        return self._world_from_camera[:3, 3]

    @property
    def forward(self) -> NDArray[np.float64]:
        """Unit vector along the view, world space: float64 of shape (3,)."""
        return -self._world_from_camera[:3, 2] + 0.0

    def ray_directions(self) -> NDArray[np.float64]:
        """Directions through the pixel centres, world space: float64 of shape (height, width, 3).

        Their length along the view axis is 1: origin + depth · direction is the point seen.
        """
        x = (np.arange(self._width) + 0.5 - self._cx) / self._fx
        y = (self._cy - np.arange(self._height) - 0.5) / self._fy
        local = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)
        directions: NDArray[np.float64] = local @ self._world_from_camera[:3, :3].T
        return directions

    def replace(self, **changes: Any) -> Camera:
        """Return a camera with some of `world_from_camera`, `fov_y`, `width`, `height`, `K` changed.

        A new size alone keeps what is seen from top to bottom (intrinsics are scaled with the height, and the
        centre stays at the same fraction of the image). `fov_y` and `K` exclude one another.
        """
        known = {"world_from_camera", "fov_y", "width", "height", "K"}
        unknown = sorted(set(changes) - known)
        if unknown or {"K", "fov_y"} <= set(changes):
            fail(
                "Camera.replace", ", ".join(changes), f"{', '.join(sorted(known))}; not K and fov_y together"
            )
        pose = changes.get("world_from_camera", self._world_from_camera)
        width = as_count(changes.get("width", self._width), "width")
        height = as_count(changes.get("height", self._height), "height")
        if "fov_y" in changes:
            return Camera(pose, changes["fov_y"], width, height)
        if "K" in changes:
            return Camera.from_intrinsics(changes["K"], pose, width, height)
        camera = object.__new__(Camera)
        scale = height / self._height
        centre = (self._cx * (width / self._width), self._cy * scale)
        camera._assign(pose, (self._fx * scale, self._fy * scale, *centre), width, height)
        return camera

    def _key(self) -> tuple[Any, ...]:
        intrinsics = (self._fx, self._fy, self._cx, self._cy, self._width, self._height)
        return (*intrinsics, tuple(self._world_from_camera.ravel().tolist()))

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if isinstance(other, Camera) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key())

    def __repr__(self) -> str:
        if not self.is_centered:
            pose = np.array2string(self._world_from_camera, separator=", ").replace("\n", "")
            return f"Camera.from_intrinsics({self.K.tolist()}, {pose}, {self._width}, {self._height})"
        origin, target = format_vector(self.origin), format_vector(self.origin + self.forward)
        up = format_vector(self._world_from_camera[:3, 1] + 0.0)
        size = f"width={self._width}, height={self._height}"
        return f"Camera.look_at(origin={origin}, target={target}, up={up}, fov_y={self.fov_y:.6g}, {size})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (np.array(self._world_from_camera), *self._key()[:6])

    def __copy__(self) -> Camera:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Camera:
        return self

    def _core_camera(self) -> dict[str, Any]:
        """Describe the camera as the core takes it."""
        names = ("fx", "fy", "cx", "cy", "width", "height")
        return {"world_from_camera": self._world_from_camera, **dict(zip(names, self._key(), strict=False))}


def _restore(pose: NDArray[np.float64], *values: Any) -> Camera:
    camera = object.__new__(Camera)
    fx, fy, cx, cy, width, height = values
    camera._assign(pose, (fx, fy, cx, cy), width, height)
    return camera


def _as_rigid(value: ArrayLike) -> NDArray[np.float64]:
    """Check a pose, and straighten what rounding has bent."""
    matrix = as_matrix(value, "world_from_camera")
    rotation = matrix[:3, :3]
    bent = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if bent > _ROTATION_SLACK or np.linalg.det(rotation) < 0:
        mirrored = "mirrored" if np.linalg.det(rotation) < 0 else "scaled or sheared"
        fail(
            "world_from_camera",
            matrix,
            f"a rotation and a translation, right-handed (this one is {mirrored})",
        )
    if bent <= _ROTATION_EXACT:
        return matrix
    left, _, right = np.linalg.svd(rotation)
    straight = np.array(matrix)
    straight[:3, :3] = left @ right
    return freeze(straight)
