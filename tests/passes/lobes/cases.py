"""Fragments of a glossy floor, for the passes that ask and sum."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.passes.reference.lights import Area
from tests.passes.reference.lobes import Glossy
from tests.passes.reference.structs import RECEIVER


def receivers_of(points: Glossy) -> NDArray[Any]:
    """One fragment a point; `flags` hold the exponent."""
    made = np.zeros(len(points.position), RECEIVER)
    made["origin"], made["normal_geo"], made["normal_shade"] = (
        points.position,
        points.geometric,
        points.normal,
    )
    made["flags"] = points.exponent.astype(np.float32).view(np.uint32)
    return made


def samples_of(light: Area, side: int = 16) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Middles of side × side strata, (n, 4), and their radiance times area, for a light of one colour."""
    middles = (np.arange(side) + 0.5) / side
    b, a = np.meshgrid(middles, middles, indexing="ij")
    points = light.point(np.stack([a.ravel(), b.ravel()], -1))
    radiance = np.broadcast_to(light.mean * light.area / side**2, (side**2, 3))
    widened = np.column_stack([points, np.full(len(points), 0.9999)]), np.pad(radiance, ((0, 0), (0, 1)))
    return widened[0].astype(np.float32), widened[1].astype(np.float32)
