"""Shadow maps of light samples in float64: directions of texels, and what a look into a map says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .hemisphere import frame

Array = NDArray[np.float64]


def direction(n: Array, texel: NDArray[np.int64], resolution: int, tan_half: float = 0.0) -> Array:
    """Unit directions of the middles of texels (n, 2) about one normal.

    The octahedron's upper half, or a frustum whose half width at distance 1 is `tan_half`.
    """
    square = (texel + 0.5) / resolution * 2 - 1
    p = np.stack([square[:, 0] + square[:, 1], square[:, 0] - square[:, 1]], -1) / 2
    z = 1 - np.abs(p).sum(1)
    if tan_half:
        p, z = tan_half * square, np.ones(len(square))
    t, b = frame(n[None])[0]
    d = p[:, :1] * t + p[:, 1:] * b + z[:, None] * n
    made: Array = d / np.linalg.norm(d, axis=1, keepdims=True)
    return made


def place(n: Array, d: Array, resolution: int, tan_half: float = 0.0) -> Array:
    """Where directions (n, 3) lie in the map, in texels."""
    t, b = frame(n[None])[0]
    local = np.stack([d @ t, d @ b, np.maximum(d @ n, 0)], -1)
    if tan_half:
        with np.errstate(divide="ignore", invalid="ignore"):
            seen: Array = (local[:, :2] / (tan_half * local[:, 2:]) / 2 + 0.5) * resolution
        return np.nan_to_num(seen, nan=0.5 * resolution, posinf=2.0 * resolution, neginf=-resolution)
    p = local[:, :2] / np.abs(local).sum(1, keepdims=True)
    made: Array = (np.stack([p[:, 0] + p[:, 1], p[:, 0] - p[:, 1]], -1) / 2 + 0.5) * resolution
    return made
