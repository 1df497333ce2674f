"""A renderer that keeps what did not change shows the same bits as one that has seen nothing before."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

import miplight as ml
from tests.analytic.closed_forms import floor_scene, view_down

OUTPUTS = ("image", "albedo", "normal", "depth", "light_mask", "surface_mask")
SETTINGS = ml.Settings.preset("brute-force").replace(
    light_samples=16, indirect="final-gather", gather_rays=4, bounces=2
)


def _scene() -> ml.Scene:
    lamp = ml.AreaLight((-0.3, 1.5, -0.3), (0.8, 0, 0), (0, 0, 0.8), (3, 3, 3))
    scene = floor_scene(lamp, ml.SpotLight((1, 2, 0), (0, 0, 0), (4, 4, 4), 50))
    ball = trimesh.creation.icosphere(2, 0.5)
    ball.visual = trimesh.visual.TextureVisuals(uv=np.asarray(ball.vertices[:, :2]))
    scene.add_mesh(ball, name="ball", material=ml.Material((0.5, 0.5, 0.5)))
    return scene


def _picture(seed: int = 0, size: tuple[int, int] = (4, 4)) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.1, 0.9, (*size, 3)).astype(np.float32)


def _lift(scene: ml.Scene) -> None:
    moved = np.eye(4)
    moved[1, 3] = 0.4
    scene.set_transform("ball", moved)


def _swell(scene: ml.Scene) -> None:
    scene.set_vertices("ball", 1.2 * trimesh.creation.icosphere(2, 0.5).vertices)


def _remove_all(scene: ml.Scene, names: list[str]) -> None:
    for name in names:
        scene.remove(name)


def _lamp(scene: ml.Scene) -> ml.AreaLight:
    light = scene.lights["light_0"]
    assert isinstance(light, ml.AreaLight)
    return light


def _set_lamp(**values: object) -> Callable[[ml.Scene], None]:
    def change(scene: ml.Scene) -> None:
        for name, value in values.items():
            setattr(_lamp(scene), name, value)

    return change


def _set_material(name: str, albedo: object) -> Callable[[ml.Scene], None]:
    return lambda scene: scene.set_material(name, ml.Material(albedo))  # type: ignore[arg-type]


CHANGES: dict[str, Callable[[ml.Scene], object]] = {
    "albedo": _set_material("floor", (0.1, 0.2, 0.9)),
    "picture": _set_material("ball", _picture()),
    "another picture": _set_material("ball", _picture(1)),
    "larger picture": _set_material("ball", _picture(2, (16, 8))),
    "no picture": _set_material("ball", (0.9, 0.1, 0.1)),
    "transform": _lift,
    "vertices": _swell,
    "radiance": _set_lamp(radiance=(1.0, 5.0, 1.0)),
    "light picture": _set_lamp(radiance=_picture(3)),
    "another light picture": _set_lamp(radiance=_picture(4)),
    "linear": _set_lamp(filter="linear"),
    "constant again": _set_lamp(radiance=(2.0, 2.0, 2.0)),
    "light moved": _set_lamp(corner=(0.1, 1.2, -0.3)),
    "both sides": _set_lamp(two_sided=True),
    "invisible": _set_lamp(visible=False),
    "added": lambda scene: scene.add_mesh(trimesh.creation.box((0.3, 2, 0.3)), name="post", shading="flat"),
    "removed": lambda scene: scene.remove("ball"),
    "light added": lambda scene: scene.add_light(ml.SpotLight((-1, 1, 0), (0, 0, 0), (9, 1, 1), 60)),
    "light removed": lambda scene: scene.remove("light_0"),
    "all lights removed": lambda scene: _remove_all(scene, list(scene.lights)),
    "all meshes removed": lambda scene: _remove_all(scene, list(scene.meshes)),
}


def test_every_change_shows_at_once(adapter: str) -> None:
    """One scene changed step by step: after each step it shows the bits of a fresh renderer."""
    scene, camera = _scene(), view_down(20, 16)
    with ml.Renderer(adapter) as kept:
        before = kept.render(scene, camera, SETTINGS, outputs=OUTPUTS)
        for name, change in CHANGES.items():
            change(scene)
            frame = kept.render(scene, camera, SETTINGS, outputs=OUTPUTS)
            with ml.Renderer(adapter) as fresh:
                expected = fresh.render(scene, camera, SETTINGS, outputs=OUTPUTS)
            for output in OUTPUTS:
                assert (frame[output] == expected[output]).all(), f"{output} after {name!r}"
            assert any((frame[o] != before[o]).any() for o in OUTPUTS), f"{name!r} shows"
            before = frame


@pytest.mark.parametrize("name", ["radiance", "light picture", "both sides"])
def test_a_light_that_changes_rebuilds_nothing(adapter: str, name: str) -> None:
    """Its table is sent again; the G-buffer stays, and so do all trees."""
    scene, camera = _scene(), view_down(20, 16)
    with ml.Renderer(adapter) as kept:
        kept.render(scene, camera, SETTINGS)
        CHANGES[name](scene)
        frame = kept.render(scene, camera, SETTINGS)
        assert set(frame.stats.rebuilt) <= {"lights"}
        assert "geometry/gbuffer" in frame.stats.skipped
        scene.set_material("floor", ml.Material((0.1, 0.1, 0.1)))
        assert "geometry/gbuffer" not in kept.render(scene, camera, SETTINGS).stats.skipped


def test_settings_and_cameras_may_change_between_frames(adapter: str) -> None:
    scene = _scene()
    variants = [
        SETTINGS.replace(light_samples=4096),
        SETTINGS.replace(indirect="off"),
        SETTINGS.replace(direct="off"),
        SETTINGS.replace(supersample=2),
        SETTINGS.replace(visibility="none"),
        SETTINGS.replace(gather_rays=25, bounces=1),
        SETTINGS.replace(light_pattern="grid", light_samples=1),
        SETTINGS,
    ]
    with ml.Renderer(adapter) as kept:
        for k, settings in enumerate(variants):
            for camera in (view_down(20, 16), view_down(20 + k, 3)):
                frame = kept.render(scene, camera, settings, outputs=OUTPUTS)
                with ml.Renderer(adapter) as fresh:
                    expected = fresh.render(scene, camera, settings, outputs=OUTPUTS)
                for output in OUTPUTS:
                    assert (frame[output] == expected[output]).all(), f"{output}, {settings!r}"
