"""A G-buffer with random surfaces, lights and holes in it."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

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
