"""Lights as float64 geometry, and the table of them that shaders read."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .pictures import emitted

Array = NDArray[np.float64]
ROWS = 6


def single(value: ArrayLike) -> Array:
    """Numbers as float32 holds them, so that only the shader's own rounding is compared."""
    rounded: Array = np.asarray(value, np.float32).astype(np.float64)
    return rounded


@dataclasses.dataclass
class Area:
    """The parallelogram corner + a·u + b·v, lit on the side of u × v; radiance (3,) or a picture."""

    corner: Array
    u: Array
    v: Array
    radiance: Array
    two_sided: bool = False
    linear: bool = False

    def __post_init__(self) -> None:
        self.corner, self.u, self.v = single(self.corner), single(self.u), single(self.v)
        self.radiance = single(self.radiance)

    @property
    def area(self) -> float:
        """Of one side."""
        return float(np.linalg.norm(np.cross(self.u, self.v)))

    @property
    def normal(self) -> Array:
        """Unit normal of the lit side."""
        across: Array = np.cross(self.u, self.v) / self.area
        return across

    @property
    def mean(self) -> Array:
        """Mean radiance."""
        return self.radiance if self.radiance.ndim == 1 else self.radiance.mean(axis=(0, 1))

    def point(self, ab: NDArray[Any]) -> Array:
        """Points at (..., 2) places a, b."""
        place: Array = self.corner + ab[..., :1] * self.u + ab[..., 1:2] * self.v
        return place

    def emitted(self, ab: NDArray[Any]) -> Array:
        """Radiance at (n, 2) places a, b."""
        if self.radiance.ndim == 1:
            return np.broadcast_to(self.radiance, (len(ab), 3))
        return emitted(self.radiance, ab, self.linear)

    def cosine(self, towards: NDArray[Any]) -> Array:
        """Cosine at the light for unit directions from the light, 0 on the side that does not emit."""
        cosine = towards @ self.normal
        return np.abs(cosine) if self.two_sided else np.clip(cosine, 0, None)


@dataclasses.dataclass
class Spot:
    """A point of this intensity inside the cone about `axis`."""

    position: Array
    axis: Array
    intensity: Array
    cos_cutoff: float

    def __post_init__(self) -> None:
        self.position, self.intensity = single(self.position), single(self.intensity)
        self.axis = single(self.axis / np.linalg.norm(self.axis))
        self.cos_cutoff = float(single(self.cos_cutoff))

    def lights(self, towards: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether unit directions from the light lie in its cone."""
        inside: NDArray[np.bool_] = towards @ self.axis >= self.cos_cutoff
        return inside


Light = Area | Spot


def table(lights: list[Light]) -> NDArray[np.float32]:
    """Six rows of four floats a light, then the texels of all pictures."""
    rows = np.zeros((len(lights) * ROWS, 4))
    texels: list[Array] = []
    first = len(rows)
    for i, light in enumerate(lights):
        r = rows[i * ROWS : (i + 1) * ROWS]
        if isinstance(light, Spot):
            r[0] = [*light.position, 1]
            r[1, 3] = 1
            r[3] = [*light.axis, 1]
            r[4] = [*light.intensity, light.cos_cutoff]
            continue
        r[0, :3], r[1, :3], r[2, :3], r[3, :3] = light.corner, light.u, light.v, light.normal
        r[1, 3], r[3, 3], r[4] = light.two_sided, light.area, [*light.mean, -2]
        r[5, 3] = light.linear
        if light.radiance.ndim == 3:
            height, width = light.radiance.shape[:2]
            r[5, :3] = first, width, height
            texels.append(np.pad(light.radiance.reshape(-1, 3), ((0, 0), (0, 1))))
            first += height * width
    return np.concatenate([rows, *texels]).astype(np.float32)


def random_area(rng: np.random.Generator, picture: tuple[int, int] | None = None, **options: Any) -> Area:
    """A parallelogram of about unit size near the origin, skew."""
    u, v = rng.normal(size=3), rng.normal(size=3)
    while np.linalg.norm(np.cross(u, v)) < 0.4:
        v = rng.normal(size=3)
    radiance = rng.uniform(0.1, 9, 3) if picture is None else rng.uniform(0, 9, (*picture, 3))
    return Area(rng.normal(size=3), u, v, radiance, **options)


def random_spot(rng: np.random.Generator, degrees: float = 40.0) -> Spot:
    """A spot near the origin."""
    axis = rng.normal(size=3)
    return Spot(rng.normal(size=3), axis, rng.uniform(1, 9, 3), float(np.cos(np.radians(degrees))))
