"""Light transport that has a formula, in float64, and the scenes that it is held against."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import miplight as ml

Array = NDArray[np.float64]


def clip_to_horizon(corners: Array, normal: Array) -> Array:
    """The part of a polygon with n·r > 0; `corners` (N, 3) relative to the point [Sutherland and Hodgman]."""
    height = corners @ normal
    kept: list[Array] = []
    for k, (corner, h) in enumerate(zip(corners, height, strict=True)):
        following, after = corners[(k + 1) % len(corners)], height[(k + 1) % len(corners)]
        if h > 0:
            kept.append(corner)
        if (h > 0) != (after > 0):
            kept.append(corner + (following - corner) * (h / (h - after)))
    return np.array(kept).reshape(-1, 3)


def polygon_irradiance(point: Array, normal: Array, corners: Array) -> float:
    """Irradiance from a polygon of radiance 1, cut at the horizon: Lambert's formula.

    E = 1/2 |Σ_i Γ_i n·(r_i × r_{i+1}) / |r_i × r_{i+1}||, with Γ_i the angle between r_i and r_{i+1}.
    """
    spokes = clip_to_horizon(np.asarray(corners, np.float64) - point, normal)
    if len(spokes) < 3:
        return 0.0
    following = np.roll(spokes, -1, axis=0)
    cross = np.cross(spokes, following)
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, (spokes * following).sum(axis=1))
    good = sine > 0
    return float(abs(((angle[good] / sine[good])[:, None] * cross[good] @ normal).sum()) / 2)


def corners_of(light: ml.AreaLight, a: ArrayLike = (0, 1), b: ArrayLike = (0, 1)) -> Array:
    """Corners of a light's part [a₀, a₁] × [b₀, b₁], (4, 3)."""
    (a0, a1), (b0, b1) = np.asarray(a, np.float64), np.asarray(b, np.float64)
    places = np.array([(a0, b0), (a1, b0), (a1, b1), (a0, b1)])
    corners: Array = light.corner + places[:, :1] * light.edge_u + places[:, 1:] * light.edge_v
    return corners


def light_irradiance(light: ml.AreaLight, points: Array, normals: Array) -> Array:
    """Unshadowed irradiance of an area light with constant patches at (n, 3) points: (n, 3)."""
    texels = light.radiance.astype(np.float64)
    texels = texels[None, None] if texels.ndim == 1 else texels
    rows, columns = texels.shape[:2]
    total = np.zeros((len(points), 3))
    behind = (points - light.corner) @ light.normal <= 0
    for r in range(rows):
        for c in range(columns):
            b = (1 - (r + 1) / rows, 1 - r / rows)  # row 0 lies at b = 1
            patch = corners_of(light, (c / columns, (c + 1) / columns), b)
            each = [polygon_irradiance(p, n, patch) for p, n in zip(points, normals, strict=True)]
            total += np.array(each)[:, None] * texels[r, c]
    if not light.two_sided:
        total[behind] = 0
    return total


def add_quad(
    scene: ml.Scene, corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, **options: Any
) -> None:
    """Add a flat parallelogram."""
    o, u, v = (np.asarray(x, np.float64) for x in (corner, edge_u, edge_v))
    albedo = options.pop("albedo", (0.8, 0.6, 0.4))
    material = ml.Material(albedo)
    scene.add_arrays(
        [o, o + u, o + u + v, o + v], [(0, 1, 2), (0, 2, 3)], material=material, shading="flat", **options
    )


def floor_scene(*lights: ml.AreaLight | ml.SpotLight, size: float = 8.0) -> ml.Scene:
    """A floor at y = 0 that faces up, albedo (0.8, 0.6, 0.4), and lights."""
    scene = ml.Scene()
    add_quad(scene, (-size / 2, 0, size / 2), (size, 0, 0), (0, 0, -size), name="floor")
    for light in lights:
        scene.add_light(light)
    return scene


def view_down(width: int = 24, height: int = 20, up: float = 3.0, fov_y: float = 60.0) -> ml.Camera:
    """A camera above the floor that looks straight down, −z at the top of the picture."""
    return ml.Camera.look_at((0, up, 0), (0, 0, 0), (0, 0, -1), fov_y, width, height)


def floor_points(camera: ml.Camera) -> Array:
    """Where the pixels' rays meet y = 0, (H·W, 3)."""
    directions = camera.ray_directions().reshape(-1, 3)
    points: Array = camera.origin - directions * (camera.origin[1] / directions[:, 1:2])
    return points


def relative(found: ArrayLike, expected: ArrayLike) -> Array:
    """|found − expected| as a share of the largest expected value."""
    f, e = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    share: Array = np.abs(f - e) / np.abs(e).max()
    return share
