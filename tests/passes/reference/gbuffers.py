"""A G-buffer with random surfaces, lights and holes in it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .image import view_directions
from .structs import FIRST_LIGHT, NOTHING, SURFACE, bits, row

Array = NDArray[np.float64]


@dataclasses.dataclass
class GBuffer:
    """One row a pixel, as float64 of what float32 holds."""

    position: Array
    error: Array
    normal: Array
    geometric: Array
    kind: NDArray[np.int64]

    def rows(self) -> dict[str, NDArray[np.uint32]]:
        """The three bindings that shading reads."""
        return {
            "g_position": row(self.position, bits(self.error)),
            "g_normal": row(self.normal, self.kind),
            "g_geometric": row(self.geometric, 5),
        }

    @property
    def origin(self) -> Array:
        """Where rays leave: moved along the geometric normal by the bound of the position's error."""
        start: Array = self.position + self.geometric * self.error[:, None]
        return start


def random_gbuffer(
    rng: np.random.Generator, pixels: int, tilt: float = 0.2, surfaces: float = 0.7
) -> GBuffer:
    """Surfaces facing anywhere, their shading normals up to about `tilt` off the geometric ones."""
    geometric = rng.normal(size=(pixels, 3))
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    normal = geometric + tilt * rng.normal(size=(pixels, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    seen = rng.uniform(size=pixels) < surfaces
    other = rng.choice([NOTHING, FIRST_LIGHT, FIRST_LIGHT + 3], pixels)
    arrays = [rng.normal(size=(pixels, 3)) * 4, rng.uniform(1e-6, 1e-4, pixels), normal, geometric]
    position, error, normal, geometric = (a.astype(np.float32).astype(np.float64) for a in arrays)
    return GBuffer(position, error, normal, geometric, np.where(seen, SURFACE, other))


def wavy_gbuffer(
    rng: np.random.Generator, view: NDArray[Any], holes: float = 0.1, step: float = 0.0
) -> GBuffer:
    """A bumpy surface in front of a camera, 2 to 4 deep, with holes; the right half `step` deeper."""
    width, height = int(view["width"][0]), int(view["height"][0])
    rows, columns = np.divmod(np.arange(width * height), width)
    directions = view_directions(view, np.stack([columns, rows], axis=-1))
    wave = rng.uniform(0.05, 0.5, 2)
    depth = 3 + np.sin(columns * wave[0]) * np.cos(rows * wave[1]) + step * (columns >= width / 2)
    g = random_gbuffer(rng, width * height)
    bent = view["backward"][0] + 0.4 * np.sin(np.outer(columns, wave[0] * np.arange(1, 4)) + rows[:, None])
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    geometric = bent + 0.05 * rng.normal(size=bent.shape)
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    position = view["eye"][0].astype(np.float64) + directions * depth[:, None]
    arrays = [position, g.error, bent, geometric]
    position, error, normal, geometric = (a.astype(np.float32).astype(np.float64) for a in arrays)
    other = np.where(g.kind == SURFACE, NOTHING, g.kind)
    kind = np.where(rng.uniform(size=width * height) < holes, other, SURFACE)
    return GBuffer(position, error, normal, geometric, kind)


def plane_gbuffer(view: NDArray[Any], tilt: float) -> GBuffer:
    """A plane 5 in front of the camera, turned by `tilt` degrees about the camera's right axis."""
    width, height = int(view["width"][0]), int(view["height"][0])
    rows, columns = np.divmod(np.arange(width * height), width)
    directions = view_directions(view, np.stack([columns, rows], axis=-1))
    v = {name: view[name][0].astype(np.float64) for name in ("eye", "up", "backward")}
    normal = np.cos(np.radians(tilt)) * v["backward"] + np.sin(np.radians(tilt)) * v["up"]
    t = (-5 * v["backward"] @ normal) / (directions @ normal)
    normals = np.broadcast_to(normal, directions.shape)
    arrays = [v["eye"] + directions * t[:, None], np.full(len(t), 1e-5), normals, normals]
    position, error, shading, geometric = (a.astype(np.float32).astype(np.float64) for a in arrays)
    return GBuffer(position, error, shading, geometric, np.full(len(position), SURFACE))
