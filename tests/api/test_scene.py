"""Scenes: adding, names, bad input, the report, bounds, copies and pickles."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

import miplight as ml
from miplight import shapes

TRIANGLE = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.fixture
def scene() -> ml.Scene:
    scene = ml.Scene()
    scene.add_mesh(shapes.displaced_sphere(320), name="rock")
    scene.add_mesh(shapes.quad((-1, 0, 1), (2, 0, 0), (0, 0, -2)), name="floor", shading="flat")
    scene.add_light(ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), radiance=(12, 12, 12)), name="tv")
    scene.add_light(ml.SpotLight((0, 3, 0), (0, 0, 0), intensity=(50, 50, 50)), name="lamp")
    scene.cameras["front"] = ml.Camera.look_at((0, 0, 5), (0, 0, 0))
    return scene


def summary(scene: ml.Scene) -> str:
    return f"{scene!r} {dict(scene.meshes)} {dict(scene.lights)} {scene.report!r}"


def test_what_was_added_is_there(scene: ml.Scene) -> None:
    assert repr(scene) == "<Scene: 2 meshes, 322 triangles, 2 lights, 1 camera>"
    assert list(scene.meshes) == ["rock", "floor"]
    assert list(scene.lights) == ["tv", "lamp"]
    rock, floor = scene.meshes["rock"], scene.meshes["floor"]
    assert rock.positions.dtype == np.float64
    assert rock.triangles.dtype == np.uint32
    assert rock.normals is not None
    assert rock.normals.dtype == np.float32
    assert rock.uvs is None
    assert rock.colors is None
    assert rock.shading == "smooth"
    assert floor.normals is None
    assert floor.uvs is not None
    assert rock.material == ml.Material()
    assert rock.transform.tolist() == np.eye(4).tolist()
    for array in (rock.positions, rock.triangles, rock.normals, floor.uvs, rock.transform):
        assert not array.flags.writeable


def test_names_by_default_and_in_return(scene: ml.Scene) -> None:
    assert scene.add_mesh(shapes.box()) == "mesh_2"
    assert scene.add_mesh(shapes.box(), name="mesh_3") == "mesh_3"
    scene.remove("mesh_2")
    assert scene.add_mesh(shapes.box()) == "mesh_4"
    assert scene.add_light(ml.AreaLight((0, 0, 0), (1, 0, 0), (0, 1, 0))) == "light_2"


@pytest.mark.parametrize("name", ["rock", "tv"])
def test_names_are_unique_among_meshes_and_lights(scene: ml.Scene, name: str) -> None:
    before = summary(scene)
    with pytest.raises(ml.SceneError, match=f"name is '{name}', which is taken"):
        scene.add_mesh(shapes.box(), name=name)
    with pytest.raises(ml.SceneError, match=f"name is '{name}', which is taken"):
        scene.add_light(ml.SpotLight((0, 0, 0), (0, 1, 0)), name=name)
    assert summary(scene) == before


@pytest.mark.parametrize(
    "use",
    [
        lambda scene, name: scene.remove(name),
        lambda scene, name: scene.set_transform(name, np.eye(4)),
        lambda scene, name: scene.set_vertices(name, np.zeros((3, 3))),
        lambda scene, name: scene.set_material(name, ml.Material()),
        lambda scene, name: scene.meshes[name],
    ],
)
def test_unknown_names_suggest_the_nearest(scene: ml.Scene, use: Callable[[ml.Scene, Any], Any]) -> None:
    before = summary(scene)
    with pytest.raises(ml.SceneError, match=r"'rokc'.*did you mean 'rock'.*'floor'"):
        use(scene, "rokc")
    with pytest.raises(ml.SceneError, match="no mesh"):
        use(scene, 3)
    assert summary(scene) == before


def test_views_are_mappings(scene: ml.Scene) -> None:
    with pytest.raises(ml.SceneError, match="did you mean 'tv'"):
        scene.lights["tvv"]
    assert "tv" in scene.lights
    assert "rock" not in scene.lights
    assert scene.lights.get("none") is None
    assert len(scene.lights) == 2
    for name in scene.lights:  # removing while looking is safe
        scene.remove(name)
    assert len(scene.lights) == 0
    with pytest.raises(ml.SceneError, match="there is none"):
        scene.lights["tv"]


def add(mesh: Any, **more: Any) -> Callable[[ml.Scene], None]:
    return lambda scene: scene.add_mesh(mesh, name="new", **more)  # type: ignore[return-value]


def arrays(positions: Any, triangles: Any, **more: Any) -> Callable[[ml.Scene], None]:
    return lambda scene: scene.add_arrays(positions, triangles, name="new", **more)  # type: ignore[return-value]


def loose(vertices: Any, faces: Any) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


NOT_FINITE = loose([[np.nan, 0, 0], [np.inf, 0, 0], [0, 1, 0]], [[0, 1, 2]])
IMAGE = ml.Material(np.full((2, 2, 3), 0.5))


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (add(trimesh.Trimesh()), r"mesh 'new', vertices is .*\(0, 3\)"),
        (add(loose([[0, 0, 0]], np.zeros((0, 3), int))), r"mesh 'new', faces is .*\(0, 3\)"),
        (add(loose(*TRIANGLE[:1], [[0, 1, 3]])), r"faces\[0, 2\] is 3 .*0 to 2"),
        (add(loose(*TRIANGLE[:1], [[0, 1, -1]])), r"faces\[0, 2\] is -1 .*0 to 2"),
        (add(NOT_FINITE), r"none of its 1 triangles is left \(0 have no area, 1 have NaN"),
        (
            add(loose([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])),
            r"none of its 1 triangles is left \(1 have no area",
        ),
        (add(trimesh.Scene()), "from_trimesh"),
        (add("bunny.ply"), "mesh is 'bunny.ply'; allowed: a trimesh.Trimesh"),
        (add(shapes.box(), transform=np.diag([1, 0, 1, 1])), r"transform is .*inverted"),
        (add(shapes.box(), transform=np.zeros((3, 3))), r"transform is .*\(4, 4\)"),
        (add(shapes.box(), transform=np.eye(4) * np.nan), r"transform is .*finite"),
        (add(shapes.box(), shading="gouraud"), "shading is 'gouraud'; allowed: 'smooth', 'flat'"),
        (add(shapes.box(), material=(0.5, 0.5, 0.5)), "material is"),
        (add(shapes.displaced_sphere(20), material=IMAGE), r"mesh 'new' has no UVs.*allowed"),
        (arrays(np.zeros((3, 2)), [[0, 1, 2]]), "positions is"),
        (arrays(TRIANGLE[0], [[0, 1, 2.5]]), r"triangles\[0, 2\] is 2.5"),
        (arrays(TRIANGLE[0], [0, 1, 2]), "triangles is"),
        (arrays(*TRIANGLE, normals=[[0, 0, 1]]), "normals is"),
        (arrays(*TRIANGLE, uvs=[[0, np.nan]] * 3), r"uvs\[0, 1\] is nan"),
        (arrays(*TRIANGLE, colors=np.full((3, 3), 255, np.uint8)), "srgb_to_linear"),
        (arrays(*TRIANGLE, colors=np.full((3, 3), 1.5)), r"colors\[0, 0\] is 1.5"),
        (lambda scene: scene.add_mesh(shapes.box(), name=""), "name is ''"),
        (lambda scene: scene.add_light("sun"), "light is 'sun'"),
        (lambda scene: scene.set_transform("rock", np.zeros((4, 4))), "transform is"),
        (lambda scene: scene.set_vertices("rock", np.zeros((5, 3))), r"vertices is .*\(162, 3\)"),
        (
            lambda scene: scene.set_vertices("rock", np.full((162, 3), np.nan)),
            "none of its 320 triangles is left",
        ),
        (lambda scene: scene.set_vertices("floor", np.eye(4)[:, :3], np.eye(4)[:, :3]), "shaded flat"),
        (lambda scene: scene.set_material("rock", "red"), "material is 'red'"),
        (lambda scene: scene.set_material("rock", IMAGE), "no UVs"),
    ],
)
def test_bad_input_leaves_the_scene_as_it_was(
    scene: ml.Scene, act: Callable[[ml.Scene], None], message: str
) -> None:
    before = summary(scene)
    with pytest.raises(ml.SceneError, match=message):
        act(scene)
    assert summary(scene) == before
    scene._core_snapshot()


def test_report_counts_what_was_dropped(scene: ml.Scene) -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [2, 0, 0]]
    faces = [[0, 1, 2], [0, 1, 3], [0, 1, 4], [1, 1, 2], [0, 1, 2]]
    scene.add_mesh(loose(vertices, faces), name="worn")
    report = scene.report
    assert (report["worn"].triangles, report["worn"].degenerate, report["worn"].not_finite) == (2, 2, 1)
    assert report["worn"].dropped == report.dropped == 3
    assert report.triangles == 324
    assert "worn" in repr(report)
    assert "<td>worn</td>" in report._repr_html_()
    with pytest.raises(KeyError):
        report["nothing"]


def assert_bounds(scene: ml.Scene, expected: Any) -> None:
    assert scene.bounds is not None
    np.testing.assert_allclose(scene.bounds, expected)


def test_bounds_are_of_what_is_seen() -> None:
    scene = ml.Scene()
    assert scene.bounds is None
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [99, 99, 99]]
    move = np.diag([2.0, 2.0, -2.0, 1.0])
    move[:3, 3] = (10, 0, 0)
    scene.add_mesh(loose(vertices, [[0, 1, 2], [0, 1, 3]]), transform=move)
    assert_bounds(scene, [[10, 0, 0], [12, 2, 0]])
    scene.add_light(ml.AreaLight((0, 5, 0), (1, 0, 0), (0, 0, 1), visible=False))
    assert_bounds(scene, [[10, 0, 0], [12, 2, 0]])
    scene.add_light(ml.AreaLight((0, 5, 0), (1, 0, 0), (0, 0, 1)))
    assert_bounds(scene, [[0, 0, 0], [12, 5, 1]])


def test_equal_geometry_is_stored_once(scene: ml.Scene) -> None:
    scene.add_mesh(shapes.displaced_sphere(320), name="twin", transform=np.diag([3.0, 1.0, 1.0, 1.0]))
    assert scene.meshes["twin"].geometry is scene.meshes["rock"].geometry
    scene.add_mesh(shapes.displaced_sphere(320, seed=1), name="other")
    assert scene.meshes["other"].geometry is not scene.meshes["rock"].geometry
    elsewhere = ml.Scene()
    elsewhere.add_mesh(shapes.displaced_sphere(320), name="again")
    assert elsewhere.meshes["again"].geometry is scene.meshes["rock"].geometry


def test_copies_are_independent(scene: ml.Scene) -> None:
    before = summary(scene)
    other = scene.copy()
    assert summary(other) == before
    assert other.meshes["rock"].geometry is scene.meshes["rock"].geometry
    other.set_transform("rock", np.diag([2.0, 2.0, 2.0, 1.0]))
    other.lights["tv"].radiance = (1.0, 1.0, 1.0)
    other.remove("floor")
    other.cameras.clear()
    assert summary(scene) == before
    assert len(scene.cameras) == 1


def test_pickles(scene: ml.Scene) -> None:
    scene.add_mesh(shapes.displaced_sphere(320), name="twin")
    scene.set_material("floor", IMAGE)
    scene.lights["tv"].radiance = np.ones((2, 2, 3))
    scene._add_note("a note")
    scene._core_snapshot()
    again = pickle.loads(pickle.dumps(scene))
    assert summary(again) == summary(scene)
    assert again.cameras == scene.cameras
    assert again.meshes["twin"].geometry is again.meshes["rock"].geometry
    for name, mesh in scene.meshes.items():
        for field in ("positions", "triangles", "normals", "uvs", "transform"):
            expected, found = getattr(mesh, field), getattr(again.meshes[name], field)
            assert (expected is None) == (found is None)
            if expected is not None:
                np.testing.assert_array_equal(found, expected)
                assert not found.flags.writeable
    again._core_snapshot()
    again.set_transform("rock", np.eye(4))


def test_shows_itself_in_a_notebook(scene: ml.Scene) -> None:
    scene.add_mesh(shapes.box(), name="<b>")
    page = scene._repr_html_()
    assert "&lt;b&gt;" in page
    assert "<td><b></td>" not in page
    assert "tv: AreaLight" in page


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.float16, np.int32, np.uint8, ">f4"])
def test_arrays_of_any_dtype_order_and_stride(dtype: Any) -> None:
    positions = (np.arange(24).reshape(8, 3) ** 2 % 17).astype(dtype)
    triangles = np.array([[0, 1, 2], [2, 3, 4], [5, 6, 7]])
    scene = ml.Scene()
    scene.add_arrays(np.asfortranarray(positions), triangles.astype(np.int16)[::-1], name="a")
    wide = np.zeros((8, 6), dtype)
    wide[:, ::2] = positions
    scene.add_arrays(wide[:, ::2], triangles.astype(float)[::-1], name="b")
    assert scene.meshes["a"].geometry is scene.meshes["b"].geometry
    np.testing.assert_array_equal(scene.meshes["a"].positions, positions)


def test_float64_positions_are_kept_exactly() -> None:
    positions = np.array(TRIANGLE[0]) + 1e6 + np.pi
    scene = ml.Scene()
    scene.add_arrays(positions, TRIANGLE[1], name="far")
    np.testing.assert_array_equal(scene.meshes["far"].positions, positions)
