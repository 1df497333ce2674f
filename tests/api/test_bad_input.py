"""Bad input: errors that name the argument, show the value and say what is allowed; nothing half-changed.

And input that is odd but right: no lights, no meshes, a light behind everything, a camera inside an object.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import miplight as ml

NAN, INF = float("nan"), float("inf")
GREY = np.full((2, 2, 3), 128, np.uint8)
TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def _mesh(vertices: Any, faces: Any) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False, validate=False)


def _light(**changes: Any) -> ml.AreaLight:
    arguments: dict[str, Any] = {"corner": (0, 0, 0), "edge_u": (1, 0, 0), "edge_v": (0, 0, 1)}
    return ml.AreaLight(**(arguments | changes))


def _spot(**changes: Any) -> ml.SpotLight:
    return ml.SpotLight(**({"position": (0, 1, 0), "target": (0, 0, 0)} | changes))


def _view(**changes: Any) -> ml.Camera:
    return ml.Camera.look_at(**({"origin": (0, 0, 5), "target": (0, 0, 0)} | changes))


CASES: dict[str, tuple[Callable[[], object], list[str]]] = {
    "nan vertices": (lambda: ml.Scene().add_mesh(_mesh([[NAN, 0, 0], *TRIANGLE[1:]], [[0, 1, 2]])), []),
    "inf vertices": (lambda: ml.Scene().add_mesh(_mesh([[INF, 0, 0], *TRIANGLE[1:]], [[0, 1, 2]])), []),
    "index out of range": (lambda: ml.Scene().add_arrays(TRIANGLE, [[0, 1, 3]]), ["3", "from 0 to 2"]),
    "negative index": (lambda: ml.Scene().add_arrays(TRIANGLE, [[0, 1, -1]]), ["-1", "from 0 to 2"]),
    "empty mesh": (lambda: ml.Scene().add_mesh(trimesh.Trimesh()), []),
    "no triangle left": (lambda: ml.Scene().add_arrays(TRIANGLE, [[0, 0, 1]]), []),
    "not a mesh": (lambda: ml.Scene().add_mesh("bunny.ply"), ["bunny.ply"]),
    "vertices of the wrong shape": (lambda: ml.Scene().add_arrays([[0, 0]] * 3, [[0, 1, 2]]), ["(V, 3)"]),
    "singular matrix": (
        lambda: ml.Scene().add_mesh(trimesh.creation.box(), transform=np.diag([1, 0, 1, 1])),
        ["transform", "inverted"],
    ),
    "matrix of the wrong shape": (
        lambda: ml.Scene().add_mesh(trimesh.creation.box(), transform=np.eye(3)),
        ["transform", "(4, 4)"],
    ),
    "singular camera": (lambda: ml.Camera(np.zeros((4, 4)), 45, 8, 8), ["world_from_camera"]),
    "up along the view": (lambda: _view(up=(0, 0, 1)), ["up"]),
    "up zero": (lambda: _view(up=(0, 0, 0)), ["up"]),
    "target at the origin": (lambda: _view(target=(0, 0, 5)), ["target"]),
    "fov 0": (lambda: _view(fov_y=0), ["fov_y", "0", "180"]),
    "fov 180": (lambda: _view(fov_y=180), ["fov_y", "180"]),
    "fov nan": (lambda: _view(fov_y=NAN), ["fov_y", "nan"]),
    "width 0": (lambda: _view(width=0), ["width", "0"]),
    "height -1": (lambda: _view(height=-1), ["height", "-1"]),
    "width 2.5": (lambda: _view(width=2.5), ["width", "2.5"]),
    "light without area": (lambda: _light(edge_v=(2, 0, 0)), ["edge"]),
    "light edge zero": (lambda: _light(edge_u=(0, 0, 0)), ["edge_u"]),
    "light corner nan": (lambda: _light(corner=(NAN, 0, 0)), ["corner", "nan"]),
    "radiance negative": (lambda: _light(radiance=(-1.0, 0, 0)), ["radiance", "-1"]),
    "radiance nan": (lambda: _light(radiance=(NAN, 0, 0)), ["radiance", "nan"]),
    "radiance inf": (lambda: _light(radiance=(INF, 0, 0)), ["radiance", "inf"]),
    "radiance integer": (lambda: _light(radiance=GREY), ["radiance", "srgb_to_linear"]),
    "radiance grey image": (lambda: _light(radiance=np.ones((2, 2))), ["radiance", "(h, w, 3)"]),
    "radiance rgba image": (lambda: _light(radiance=np.ones((2, 2, 4))), ["radiance", "(h, w, 3)"]),
    "radiance empty image": (lambda: _light(radiance=np.ones((0, 2, 3))), ["radiance"]),
    "filter": (lambda: _light(filter="cubic"), ["filter", "'linear'"]),
    "spot cutoff 0": (lambda: _spot(cutoff=0), ["cutoff", "0", "80"]),
    "spot cutoff 81": (lambda: _spot(cutoff=81), ["cutoff", "81", "80"]),
    "spot without direction": (lambda: _spot(target=(0, 1, 0)), ["target"]),
    "spot intensity negative": (lambda: _spot(intensity=(1.0, -1.0, 0.0)), ["intensity", "-1"]),
    "albedo above 1": (lambda: ml.Material((0.5, 1.5, 0.5)), ["albedo", "1.5"]),
    "albedo negative": (lambda: ml.Material((0.5, -0.5, 0.5)), ["albedo", "-0.5"]),
    "albedo integer": (lambda: ml.Material(GREY), ["albedo", "srgb_to_linear"]),
    "albedo of the wrong shape": (lambda: ml.Material((0.5, 0.5)), ["albedo", "(3,)"]),
    "albedo image without uvs": (
        lambda: ml.Scene().add_mesh(trimesh.creation.box(), material=ml.Material(np.ones((2, 2, 3)))),
        ["UV"],
    ),
    "specular": (lambda: ml.Material(specular=(0.1, 0.1)), ["specular", "3 finite floats"]),
}


@pytest.mark.parametrize("name", sorted(CASES))
def test_each_is_a_scene_error_with_a_reason(name: str) -> None:
    attempt, parts = CASES[name]
    with pytest.raises(ml.SceneError) as caught:
        attempt()
    text = str(caught.value)
    assert len(text) > 20
    for part in parts:
        assert part in text


def test_names_are_unique_and_suggested(room: ml.Scene) -> None:
    with pytest.raises(ml.SceneError, match="'box'.*taken"):
        room.add_mesh(trimesh.creation.box(), name="box")
    with pytest.raises(ml.SceneError, match="'lamp'"):
        room.add_light(_light(), name="lamp")
    for attempt in (
        lambda: room.remove("bx"),
        lambda: room.set_transform("bx", np.eye(4)),
        lambda: room.set_vertices("bx", np.zeros((3, 3))),
        lambda: room.lights["lmp"],
    ):
        with pytest.raises((ml.SceneError, KeyError), match="did you mean"):
            attempt()


def test_nothing_is_half_changed(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    settings = ml.Settings(light_samples=4)
    before = renderer.render(room, camera, settings).image
    state = pickle.dumps(room)
    lamp = room.lights["lamp"]
    assert isinstance(lamp, ml.AreaLight)
    attempts: list[Callable[[], object]] = [
        lambda: room.add_mesh(_mesh(TRIANGLE, [[0, 1, 7]]), name="new"),
        lambda: room.add_mesh(trimesh.creation.box(), name="new", transform=np.zeros((4, 4))),
        lambda: room.set_transform("box", np.full((4, 4), NAN)),
        lambda: room.set_vertices("box", np.zeros((3, 3))),
        lambda: room.set_vertices("box", np.full_like(trimesh.creation.box().vertices, NAN)),
        lambda: setattr(lamp, "radiance", (1.0, NAN, 1.0)),
        lambda: setattr(lamp, "radiance", np.ones((2, 3))),
        lambda: setattr(lamp, "edge_u", (0.0, 0.0, 3.0)),
    ]
    for attempt in attempts:
        with pytest.raises(ml.SceneError):
            attempt()
    assert "new" not in room.meshes
    assert np.array_equal(renderer.render(room, camera, settings).image, before)
    assert len(pickle.dumps(room)) == len(state)


def test_images_beyond_the_adapter(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    over = renderer.adapter["limits"]["max_storage_buffer_binding_size"] // 16 + 1
    for width, height in ((over, 1), (1, over), (300_000, 300_000)):
        with pytest.raises((ml.SceneError, ml.DeviceError), match=r"\d{3}"):
            renderer.render(room, camera.replace(width=width, height=height), ml.Settings(light_samples=1))
    assert renderer.render(room, camera, ml.Settings(light_samples=1)).image.any()


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".xml"])
def test_files_that_are_missing_or_cut_short(tmp_path: Path, suffix: str) -> None:
    load = ml.Scene.from_mitsuba if suffix == ".xml" else ml.Scene.from_trimesh
    path = tmp_path / f"mesh{suffix}"
    with pytest.raises(ml.SceneError, match="mesh"):
        load(path)
    if suffix == ".xml":
        path.write_text("<scene version='3.0.0'><shape type='rectangle'>")
    else:
        trimesh.creation.icosphere(subdivisions=2).export(path)
        path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(ml.SceneError, match="mesh"):
        load(path)


def test_no_lights(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    room.remove("lamp")
    frame = renderer.render(room, camera)
    assert not frame.image.any()
    assert frame.surface_mask.any()
    assert frame.albedo.any()
    assert frame.fragments.total == np.count_nonzero(frame.surface_mask)


def test_no_meshes(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    room.remove("floor")
    room.remove("box")
    frame = renderer.render(room, camera)
    assert not frame.surface_mask.any()
    assert np.array_equal(frame.image.any(axis=-1), frame.light_mask)


def test_an_empty_scene(renderer: ml.Renderer, camera: ml.Camera) -> None:
    frame = renderer.render(ml.Scene(), camera, ml.Settings(indirect="final-gather"))
    assert not frame.image.any()
    assert np.all(np.isinf(frame.depth))
    assert np.all(frame.fragments.level_map == 255)
    assert frame.fragments.total == 0


def test_a_light_behind_everything(renderer: ml.Renderer, camera: ml.Camera) -> None:
    scene = ml.Scene()
    wall = _mesh([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]], [[0, 1, 2], [0, 2, 3]])
    scene.add_mesh(wall, shading="flat")
    scene.add_light(_light(corner=(-1, -1, -3), edge_u=(2, 0, 0), edge_v=(0, 2, 0)))
    frame = renderer.render(scene, camera)
    assert frame.surface_mask.any()
    assert not frame.direct.any()


def test_a_camera_inside_an_object(renderer: ml.Renderer) -> None:
    scene = ml.Scene.from_trimesh(trimesh.creation.box((2, 2, 2)), shading="flat")
    scene.add_light(_light(corner=(-5, 5, -5), edge_u=(10, 0, 0), edge_v=(0, 0, 10), radiance=(9.0, 9, 9)))
    inside = ml.Camera.look_at((0, 0, 0), (0, 0, -1), width=16, height=12)
    dark = renderer.render(scene, inside)
    assert dark.surface_mask.all()
    assert not dark.image.any()
    # a light in there with it is seen by the inner sides
    scene.add_light(_light(corner=(-0.2, 0.8, -0.2), edge_u=(0.4, 0, 0), edge_v=(0, 0, 0.4)), name="inner")
    assert (renderer.render(scene, inside).direct > 0).all(axis=-1).mean() > 0.9


def test_dtypes_orders_and_strides_do_not_matter(renderer: ml.Renderer, camera: ml.Camera) -> None:
    box = trimesh.creation.box((2, 2, 2))
    images = []
    for convert in (
        lambda a: np.asarray(a, np.float64),
        lambda a: np.asarray(a, np.float32),
        lambda a: np.asfortranarray(a),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: np.asarray(a).tolist(),
        lambda a: np.asarray(a).astype(np.int16),
    ):
        scene = ml.Scene()
        scene.add_arrays(convert(box.vertices), np.asarray(box.faces, np.int16)[::-1][::-1], shading="flat")
        light = _light(corner=convert(np.array([-1.0, 4.0, -1.0])), edge_u=(2, 0, 0), edge_v=(0, 0, 2))
        scene.add_light(light)
        images.append(renderer.render(scene, camera, ml.Settings(light_samples=4)).image)
    assert images[0].any()
    for image in images[1:]:
        assert np.array_equal(image, images[0])
