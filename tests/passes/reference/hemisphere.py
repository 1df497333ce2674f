"""Orthonormal frames, the concentric map and cosine-weighted directions, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def frame(n: Array) -> Array:
    """Two tangents of each unit normal, (n, 2, 3) [DBC17]: Frisvad's, mirrored for the lower half."""
    x, y, z = n[:, 0], n[:, 1], n[:, 2]
    sign = np.where(z >= 0, 1.0, -1.0)
    c = 1 / (1 + np.abs(z))
    first = np.stack([1 - x * x * c, -x * y * c, -sign * x], axis=-1)
    second = np.stack([-sign * x * y * c, sign * (1 - y * y * c), -y], axis=-1)
    both: Array = np.stack([first, second], axis=1)
    return both


def concentric(square: Array) -> Array:
    """The disc place of each place in [0, 1]², (n, 2): wedge by wedge as the paper has it [SC97].

    In each of the four wedges about ±x and ±y the distance to the middle is the larger coordinate, and the
    angle goes linearly from one diagonal to the other.
    """
    a, b = (2 * np.asarray(square, np.float64) - 1).T
    r, phi = np.zeros_like(a), np.zeros_like(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        wedges = [
            ((a > -b) & (a > b), a, np.pi / 4 * (b / a)),
            ((a > -b) & (a <= b), b, np.pi / 4 * (2 - a / b)),
            ((a <= -b) & (a < b), -a, np.pi / 4 * (4 + b / a)),
            ((a <= -b) & (a >= b) & (b != 0), -b, np.pi / 4 * (6 - a / b)),
        ]
    for here, radius, angle in wedges:
        r[here], phi[here] = radius[here], angle[here]
    disc: Array = np.stack([r * np.cos(phi), r * np.sin(phi)], axis=-1)
    return disc


def cosine_directions(normals: Array, square: Array) -> Array:
    """Unit directions about each normal with density cosθ/π: places of the disc, lifted to the hemisphere."""
    disc = concentric(square)
    z = np.sqrt(np.clip(1 - (disc**2).sum(axis=-1), 0, None))
    t = frame(normals)
    lifted: Array = disc[:, :1] * t[:, 0] + disc[:, 1:] * t[:, 1] + z[:, None] * normals
    return lifted
