"""Smooth vertex normals, at any scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["mend_normals", "smooth_normals", "smoothing_groups"]


def smooth_normals(
    positions: NDArray[np.float64],
    triangles: NDArray[np.uint32],
    groups: NDArray[np.intp] | None = None,
) -> NDArray[np.float64]:
    """Average the face normals around each vertex, weighted by the corner's angle.

    The same rule as trimesh and Mitsuba use, but without their absolute thresholds, which lose the triangles
    of small scenes.

    Parameters
    ----------
    positions : (V, 3) float64
        Triangles with a corner that is not finite count for nothing.
    triangles : (F, 3) uint32
    groups : (V,) integers, optional
        Vertices of one group share a normal (see `smoothing_groups`).

    Returns
    -------
    (V, 3) float64
        Unit normals; zero where a vertex has no triangle with an area.
    """
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(positions).all(axis=1))
    triangles = triangles[finite[triangles].all(axis=1)]
    if len(triangles) == 0:
        return np.zeros((len(positions), 3))
    middle, size = _middle_and_size(positions[triangles.ravel()])
    local = (np.where(finite[:, None], positions, 0.0) - middle) / size
    corners = [local[triangles[:, k]] for k in range(3)]
    edges = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]]
    faces = np.cross(edges[0], edges[1])
    area = np.linalg.norm(faces, axis=1)
    faces /= np.where(area > 0, area, 1.0)[:, None]
    total = np.zeros((len(positions) if groups is None else int(groups.max()) + 1, 3))
    for k in range(3):
        index = triangles[:, k].astype(np.intp) if groups is None else groups[triangles[:, k]]
        # atan2 keeps its precision for slivers, where acos does not; without an area it gives 0 or pi
        angle = np.arctan2(area, -np.einsum("ij,ij->i", edges[k], edges[k - 1]))
        angle[area == 0] = 0.0
        for axis in range(3):
            total[:, axis] += np.bincount(index, angle * faces[:, axis], minlength=len(total))
    return _unit_rows(total if groups is None else total[groups])


def mend_normals(
    normals: NDArray[np.float64], positions: NDArray[np.float64], triangles: NDArray[np.uint32]
) -> tuple[NDArray[np.float32], int]:
    """Bring given normals to unit length, and replace those that are zero or not finite.

    Returns
    -------
    normals : (V, 3) float32
        Unit normals. A vertex that no triangle with an area uses gets (0, 0, 1), which nothing reads.
    mended : int
        How many used vertices needed a replacement.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        unit = _unit_rows(np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0.0))
    missing: NDArray[np.bool_] = np.asarray(~unit.any(axis=1))
    if missing.any():
        unit[missing] = smooth_normals(positions, triangles)[missing]
        used = np.zeros(len(positions), dtype=np.bool_)
        used[triangles] = True
        mended = int((missing & used).sum())
        still: NDArray[np.bool_] = np.asarray(~unit.any(axis=1))
        unit[still] = (0.0, 0.0, 1.0)
    else:
        mended = 0
    return unit.astype(np.float32), mended


def smoothing_groups(positions: NDArray[np.float64], normals: NDArray[np.float32]) -> NDArray[np.intp]:
    """Number the vertices so that those with equal position and normal share a number.

    A vertex that was split for its UVs alone then stays smooth when the mesh is deformed, while a hard edge
    stays hard.
    """
    rows = np.ascontiguousarray(np.hstack([positions, normals.astype(np.float64)]) + 0.0)
    keys = rows.view([("", np.float64)] * 6).ravel()
    return np.unique(keys, return_inverse=True)[1].reshape(-1)


def _middle_and_size(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    low, high = points.min(axis=0), points.max(axis=0)
    middle: NDArray[np.float64] = low + (high - low) / 2
    return middle, float((high - low).max()) or 1.0


def _unit_rows(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    largest = np.abs(rows).max(axis=1, keepdims=True)
    scaled = rows / np.where(largest > 0, largest, 1.0)
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    unit: NDArray[np.float64] = scaled / np.where(length > 0, length, 1.0)
    return unit
