"""Same adapter, seed and settings: the same bits, from any renderer, in any order, in any process."""

from __future__ import annotations

import hashlib
import pickle
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import miplight as ml
from miplight.frame import IMAGES

SETTINGS = {
    "direct": ml.Settings(light_samples=16),
    "grid": ml.Settings(light_samples=16, light_pattern="grid"),
    "indirect": ml.Settings(light_samples=4, indirect="final-gather", gather_rays=9, bounces=2),
    "supersampled": ml.Settings(light_samples=4, supersample=2),
}


def _digest(frame: ml.Frame) -> str:
    """A hash of everything that a frame holds."""
    digest = hashlib.sha256()
    for name in IMAGES:
        digest.update(np.ascontiguousarray(frame[name]).tobytes())
    digest.update(frame.fragments.level_map.tobytes())
    digest.update(frame.fragments.reason_map.tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("name", sorted(SETTINGS))
def test_five_renders_and_a_second_renderer(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, name: str
) -> None:
    first = {_digest(renderer.render(room, camera, SETTINGS[name])) for _ in range(5)}
    with ml.Renderer(renderer.adapter["name"]) as second:
        first.add(_digest(second.render(room, camera, SETTINGS[name])))
    assert len(first) == 1


def test_another_seed_gives_other_bits(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    settings = SETTINGS["direct"]
    one = renderer.render(room, camera, settings).direct
    two = renderer.render(room, camera, settings.replace(seed=1)).direct
    assert not np.array_equal(one, two)
    # and yet the same picture
    assert two.mean() == pytest.approx(one.mean(), rel=0.02)
    assert _digest(renderer.render(room, camera, settings.replace(seed=0))) == _digest(
        renderer.render(room, camera, settings)
    )


def test_what_was_rendered_before_does_not_matter(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    before = _digest(renderer.render(room, camera, SETTINGS["direct"]))
    renderer.render(room, camera.replace(width=31, height=17), SETTINGS["indirect"])
    other = ml.Scene()
    renderer.render(other, camera, SETTINGS["grid"])
    assert _digest(renderer.render(room, camera, SETTINGS["direct"])) == before


def test_changes_undone_leave_no_trace(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    before = renderer.render(room, camera, SETTINGS["direct"])
    digest = _digest(before)
    lamp, pose = room.lights["lamp"], np.eye(4)
    lamp.radiance = (1.0, 2.0, 3.0)
    room.set_transform("floor", np.diag([1.0, 1.0, 0.5, 1.0]))
    assert _digest(renderer.render(room, camera, SETTINGS["direct"])) != digest
    lamp.radiance = (8.0, 8.0, 8.0)
    room.set_transform("floor", pose)
    assert _digest(renderer.render(room, camera, SETTINGS["direct"])) == digest


def test_new_radiance_rebuilds_nothing(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    renderer.render(room, camera, SETTINGS["direct"])
    still = renderer.render(room, camera, SETTINGS["direct"], outputs=("direct",))
    assert still.stats.rebuilt == []
    room.lights["lamp"].radiance = (2.0, 2.0, 2.0)
    dimmed = renderer.render(room, camera, SETTINGS["direct"])
    assert not [part for part in dimmed.stats.rebuilt if "BVH" in part or "geometry" in part]
    np.testing.assert_allclose(dimmed.direct, still.direct / 4, rtol=1e-5, atol=1e-7)


def test_resolved_settings_reproduce_the_bits(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    frame = renderer.render(room, camera, ml.Settings(light_samples=9))
    digest = _digest(frame)
    again = ml.Settings.from_dict(frame.settings.to_dict())
    assert _digest(renderer.render(room, camera, again)) == digest


def test_pickled_scenes_and_cameras_give_the_same_bits(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    digest = _digest(renderer.render(room, camera, SETTINGS["direct"]))
    scene, view, settings = pickle.loads(pickle.dumps((room, camera, SETTINGS["direct"])))
    assert _digest(renderer.render(scene, view, settings)) == digest


def test_another_process_gives_the_same_bits(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    code = """
        import pickle, sys, warnings
        warnings.simplefilter("ignore")
        import miplight as ml
        scene, camera, settings, adapter = pickle.load(sys.stdin.buffer)
        frame = ml.Renderer(adapter).render(scene, camera, settings)
        sys.stdout.buffer.write(frame.image.tobytes())
    """
    job = (room, camera, SETTINGS["indirect"], renderer.adapter["name"])
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        input=pickle.dumps(job),
        stdout=subprocess.PIPE,
        timeout=120,
        check=True,
    )
    assert done.stdout == renderer.render(room, camera, SETTINGS["indirect"]).image.tobytes()
