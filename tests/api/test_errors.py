"""The exception family, and that the core raises nothing else."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight import _core

FAMILY = {
    ml.SceneError: ValueError,
    ml.SettingsError: ValueError,
    ml.DeviceError: RuntimeError,
    ml.ShaderError: RuntimeError,
}


@pytest.mark.parametrize("kind", list(FAMILY))
def test_each_is_one_of_ours_and_a_builtin(kind: type[ml.MiplightError]) -> None:
    assert issubclass(kind, ml.MiplightError)
    assert issubclass(kind, FAMILY[kind])
    assert kind.__doc__
    error = kind("what went wrong")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert str(again) == "what went wrong"


def test_what_is_not_there_yet_says_so() -> None:
    attempts: list[Callable[[], object]] = [
        lambda: ml.Settings(target_error=0.1),
        lambda: ml.Settings(budget_ms=10),
    ]
    for attempt in attempts:
        with pytest.raises(ml.MiplightError, match="not available yet"):
            attempt()


def _box() -> _core.Mesh:
    import trimesh

    box = trimesh.creation.box()
    return _core.Mesh(np.asarray(box.vertices, np.float64), np.asarray(box.faces, np.uint32))


def test_the_core_checks_what_the_face_would_have_checked() -> None:
    # nothing below may panic: a panic is no Exception and would end a program
    corners = np.zeros((3, 3))
    attempts: list[Callable[[], object]] = [
        lambda: _core.Mesh(corners, np.array([[0, 1, 9]], np.uint32)),
        lambda: _core.Mesh(corners, np.array([[0, 1, 2]], np.uint32)),
        lambda: _core.Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.uint32)),
        lambda: _core.Mesh(np.zeros((3, 2)), np.array([[0, 1, 2]], np.uint32)),
        lambda: _core.Mesh(np.eye(3), np.array([[0, 1, 2]], np.uint32), np.zeros((2, 3), np.float32)),
        lambda: _core.Texture(np.zeros((0, 4, 3), np.float32)),
        lambda: _core.Texture(np.full((2, 2, 3), np.nan, np.float32)),
        lambda: _core.Texture(np.zeros((2, 2, 4), np.float32)),
        lambda: _core.Snapshot(
            [
                _core.Instance(
                    "x", _box(), np.zeros((4, 4)), False, (0.5, 0.5, 0.5), None, False, (0, 0, 0, 1)
                )
            ],
            [],
            [],
        ),
        lambda: _core.Snapshot(
            [], [_core.AreaLight("x", (0, 0, 0), (0, 0, 0), (0, 0, 1), (1, 1, 1), False, True, False)], []
        ),
        lambda: _core.Snapshot([], [], [_core.SpotLight("x", (0, 0, 0), (0, 0, 0), (1, 1, 1), 45.0)]),
    ]
    for attempt in attempts:
        with pytest.raises(ml.SceneError) as caught:
            attempt()
        assert len(str(caught.value)) > 10


@pytest.mark.parametrize(
    "wrong", [None, 3, "x", [], np.zeros((2, 2), np.int64), np.zeros((2, 3), np.float32)]
)
def test_wrong_types_are_exceptions_too(wrong: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        _core.Mesh(wrong, np.zeros((1, 3), np.uint32))
    with pytest.raises((TypeError, ValueError)):
        _core.Texture(wrong)
    with pytest.raises((TypeError, ValueError)):
        _core.Snapshot([wrong], [], [])


def test_settings_are_checked_by_the_core_as_well(room: ml.Scene, camera: ml.Camera) -> None:
    core = _core.Renderer("auto")
    job = (room._core_snapshot(), camera._core_camera())
    for settings in ({"ligth_samples": 3}, {"light_samples": 0}, {"indirect": "lvp"}, {"direct": "maybe"}):
        with pytest.raises(ml.SettingsError, match=next(iter(settings))):
            core.render(*job, settings, [])
    with pytest.raises(ml.SettingsError, match="no_such_thing"):
        core.render(*job, {}, ["no_such_thing"])
    frame = core.render(*job, {"light_samples": 1}, [])
    with pytest.raises(ml.SettingsError, match="no_such_thing"):
        frame.read("no_such_thing")
    core.close()
    core.close()
    with pytest.raises(ml.DeviceError, match="closed"):
        core.render(*job, {}, [])


def test_what_the_check_raises_ends_the_render(room: ml.Scene) -> None:
    class EnoughError(Exception):
        pass

    def stop() -> None:
        raise EnoughError("enough")

    core = _core.Renderer("auto")
    camera = ml.Camera.look_at((0, 1.6, 6), (0, 1.2, 0), width=512, height=512)
    job = (room._core_snapshot(), camera._core_camera(), {"light_samples": 1024}, [])
    with pytest.raises(EnoughError, match="enough"):
        core.render(*job, stop)
    # the interrupted frame leaves nothing behind
    small = (job[0], camera.replace(width=16, height=16)._core_camera(), {"light_samples": 4}, [])
    assert core.render(*small).read("image").any()
