"""Places that gather and how far what they found holds [WRC88; WH92], in float64."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .structs import record

Array = NDArray[np.float64]
CHANNELS = ("red", "green", "blue")
GATHER_POINT = np.dtype(
    [
        ("position", "<f4", 3),
        ("inverse", "<f4"),
        ("normal", "<f4", 3),
        ("level", "<u4"),
        *(
            field
            for i, name in enumerate([*CHANNELS, *(f"{channel}_slope" for channel in CHANNELS)])
            for field in ((name, "<f4", 3), (f"pad{i}", "<u4") if i else ("met", "<f4"))
        ),
    ]
)
POINT_PARAMS = np.dtype([("reach", "<f4"), ("first", "<u4"), ("count", "<u4"), ("covered", "<f4")])
MARKED = 0x80000000


def params(**values: float) -> NDArray[Any]:
    """The uniform that all passes share."""
    return record(POINT_PARAMS, **values)


def fade(square: Array) -> Array:
    """From 1 to 0 where a square reaches 1."""
    held: Array = np.clip(1 - square, 0, None) ** 2
    return held


def holds(points: NDArray[Any], reach: float, p: Array, n: Array, width: Array | float) -> Array:
    """How far each point holds at p with normal n: by distance, four times that to its plane, and turn."""
    met = points["met"].astype(np.float64)
    share = np.where(met == 0, np.inf, reach * met / np.maximum(points["inverse"], 1e-30))
    far = np.maximum(share, 1.5 * width)
    normal = points["normal"].astype(np.float64)
    d = p - points["position"].astype(np.float64)
    off = 4 * (d * normal).sum(axis=-1)
    turned = ((normal - n) ** 2).sum(axis=-1) / 0.35**2
    held: Array = fade(((d**2).sum(axis=-1) + off**2) / np.maximum(far**2, 1e-37)) * fade(turned)
    return held


def mean_at(points: NDArray[Any], weights: Array, p: Array, n: Array) -> tuple[Array, Array, Array]:
    """Of points (k, j) with weights (k, j) at places (k, 3): sums of light, what is added, and weights.

    Half of what gradients add is taken with each point, the other half about the middle of the points.
    """
    d = p[:, None] - points["position"].astype(np.float64)
    vectors = np.stack([points[name].astype(np.float64) for name in CHANNELS], axis=-2)
    slopes = np.stack([points[f"{name}_slope"].astype(np.float64) for name in CHANNELS], axis=-2)
    light = (np.clip(vectors @ n[:, None, :, None], 0, None)[..., 0] * weights[..., None]).sum(axis=1)
    change = ((slopes @ d[..., None])[..., 0] * weights[..., None]).sum(axis=1)
    total = weights.sum(axis=1)
    middle = (weights[..., None] * d).sum(axis=1) / np.maximum(total, 1e-30)[:, None]
    about = ((weights[..., None, None] * slopes).sum(axis=1) @ middle[..., None])[..., 0]
    more = np.clip((change + about) / 2, -0.75 * light, light)
    return light, more, total


def random_points(rng: np.random.Generator, count: int, spread: float = 1.0) -> NDArray[Any]:
    """Points near each other that face about the same way."""
    points = np.zeros(count, GATHER_POINT)
    points["position"] = rng.normal(size=(count, 3)) * spread
    normal = np.array([0, 0, 1.0]) + 0.1 * rng.normal(size=(count, 3))
    points["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    points["met"] = rng.integers(1, 200, count)
    points["inverse"] = rng.lognormal(0, 0.5, count) * points["met"]
    # what met nothing holds everywhere, what met something at no distance nowhere but at itself
    points["met"][::19], points["inverse"][::19] = 0, 0
    points["inverse"][5::19] = 3e38
    for name in CHANNELS:
        points[name] = points["normal"] * rng.uniform(0.5, 2, (count, 1)) + 0.2 * rng.normal(size=(count, 3))
        points[f"{name}_slope"] = 0.3 * rng.normal(size=(count, 3))
    return points
