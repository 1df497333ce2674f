"""The renderer: arguments, plans, batches, one-call renders, threads, Ctrl-C, forks, warnings, closing."""

from __future__ import annotations

import concurrent.futures
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest
import trimesh

import miplight as ml
from miplight import one_call


def test_adapters_describe_this_machine(renderer: ml.Renderer) -> None:
    found = ml.adapters()
    assert found
    for about in found:
        assert {"name", "backend", "driver", "device_type", "software"} <= set(about)
    assert renderer.adapter["name"] in [about["name"] for about in found]
    assert renderer.adapter["trace"] in ("native", "wgsl")
    assert renderer.adapter["limits"]
    assert renderer.adapter["name"] in repr(renderer)


@pytest.mark.parametrize("adapter", ["no such adapter", "", 3, None])
def test_unknown_adapters(adapter: str) -> None:
    with pytest.raises(ml.DeviceError, match="adapter"):
        ml.Renderer(adapter)


def test_adapter_by_part_of_its_name(renderer: ml.Renderer) -> None:
    name = renderer.adapter["name"]
    with ml.Renderer(name[: max(4, len(name) // 2)].lower()) as again:
        assert again.adapter["name"] == name


def test_default_settings_are_the_default_preset(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    small = camera.replace(width=16, height=12)
    assert renderer.render(room, small).settings == ml.Settings.preset("default")
    assert renderer.render(room, small, "brute-force").settings == ml.Settings.preset("brute-force")


def test_what_a_render_refuses(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    with pytest.raises(ml.SceneError, match="scene is .*miplight.Scene"):
        renderer.render(trimesh.creation.box(), camera)
    with pytest.raises(ml.SceneError, match="(?s)camera is .*miplight.Camera"):
        renderer.render(room, np.eye(4))  # type: ignore[arg-type]
    with pytest.raises(ml.SettingsError, match="settings is 3"):
        renderer.render(room, camera, 3)  # type: ignore[arg-type]
    with pytest.raises(ml.SettingsError, match="did you mean 'brute-force'"):
        renderer.render(room, camera, "brute-forze")
    with pytest.raises(ml.SettingsError, match="did you mean 'normal'"):
        renderer.render(room, camera, outputs=("image", "normals"))
    with pytest.raises(ml.SettingsError, match="outputs is 3"):
        renderer.render(room, camera, outputs=(3,))  # type: ignore[arg-type]
    with pytest.raises(ml.SettingsError, match="no_such_resource"):
        renderer.render(room, camera, keep=("no_such_resource",))
    # and it still renders
    assert renderer.render(room, camera).image.any()


def test_a_scene_is_taken_as_it_is_when_render_is_called(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    frame = renderer.render(room, camera, quick, outputs=())
    room.remove("box")
    bare = ml.Renderer(renderer.adapter["name"])
    without = bare.render(room, camera, quick)
    assert not np.array_equal(frame.depth, without.depth)
    bare.close()


def test_plan_lists_every_pass_with_a_reason(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    plan = renderer.plan(room, camera, quick)
    assert plan.passes
    assert plan.skipped
    assert not set(plan.passes) & set(plan.skipped)
    for name, reason in plan.skipped.items():
        assert name in repr(plan)
        assert reason in repr(plan)
        assert reason in plan._repr_html_()
    with ml.Renderer(renderer.adapter["name"]) as fresh:
        stats = fresh.render(room, camera, quick).stats
    # passes have a folder in their name; the others are the host's own work
    assert [name for name in stats.stages if "/" in name] == list(plan.passes)
    assert stats.skipped == plan.skipped


def test_plan_follows_the_settings(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    off = renderer.plan(room, camera, ml.Settings(direct="off"))
    assert len(off.passes) < len(renderer.plan(room, camera).passes)
    assert "direct is off" in off.skipped.values()


def test_batch_of_cameras(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    cameras = [camera, camera.replace(fov_y=60)]
    frames = list(renderer.render_batch(room, cameras, quick))
    assert len(frames) == 2
    for view, frame in zip(cameras, frames, strict=True):
        assert np.array_equal(frame.image, renderer.render(room, view, quick).image)


def test_batch_of_matrices_is_lazy_and_checks_at_once(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    poses = np.stack([camera.world_from_camera] * 3)
    size = (camera.width, camera.height)
    frames = renderer.render_batch(room, poses, quick, fov_y=camera.fov_y, size=size)
    room.remove("box")
    with_box = next(frames)
    assert with_box.image.shape == (camera.height, camera.width, 3)
    assert not np.array_equal(with_box.image, renderer.render(room, camera, quick).image)
    assert len(list(frames)) == 2
    for bad, match in (
        ({"size": size}, "fov_y"),
        ({"fov_y": 40}, "size"),
        ({"fov_y": 0.0, "size": size}, "fov_y is 0"),
    ):
        with pytest.raises(ml.SceneError, match=match):
            renderer.render_batch(room, poses, quick, **bad)  # type: ignore[arg-type]
    with pytest.raises(ml.SceneError, match=r"\(N, 4, 4\)"):
        renderer.render_batch(room, np.eye(4), quick, fov_y=40, size=size)
    with pytest.raises(ml.SceneError, match=r"cameras\[1\]"):
        renderer.render_batch(room, np.stack([np.eye(4), np.zeros((4, 4))]), quick, fov_y=40, size=size)
    with pytest.raises(ml.SceneError, match="cameras have their own"):
        renderer.render_batch(room, [camera], quick, fov_y=40)
    with pytest.raises(ml.SceneError, match="a list"):
        renderer.render_batch(room, camera, quick)  # type: ignore[arg-type]
    assert list(renderer.render_batch(room, [], quick)) == []


def test_one_call(camera: ml.Camera, quick: ml.Settings, adapter: str) -> None:
    box = trimesh.creation.box((1, 1, 1))
    row = np.array([[-0.5, 2.5, -0.5, 1, 0, 0, 0, 0, 1, 8.0, 8.0, 8.0]])
    light = ml.AreaLight((-0.5, 2.5, -0.5), (1, 0, 0), (0, 0, 1), radiance=(8.0, 8.0, 8.0))
    by_row = ml.render(box, camera, row, quick, adapter=adapter).image
    by_list = ml.render([box], camera, row.tolist(), quick, adapter=adapter).image
    by_light = ml.render(trimesh.Scene([box]), camera, [light], quick, adapter=adapter).image
    scene = ml.Scene.from_trimesh(box)
    by_scene = ml.render(scene, camera, light, quick, adapter=adapter).image
    matrix, size = camera.world_from_camera, (camera.width, camera.height)
    by_matrix = ml.render(box, matrix, row, quick, fov_y=camera.fov_y, size=size, adapter=adapter).image
    assert by_row.any()
    for other in (by_list, by_light, by_scene, by_matrix):
        assert np.array_equal(by_row, other)
    assert not scene.lights, "the caller's scene was changed"
    assert not ml.render(box, camera, None, quick, adapter=adapter).image.any()


@pytest.mark.parametrize(
    ("lights", "match"),
    [
        (np.zeros((2, 11)), r"\(N, 12\)"),
        (np.zeros(12), r"\(N, 12\)"),
        ("lamp", r"\(N, 12\)"),
        (np.array([[0, 2, 0, 1, 0, 0, 0, 0, 1, 8, 8, 8]]), "srgb_to_linear"),
        (np.array([[0, 2, 0, 1, 0, 0, 0, 0, 1, 8, -8, 8.0]]), "radiance"),
        (np.array([[0, 2, 0, 1, 0, 0, 2, 0, 0, 8, 8, 8.0]]), "edge"),
    ],
)
def test_one_call_refuses_lights(lights: object, match: str) -> None:
    with pytest.raises(ml.SceneError, match=match):
        one_call.as_lights(lights)


def test_one_call_refuses_a_camera_without_size(camera: ml.Camera) -> None:
    box = trimesh.creation.box()
    with pytest.raises(ml.SceneError, match="fov_y"):
        ml.render(box, np.eye(4))
    with pytest.raises(ml.SceneError, match="size"):
        ml.render(box, np.eye(4), fov_y=40)
    with pytest.raises(ml.SceneError, match="size is 64"):
        ml.render(box, np.eye(4), fov_y=40, size=64)  # type: ignore[arg-type]
    with pytest.raises(ml.SceneError, match="camera has its own"):
        ml.render(box, camera, size=(4, 4))


def test_closing(adapter: str, room: ml.Scene, camera: ml.Camera, quick: ml.Settings) -> None:
    with ml.Renderer(adapter) as renderer:
        frame = renderer.render(room, camera, quick)
        image = frame.image
    renderer.close()
    with pytest.raises(ml.DeviceError, match="closed"):
        renderer.render(room, camera, quick)
    with pytest.raises(ml.DeviceError):
        _ = frame.normal
    assert np.array_equal(frame.image, image)


def test_a_renderer_does_not_pickle(renderer: ml.Renderer) -> None:
    with pytest.raises(TypeError, match="device"):
        pickle.dumps(renderer)


def test_threads_share_a_renderer(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    cameras = [camera.replace(fov_y=30 + 10 * (i % 3)) for i in range(9)]
    alone = [renderer.render(room, view, quick).image for view in cameras[:3]]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        frames = list(pool.map(lambda view: renderer.render(room, view, quick), cameras))
    for i, frame in enumerate(frames):
        assert np.array_equal(frame.image, alone[i % 3])


def test_the_interpreter_is_free_while_rendering(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    long = (room, camera.replace(width=320, height=240), ml.Settings(light_samples=256))
    started = time.perf_counter()
    renderer.render(*long)
    alone = time.perf_counter() - started
    ticks: list[float] = []
    thread = threading.Thread(target=renderer.render, args=long)
    thread.start()
    while thread.is_alive():
        ticks.append(time.perf_counter())
        time.sleep(0.001)
    thread.join()
    gaps = np.diff(ticks)
    assert gaps.max() < max(0.5 * alone, 0.05)


# A fresh interpreter: signals, forks and once-per-process warnings need one of their own.
_PREAMBLE = """
import os, signal, sys, threading, time, warnings
import numpy as np, trimesh
import miplight as ml
warnings.simplefilter("ignore")
scene = ml.Scene.from_trimesh(trimesh.creation.icosphere(subdivisions=4))
scene.add_light(ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), radiance=(8.0, 8.0, 8.0)))
camera = ml.Camera.look_at((0, 1, 3), (0, 0, 0), width=WIDTH, height=WIDTH)
renderer = ml.Renderer(os.environ.get("MIPLIGHT_ADAPTER", "auto"))
"""


def _run(code: str, width: int = 32) -> str:
    script = _PREAMBLE.replace("WIDTH", str(width)) + textwrap.dedent(code)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_ctrl_c_ends_a_render_soon_and_leaves_the_renderer_usable() -> None:
    out = _run(
        """
        settings = ml.Settings(light_samples=4096, indirect="final-gather", gather_rays=4096)
        def press():
            time.sleep(1.0)
            os.kill(os.getpid(), signal.SIGINT)
        threading.Thread(target=press, daemon=True).start()
        start = time.perf_counter()
        try:
            renderer.render(scene, camera, settings)
            print("finished", time.perf_counter() - start)
        except KeyboardInterrupt:
            print("interrupted", time.perf_counter() - start)
        print(renderer.render(scene, camera.replace(width=16, height=16)).image.any())
        """,
        width=1024,
    )
    first, second = out.splitlines()
    word, seconds = first.split()
    assert word == "interrupted"
    assert float(seconds) < 3.0, "one second until the key, and pieces of about 100 ms"
    assert second == "True"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_renderer_used_after_fork_says_so() -> None:
    out = _run(
        """
        frame = renderer.render(scene, camera)
        child = os.fork()
        if child == 0:
            try:
                renderer.render(scene, camera)
                code = 1
            except ml.DeviceError as error:
                code = 0 if "fork" in str(error) else 2
            try:
                frame.normal
                code = 3
            except ml.DeviceError as error:
                code = code if "fork" in str(error) else 4
            renderer.close()
            try:
                ml.Renderer()
                code = 5
            except ml.DeviceError as error:
                code = code if "fork" in str(error) else 6
            os._exit(code)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), renderer.render(scene, camera).image.any())
        """
    )
    assert out.split() == ["0", "True"]


def test_a_software_adapter_is_announced_once(renderer: ml.Renderer) -> None:
    out = _run(
        """
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            import miplight.renderer
            miplight.renderer._warned = threading.Lock()
            ml.Renderer(renderer.adapter["name"]); ml.Renderer(renderer.adapter["name"])
        for w in caught:
            print(w.category.__name__, "software adapter" in str(w.message), w.filename)
        """
    )
    if renderer.adapter["software"]:
        assert out.split()[:2] == ["SoftwareAdapterWarning", "True"]
        assert len(out.splitlines()) == 1
        assert "miplight" not in out.split()[2], "the warning points into the package, not at its user"
    else:
        assert not out
    assert issubclass(ml.SoftwareAdapterWarning, UserWarning)


def test_signals_are_python_s_own() -> None:
    # importing the package must not take Ctrl-C away from Python
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
