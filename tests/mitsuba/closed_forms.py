"""Light transport that has a formula, in float64, to hold Mitsuba's pictures against."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import miplight as ml

Points = NDArray[np.float64]


def polygon_irradiance(points: Points, normal: ArrayLike, corners: ArrayLike) -> Points:
    """Irradiance from a polygon of radiance 1, wholly above each point's horizon (Lambert's formula).

    `points` (..., 3), `normal` (3,), `corners` (N, 3) in either winding.
    """
    spokes = np.asarray(corners, dtype=np.float64) - points[..., None, :]
    spokes = spokes / np.linalg.norm(spokes, axis=-1, keepdims=True)
    following = np.roll(spokes, -1, axis=-2)
    cross = np.cross(spokes, following)
    sine = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(sine, (spokes * following).sum(axis=-1))
    vector = (angle / sine)[..., None] * cross
    result: Points = np.abs((vector.sum(axis=-2) * np.asarray(normal)).sum(axis=-1)) * 0.5
    return result


def light_patches(light: ml.AreaLight, fine: int = 1) -> list[tuple[Points, Points]]:
    """(corners, radiance) of every texel of a light, each cut into `fine` × `fine`; row 0 at b = 1.

    With ``filter="linear"`` a patch has the interpolated value at its middle.
    """
    texels = light.radiance.astype(np.float64)
    texels = texels[None, None] if texels.ndim == 1 else texels
    rows, columns = texels.shape[0] * fine, texels.shape[1] * fine
    patches = []
    for i in range(rows):
        for j in range(columns):
            a, b = np.array([j, j + 1, j + 1, j]) / columns, 1.0 - np.array([i, i, i + 1, i + 1]) / rows
            corners = light.corner + a[:, None] * light.edge_u + b[:, None] * light.edge_v
            if light.filter == "linear":
                value = interpolate(texels, (j + 0.5) / columns, (i + 0.5) / rows, repeat=False)
            else:
                value = texels[i // fine, j // fine]
            patches.append((corners, value))
    return patches


def interpolate(texels: Points, x: Any, y: Any, *, repeat: bool) -> Points:
    """Bilinear value at column fraction x, row fraction y (texel centres at halves)."""
    height, width = texels.shape[:2]
    column, row = np.asarray(x) * width - 0.5, np.asarray(y) * height - 0.5
    j, i = np.floor(column).astype(int), np.floor(row).astype(int)
    s, t = (column - j)[..., None], (row - i)[..., None]

    def at(rows: Any, columns: Any) -> Points:
        if repeat:
            return texels[rows % height, columns % width]
        return texels[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]

    upper, lower = (at(k, j) * (1 - s) + at(k, j + 1) * s for k in (i, i + 1))
    result: Points = upper * (1 - t) + lower * t
    return result


def plane_hits(camera: ml.Camera, point: ArrayLike, normal: ArrayLike) -> Points:
    """Where the rays through the pixel centres meet a plane, (H, W, 3)."""
    directions = camera.ray_directions()
    n = np.asarray(normal, dtype=np.float64)
    t = ((np.asarray(point) - camera.origin) @ n) / (directions @ n)
    hits: Points = camera.origin + t[..., None] * directions
    return hits


def floor_under(scene: ml.Scene, albedo: ArrayLike = (0.5, 0.5, 0.5), size: float = 20.0) -> None:
    """Add a floor at y = 0, facing up."""
    h = 0.5 * size
    corners = [(-h, 0, -h), (-h, 0, h), (h, 0, h), (h, 0, -h)]
    uvs = [(0, 1), (0, 0), (1, 0), (1, 1)]
    triangles = [(0, 1, 2), (0, 2, 3)]
    scene.add_arrays(corners, triangles, uvs=uvs, name="floor", material=ml.Material(albedo), shading="flat")


def view_down(width: int = 32, height: int = 24, up: float = 6.0, fov_y: float = 40.0) -> ml.Camera:
    """A camera above the floor that looks straight down, −Z at the top of the picture."""
    return ml.Camera.look_at((0.0, up, 0.0), (0.0, 0.0, 0.0), (0, 0, -1), fov_y, width, height)


def phong(
    wi: Points, wo: Points, normal: ArrayLike, diffuse: ArrayLike, specular: ArrayLike, n: float
) -> Points:
    """The normalised Phong material f, (..., 3), of unit vectors away from the surface; zero below it."""
    up = np.asarray(normal, dtype=np.float64)
    cos_i, cos_o = wi @ up, wo @ up
    mirror = 2.0 * cos_i[..., None] * up - wi
    cosine = (mirror * wo).sum(axis=-1)
    lobe = np.where(cosine > 0.0, np.abs(cosine) ** n, 0.0) * (n + 2.0) / (2.0 * np.pi)
    value = np.asarray(diffuse) / np.pi + lobe[..., None] * np.asarray(specular)
    result: Points = np.where(((cos_i > 0.0) & (cos_o > 0.0))[..., None], value, 0.0)
    return result


def glossy_radiance(
    camera: ml.Camera,
    points: Points,
    material: ml.Material,
    light: ml.AreaLight,
    fine: int,
    diffuse: Any = None,
) -> Points:
    """Radiance towards the camera of points (N, 3) of a floor that faces up, by one light that nothing hides.

    Every texel of the light is cut into `fine` × `fine` midpoints; `diffuse` replaces a textured albedo.
    """
    up = np.array((0.0, 1.0, 0.0))
    view = camera.origin - points
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    albedo = material.albedo if diffuse is None else diffuse
    total = np.zeros_like(points)
    patches = light_patches(light, fine)
    for corners, value in patches:
        offset = corners.mean(axis=0) - points
        distance2 = (offset**2).sum(axis=-1)
        wo = offset / np.sqrt(distance2)[:, None]
        cosine = np.maximum(-(wo @ light.normal), 0.0) * np.maximum(wo @ up, 0.0)
        f = phong(view, wo, up, albedo, material.specular, material.shininess)
        total += f * (cosine / distance2)[:, None] * value
    return total * light.area / len(patches)
