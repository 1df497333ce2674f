"""Scenes that change: transforms, vertices, materials, lights; snapshots and threads."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import miplight as ml
from miplight import shapes


@pytest.fixture
def scene() -> ml.Scene:
    scene = ml.Scene()
    scene.add_mesh(shapes.displaced_sphere(320), name="rock")
    scene.add_mesh(shapes.quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), 4, 4), name="floor", shading="flat")
    return scene


def test_moving_a_mesh_keeps_its_geometry(scene: ml.Scene) -> None:
    before = scene.meshes["rock"]
    matrix = np.diag([1.0, -2.0, 3.0, 1.0])
    matrix[:3, 3] = (1, 2, 3)
    scene.set_transform("rock", matrix)
    after = scene.meshes["rock"]
    assert after.geometry.core is before.geometry.core
    assert after.transform.tolist() == matrix.tolist()
    assert before.transform.tolist() == np.eye(4).tolist()
    matrix[0, 0] = 0.0  # ours is a copy
    assert after.transform[0, 0] == 1.0
    np.testing.assert_allclose(after.bounds[0, 2], before.bounds[0, 2] * 3 + 3)
    np.testing.assert_allclose(after.bounds[0, 1], before.bounds[1, 1] * -2 + 2)


def test_deforming_a_mesh_is_its_own_affair(scene: ml.Scene) -> None:
    scene.add_mesh(shapes.displaced_sphere(320), name="twin")
    rock = scene.meshes["rock"]
    stretched = rock.positions * (3.0, 1.0, 1.0)
    scene.set_vertices("rock", stretched)
    after = scene.meshes["rock"]
    np.testing.assert_array_equal(after.positions, stretched)
    np.testing.assert_array_equal(after.triangles, rock.triangles)
    assert after.geometry.core.id != rock.geometry.core.id
    assert scene.meshes["twin"].geometry is rock.geometry
    # normals follow: those of an ellipsoid are those of the sphere, scaled by the inverse
    expected = shapes.displaced_sphere(320)
    expected.vertices = stretched
    assert after.normals is not None
    np.testing.assert_allclose(after.normals, expected.vertex_normals, atol=1e-5)


def test_deforming_with_normals_of_your_own(scene: ml.Scene) -> None:
    positions = scene.meshes["rock"].positions
    up = np.tile([0, 4, 0], (len(positions), 1))
    scene.set_vertices("rock", positions, normals=up)
    normals = scene.meshes["rock"].normals
    assert normals is not None
    np.testing.assert_array_equal(normals, np.tile(np.array([0, 1, 0], np.float32), (len(positions), 1)))


def test_dropped_triangles_may_come_back(scene: ml.Scene) -> None:
    good = np.array(scene.meshes["rock"].positions)
    bad = good.copy()
    bad[7] = np.nan
    scene.set_vertices("rock", bad)
    dropped = scene.report["rock"].not_finite
    assert 4 <= dropped <= 8
    assert scene.report["rock"].triangles == 320 - dropped
    normals = scene.meshes["rock"].normals
    assert normals is not None
    assert np.isfinite(normals).all()
    scene.set_vertices("rock", good)
    assert scene.report["rock"].dropped == 0


def test_seams_stay_smooth_when_deformed() -> None:
    sphere = shapes.displaced_sphere(320)
    corners = sphere.faces.reshape(-1)
    scene = ml.Scene()
    soup, faces = sphere.vertices[corners], np.arange(len(corners)).reshape(-1, 3)
    scene.add_arrays(soup, faces, normals=sphere.vertex_normals[corners], name="soup")
    for stretch in ((2.0, 1.0, 1.0), (1.0, 3.0, 1.0)):
        scene.set_vertices("soup", soup * stretch)
        normals = scene.meshes["soup"].normals
        assert normals is not None
        expected = sphere.copy()
        expected.vertices = sphere.vertices * stretch
        np.testing.assert_allclose(normals, expected.vertex_normals[corners], atol=1e-5)


def test_flat_meshes_get_no_normals(scene: ml.Scene) -> None:
    scene.set_vertices("floor", scene.meshes["floor"].positions + np.array([0, 1, 0]))
    assert scene.meshes["floor"].normals is None
    assert scene.bounds is not None
    assert scene.meshes["floor"].bounds[:, 1].tolist() == [1.0, 1.0]


def test_a_material_replaces_vertex_colours(scene: ml.Scene) -> None:
    colors = np.linspace(0, 1, 9).reshape(3, 3)
    scene.add_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], colors=colors, name="gaudy")
    gaudy = scene.meshes["gaudy"]
    assert gaudy.colors is not None
    np.testing.assert_allclose(gaudy.colors, colors, rtol=1e-6)
    assert gaudy.material.albedo.tolist() == [1.0, 1.0, 1.0]
    scene.set_material("gaudy", ml.Material((0.2, 0.2, 0.2)))
    assert scene.meshes["gaudy"].colors is None
    scene.set_material("floor", ml.Material(np.full((2, 2, 3), 0.5)))
    assert scene.meshes["floor"].material.is_textured


def test_a_light_in_the_scene_is_the_very_object(scene: ml.Scene) -> None:
    light = ml.AreaLight((0, 2, 0), (1, 0, 0), (0, 0, 1), radiance=(1, 1, 1))
    scene.add_light(light, name="tv")
    scene.lights["tv"].radiance = (3.0, 3.0, 3.0)
    assert light.radiance.tolist() == [3.0, 3.0, 3.0]
    assert scene.lights["tv"] is light


def test_records_of_meshes_that_did_not_change_are_made_once(scene: ml.Scene) -> None:
    first = scene.meshes["rock"]._core_instance()
    scene._core_snapshot()
    scene.set_transform("floor", np.diag([2.0, 1.0, 1.0, 1.0]))
    assert scene.meshes["rock"]._core_instance() is first


def test_threads_may_change_and_render_at_once(scene: ml.Scene) -> None:
    scene.add_light(ml.AreaLight((0, 2, 0), (1, 0, 0), (0, 0, 1)), name="tv")
    errors: list[BaseException] = []
    stop = threading.Event()

    def look() -> None:
        try:
            while not stop.is_set():
                scene._core_snapshot()
                _ = scene.bounds, scene.report, repr(scene), list(scene.meshes)
        except BaseException as error:
            errors.append(error)

    watchers = [threading.Thread(target=look) for _ in range(2)]
    for watcher in watchers:
        watcher.start()
    for k in range(60):
        scene.add_mesh(shapes.box((1, 1, k + 1)), name=f"box_{k}")
        scene.set_transform("rock", np.diag([1.0 + k, 1.0, 1.0, 1.0]))
        scene.lights["tv"].radiance = (float(k), 0.0, 0.0)
        if k > 3:
            scene.remove(f"box_{k - 3}")
    stop.set()
    for watcher in watchers:
        watcher.join()
    assert not errors
