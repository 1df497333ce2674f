"""What a sweep renders: products, lists, names of cameras and lights, hashes, and slips told at once."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight.study_points import Point, Study, make_study
from miplight.study_rows import COLUMNS

QUICK = {"preset": "brute-force", "light_samples": 4}


def _make(
    scene: ml.Scene, camera: Any, grid: Any, reference: Any = None, repeats: int = 1
) -> tuple[Study, list[Point]]:
    return make_study(scene, camera, grid, reference, repeats, "auto")


def _points(scene: ml.Scene, camera: Any, grid: Any, **more: Any) -> list[Point]:
    return _make(scene, camera, grid, **more)[1]


def test_a_grid_is_every_combination(room: ml.Scene, camera: ml.Camera) -> None:
    grid = {"preset": ["default", "brute-force"], "light_samples": np.array([4, 16]), "seed": range(3)}
    points = _points(room, camera, grid)
    assert [(p.preset, p.settings.light_samples, p.settings.seed) for p in points] == [
        (preset, samples, seed)
        for preset in ("default", "brute-force")
        for samples in (4, 16)
        for seed in range(3)
    ]
    expected = ml.Settings.preset("brute-force").replace(light_samples=16, seed=2)
    assert points[-1].settings == expected
    assert len({p.key for p in points}) == 12


def test_a_list_is_taken_one_by_one_and_doubles_once(room: ml.Scene, camera: ml.Camera) -> None:
    own = ml.Settings(light_samples=9)
    grid = ["default", own, {"light_samples": 5}, {"seed": [0, 1]}, own, {"light_samples": [5]}]
    points = _points(room, camera, grid)
    default = ml.Settings.preset("default")
    expected = [default, own, default.replace(light_samples=5), default.replace(seed=1)]
    assert [p.settings for p in points] == expected
    assert [p.preset for p in points] == ["default", "", "default", "default"]
    for lone in (own, "default", {}):
        assert len(_points(room, camera, lone)) == 1


def test_cameras_and_lights_have_names(room: ml.Scene, camera: ml.Camera) -> None:
    side = camera.replace(fov_y=30)
    lamp = room.lights["lamp"].copy()
    spot = ml.SpotLight(position=(0, 3, 0), target=(0, 0, 0), intensity=(9, 9, 9), cutoff=40)
    lights = {"lamp": lamp, "both": [lamp, spot]}
    grid = {"camera": {"front": camera, "side": side}, "lights": lights, **QUICK}
    study, points = _make(room, None, grid)
    assert [(p.camera, p.lights) for p in points] == [
        ("front", "lamp"),
        ("front", "both"),
        ("side", "lamp"),
        ("side", "both"),
    ]
    assert list(map(type, study.scenes["both"].lights.values())) == [ml.AreaLight, ml.SpotLight]
    assert list(room.lights) == ["lamp"], "the scene is left as it was"
    assert study.scenes["both"].meshes["box"].geometry is room.meshes["box"].geometry
    named = _points(room, {"front": camera}, QUICK)
    assert [(p.camera, p.lights) for p in named] == [("front", "scene")]


def test_the_hash_is_of_all_that_a_picture_depends_on(room: ml.Scene, camera: ml.Camera) -> None:
    def key(scene: ml.Scene = room, view: ml.Camera = camera, grid: Any = QUICK, **more: Any) -> str:
        (point,) = _points(scene, view, grid, **more)
        return point.key

    again = pickle.loads(pickle.dumps(room))
    assert key() == key(again, pickle.loads(pickle.dumps(camera))), "the same in another process"
    assert key() == key(grid=ml.Settings.preset("brute-force").replace(light_samples=4))
    moved, dimmed, painted = room.copy(), room.copy(), room.copy()
    moved.set_transform("box", np.diag([1, 2, 1, 1]))
    dimmed.lights["lamp"].radiance = (1, 2, 3)
    painted.set_material("floor", ml.Material((0.1, 0.2, 0.3)))
    black = np.zeros((36, 48, 3), np.float32)
    keys = [
        key(),
        *(key(scene) for scene in (moved, dimmed, painted)),
        key(view=camera.replace(fov_y=44)),
        key(grid={**QUICK, "seed": 1}),
        key(reference=black),
        key(reference=black + 1),
        key(repeats=2),
    ]
    assert len(set(keys)) == len(keys)
    assert key(repeats=2) == key(repeats=5), "more repeats go on where fewer ended"


def test_what_is_sent_is_small_and_whole(room: ml.Scene, camera: ml.Camera) -> None:
    lamp = room.lights["lamp"].copy()
    lights = {f"lamp {i}": lamp for i in range(20)}
    study, _ = _make(room, camera, {"lights": lights, **QUICK})
    one, _ = _make(room, camera, QUICK)
    sent = pickle.dumps(study)
    assert len(sent) < len(pickle.dumps(one)) + 20 * 4000, "geometry is sent once"
    assert list(pickle.loads(sent).scenes) == list(lights)


def test_references_are_found_by_place(room: ml.Scene, camera: ml.Camera) -> None:
    wide = camera.replace(width=60)
    small, large = np.ones((36, 48, 3), np.float32), np.ones((36, 60, 3), np.float32)
    grid = {"camera": {"small": camera, "large": wide}, "lights": {"lamp": room.lights["lamp"]}, **QUICK}
    for reference in (
        {"small": small, "large": large},
        {("small", "lamp"): small, "large": large},
    ):
        study, _ = _make(room, None, grid, reference)
        assert study.references["large", "lamp"].shape == (36, 60, 3)
    with pytest.raises(ml.SettingsError, match="nothing for camera 'large'"):
        _make(room, None, grid, {"small": small})
    with pytest.raises(ml.SettingsError, match=r"\(36, 60, 3\), the size of the camera 'large'"):
        _make(room, None, grid, small)


@pytest.mark.parametrize(
    ("grid", "says"),
    [
        ({"light_sample": [4]}, "did you mean 'light_samples'"),
        ({"preset": ["brute"]}, "did you mean 'brute-force'"),
        ({"light_samples": [4, -1]}, "light_samples.*-1"),
        ({"light_samples": []}, "one value or more"),
        ({"camera": [1, 2]}, "a dict from names"),
        ({"lights": {"x": 3}}, "lights is 3"),
        ({"lights": {}}, "a dict from names"),
        ([{"seed": 1}, 7], "grid is 7"),
        (7, "grid is 7"),
        ([{"camera": {"a": None}}], "camera is None"),
    ],
)
def test_slips_are_told_before_anything_is_rendered(
    room: ml.Scene, camera: ml.Camera, grid: Any, says: str
) -> None:
    with pytest.raises(ml.MiplightError, match=says):
        _make(room, camera, grid)


def test_one_name_is_one_thing(room: ml.Scene, camera: ml.Camera) -> None:
    grid: list[dict[str, Any]] = [{"camera": {"a": camera}}, {"camera": {"a": camera}, "seed": 1}]
    assert len(_points(room, None, grid)) == 2
    grid[1]["camera"] = {"a": camera.replace(fov_y=9)}
    with pytest.raises(ml.SettingsError, match="has not been given to something else"):
        _points(room, None, grid)
    lamp = room.lights["lamp"].copy()
    lights = [{"lights": {"a": lamp}}, {"lights": {"a": [lamp, lamp]}}]
    with pytest.raises(ml.SettingsError, match="has not been given to something else"):
        _points(room, camera, lights)
    with pytest.raises(ml.SceneError, match="camera is None"):
        _points(room, None, {})


def test_no_setting_is_called_like_a_column() -> None:
    assert len(COLUMNS) == len(set(COLUMNS))
