"""Irradiance of polygons in float64: Lambert's formula, cut at horizons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def clipped(corners: Array, normal: Array) -> Array:
    """The part of a convex polygon with n·r > 0; corners (N, 3) relative to the point."""
    height = corners @ normal
    kept: list[Array] = []
    for k, (corner, h) in enumerate(zip(corners, height, strict=True)):
        following, after = corners[(k + 1) % len(corners)], height[(k + 1) % len(corners)]
        if h > 0:
            kept.append(corner)
        if (h > 0) != (after > 0):
            kept.append(corner + (following - corner) * (h / (h - after)))
    return np.array(kept).reshape(-1, 3)


def contour(normal: Array, corners: Array) -> float:
    """Irradiance of unit radiance from a polygon above the horizon; corners (N, 3) relative to the point.

    E = 1/2 |Σ_i Γ_i n·(r_i × r_{i+1}) / |r_i × r_{i+1}||, with Γ_i the angle that edge i takes up [Lam60].
    """
    if len(corners) < 3:
        return 0.0
    following = np.roll(corners, -1, axis=0)
    cross = np.cross(corners, following - corners)
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, (corners * following).sum(axis=1))
    good = sine > 0
    return float(abs(((angle[good] / sine[good])[:, None] * cross[good] @ normal).sum()) / 2)


def subdivided(normal: Array, corner: Array, u: Array, v: Array, side: int = 64) -> float:
    """The same by 2 × 2 Gauss points in side² cells: for polygons far away, where a contour cancels."""
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
    places = ((np.arange(side)[:, None] + gauss) / side).ravel()
    a, b = np.meshgrid(places, places)
    y = corner + a[..., None] * u + b[..., None] * v
    kernel = np.clip(y @ normal, 0, None) * np.abs(y @ np.cross(u, v)) / (y * y).sum(axis=-1) ** 2
    return float(kernel.mean())


def parallelogram_irradiance(normal: Array, geometric: Array, corner: Array, u: Array, v: Array) -> float:
    """Irradiance of unit radiance from corner + a u + b v at the origin, above both normals' horizons."""
    corners = np.array([corner, corner + u, corner + u + v, corner + v])
    above = (corners @ normal > 0).all() and (corners @ geometric > 0).all()
    size = max(np.linalg.norm(u), np.linalg.norm(v))
    if above and np.linalg.norm(corners.mean(axis=0)) > 20 * size:
        return subdivided(normal, corner, u, v, side=4)
    return contour(normal, clipped(clipped(corners, normal), geometric))
