"""Smooth normals: against trimesh, against a closed form, at every scale, on broken input."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from miplight import shapes
from miplight.normals import mend_normals, smooth_normals, smoothing_groups


def arrays(mesh: trimesh.Trimesh) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    return np.array(mesh.vertices), np.array(mesh.faces, dtype=np.uint32)


@pytest.mark.parametrize(
    "mesh", [shapes.displaced_sphere(2000), trimesh.creation.box(), trimesh.creation.torus(2, 1)]
)
def test_as_trimesh_weights_them(mesh: trimesh.Trimesh) -> None:
    normals = smooth_normals(*arrays(mesh))
    np.testing.assert_allclose(normals, mesh.vertex_normals, atol=1e-6)
    # negative control: weighting by area is another rule
    by_area = np.zeros_like(normals)
    for corner in range(3):
        np.add.at(by_area, mesh.faces[:, corner], mesh.face_normals * mesh.area_faces[:, None])
    by_area /= np.linalg.norm(by_area, axis=1, keepdims=True)
    assert np.abs(by_area - mesh.vertex_normals).max() > 1e-3


def test_a_sphere_has_radial_normals() -> None:
    mesh = shapes.displaced_sphere(20_000, amplitude=0.0)
    np.testing.assert_allclose(smooth_normals(*arrays(mesh)), mesh.vertices, atol=4e-3)


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1e-4, 1e5, 1e12])
def test_scale_and_place_do_not_matter(scale: float) -> None:
    positions, triangles = arrays(shapes.displaced_sphere(500))
    expected = smooth_normals(positions, triangles)
    np.testing.assert_allclose(smooth_normals(positions * scale, triangles), expected, atol=1e-12)
    np.testing.assert_allclose(smooth_normals(positions + 1e6, triangles), expected, atol=1e-6)


def test_broken_triangles_count_for_nothing() -> None:
    positions, triangles = arrays(shapes.displaced_sphere(500))
    expected = smooth_normals(positions, triangles)
    wild = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [5, 5, 5]])
    more: NDArray[np.float64] = np.vstack([positions, wild])
    count = len(positions)
    nasty = np.array([[0, 1, count], [1, 2, count + 1], [3, 3, 4], [5, 5, 5]], dtype=np.uint32)
    normals = smooth_normals(more, np.vstack([triangles, nasty]))
    np.testing.assert_allclose(normals[:count], expected, atol=1e-12)
    assert (normals[count:] == 0).all()


def test_mending() -> None:
    positions, triangles = arrays(shapes.displaced_sphere(500))
    expected = smooth_normals(positions, triangles)
    given = expected * np.linspace(1e-200, 1e200, len(expected))[:, None]
    given[3], given[4], given[5] = np.nan, 0.0, (np.inf, 0, 0)
    normals, mended = mend_normals(given, positions, triangles)
    assert mended == 3
    assert normals.dtype == np.float32
    np.testing.assert_allclose(normals, expected, atol=1e-6)
    unused = np.vstack([positions, [[9, 9, 9]]])
    normals, mended = mend_normals(np.vstack([expected, [[0, 0, 0]]]), unused, triangles)
    assert mended == 0
    assert np.isfinite(normals).all()


def test_groups_keep_seams_smooth_and_edges_hard() -> None:
    box, sphere = shapes.box(), shapes.displaced_sphere(80)
    soup, faces = (
        np.array(sphere.vertices)[sphere.faces].reshape(-1, 3),
        np.arange(240, dtype=np.uint32).reshape(-1, 3),
    )
    smooth = sphere.vertex_normals[sphere.faces].reshape(-1, 3).astype(np.float32)
    groups = smoothing_groups(soup, smooth)
    assert len(np.unique(groups)) == len(sphere.vertices)
    np.testing.assert_allclose(smooth_normals(soup, faces, groups), smooth, atol=1e-6)
    # negative control: without groups a split mesh is faceted
    assert np.abs(smooth_normals(soup, faces) - smooth).max() > 0.05
    positions, triangles = arrays(box)
    normals = smooth_normals(positions, triangles).astype(np.float32)
    assert len(np.unique(smoothing_groups(positions, normals))) == 24
