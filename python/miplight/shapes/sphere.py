"""A bumpy closed surface of any number of triangles, as scans are."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from miplight.validate import as_count, as_number

from .primitives import mesh

__all__ = ["displaced_sphere", "geodesic_sphere"]


def displaced_sphere(
    triangles: int = 20_000, radius: float = 1.0, amplitude: float = 0.25, seed: int = 0
) -> trimesh.Trimesh:
    """Sphere with bumps of many sizes: closed, smooth, star-shaped about the origin, evenly triangulated.

    Parameters
    ----------
    triangles : int, default 20,000
        Exact where it is even and 20 or more; a closed surface has no odd number, so one less is made then.
    radius : float, default 1.0
    amplitude : float, default 0.25
        Largest displacement as a fraction of the radius, in [0, 1); in practice about a third of it is
        reached.
    seed : int, default 0
        Another seed is another shape.
    """
    count = as_count(triangles, "triangles", at_least=20) // 2 * 2
    size = as_number(radius, "radius", above=0.0)
    height = as_number(amplitude, "amplitude", at_least=0.0, below=1.0)
    vertices, faces = geodesic_sphere(int(np.sqrt(count / 20)))
    vertices, faces = _split_some(vertices, faces, (count - len(faces)) // 2)
    return mesh(vertices * (size * (1.0 + height * _bumps(vertices, seed)))[:, None], faces)


def geodesic_sphere(frequency: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Unit sphere: an icosahedron with its edges cut into `frequency` parts: 20 · frequency² triangles."""
    base = trimesh.creation.icosahedron()
    steps = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    weights = np.array([(frequency - i - j, i, j) for i, j in steps], dtype=np.float64) / frequency
    number = {step: k for k, step in enumerate(steps)}
    local = []
    for i, j in steps:
        if i + j < frequency:
            local.append((number[i, j], number[i + 1, j], number[i, j + 1]))
        if i + j < frequency - 1:
            local.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    points = np.einsum("wk,fkx->fwx", weights, base.vertices[base.faces])
    faces = np.array(local)[None] + np.arange(20)[:, None, None] * len(steps)
    flat = points.reshape(-1, 3)
    # points on shared edges agree to rounding: weld what is equal to nine digits
    _, first, inverse = np.unique(np.round(flat, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    welded = flat[first]
    welded = welded / np.linalg.norm(welded, axis=1, keepdims=True)
    return welded, inverse.reshape(-1)[faces.reshape(-1, 3)].astype(np.int64)


def _split_some(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Split `count` triangles, evenly spread over the list, into three each."""
    if count == 0:
        return vertices, faces
    chosen = np.linspace(0, len(faces) - 1, count).astype(np.int64)
    corners = faces[chosen]
    middle = vertices[corners].mean(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    new = np.arange(count) + len(vertices)
    split = [np.stack([corners[:, k], corners[:, (k + 1) % 3], new], axis=-1) for k in range(3)]
    keep = np.ones(len(faces), dtype=np.bool_)
    keep[chosen] = False
    return np.vstack([vertices, middle]), np.vstack([faces[keep], *split])


def _bumps(points: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Sum plane waves of five octaves, amplitude falling with frequency; within [-1, 1]."""
    random = np.random.default_rng(as_count(seed, "seed", at_least=0))
    total, weight = np.zeros(len(points)), 0.0
    for octave in range(5):
        frequency = 2.5 * 2.0**octave
        for _ in range(6):
            direction = random.normal(size=3)
            direction *= frequency / np.linalg.norm(direction)
            total += np.cos(points @ direction + random.uniform(0, 2 * np.pi)) / frequency
            weight += 1.0 / frequency
    return total / weight
