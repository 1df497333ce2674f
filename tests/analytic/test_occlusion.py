"""Occlusion by voxels and by shadow maps in whole frames: what is hidden, what is not, how near to rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml

COARSE = [
    {"visibility": "voxel"},
    {"visibility": "voxel", "voxel_march": "dda"},
    {"visibility": "shadow-map"},
]
FLOOR_MATERIAL = ml.Material((0.8, 0.8, 0.8))


def _settings(**changes: Any) -> ml.Settings:
    return ml.Settings.preset("brute-force").replace(light_samples=36, **changes)


def _slab(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    return ml.shapes.box(size, center)


def _floor_and_lamp(*things: trimesh.Trimesh, visible: bool = False) -> ml.Scene:
    """A floor at y = 0 under a lamp of 1 × 1 at y = 3, with a ceiling right above the lamp."""
    scene = ml.Scene()
    floor = trimesh.Trimesh(
        [[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    scene.add_mesh(floor, name="floor", material=FLOOR_MATERIAL, shading="flat")
    scene.add_mesh(_slab((8, 0.1, 8), (0, 3.06, 0)), name="ceiling", shading="flat")
    for k, thing in enumerate(things):
        scene.add_mesh(thing, name=f"thing_{k}", material=FLOOR_MATERIAL, shading="flat")
    lamp = ml.AreaLight((-0.5, 3, -0.5), (1, 0, 0), (0, 0, 1), radiance=(10, 10, 10), visible=visible)
    scene.add_light(lamp, name="lamp")
    return scene


def _view(size: int = 96) -> ml.Camera:
    """The floor, the ceiling and the lamp are in it."""
    return ml.Camera.look_at((0, 2.2, 7), (0, 1.2, 0), fov_y=50, width=size, height=size)


def _direct(renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, **changes: Any) -> NDArray[np.float64]:
    frame = renderer.render(scene, camera, _settings(**changes))
    light: NDArray[np.float64] = frame.direct.astype(np.float64).sum(-1)
    return light


def _error(found: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float(np.sqrt(((found - exact) ** 2).mean() / (exact**2).mean()))


@pytest.mark.parametrize("how", COARSE)
@pytest.mark.parametrize("visible", [False, True])
def test_nothing_in_between_hides_nothing(renderer: ml.Renderer, how: dict[str, Any], visible: bool) -> None:
    """Neither the floor itself, nor the ceiling a hand above the lamp, nor the lamp."""
    scene, camera = _floor_and_lamp(visible=visible), _view()
    found, open_ = (_direct(renderer, scene, camera, **more) for more in (how, {"visibility": "none"}))
    assert (open_ > 0).mean() > 0.25
    assert np.array_equal(found, open_)


@pytest.mark.parametrize("how", COARSE)
def test_a_wall_in_between_hides_all(renderer: ml.Renderer, how: dict[str, Any]) -> None:
    camera = _view()
    scene = _floor_and_lamp(_slab((8, 0.8, 8), (0, 1.6, 0)))
    lit = _direct(renderer, scene, camera, visibility="none")
    assert (lit > 0).mean() > 0.2
    below = np.zeros(lit.shape, bool)
    below[70:] = True  # the floor near the camera; the upper side of the wall is lit
    assert lit[below].max() > 0
    # Steps shorter than a voxel: longer ones may step over a sheet.
    assert _direct(renderer, scene, camera, voxel_steps=512, **how)[below].max() == 0


@pytest.mark.parametrize("how", COARSE)
def test_five_frames_have_the_same_bits(renderer: ml.Renderer, how: dict[str, Any]) -> None:
    scene, camera = _floor_and_lamp(_slab((1, 1, 1), (0, 0.5, 0))), _view(64)
    first = renderer.render(scene, camera, _settings(**how)).image
    for _ in range(4):
        assert np.array_equal(renderer.render(scene, camera, _settings(**how)).image, first)


@pytest.mark.parametrize("how", [*COARSE, {"visibility": "none"}])
def test_a_box_on_a_floor_has_its_contact_shadow(renderer: ml.Renderer, how: dict[str, Any]) -> None:
    """Beside the box, on the side away from the lamp: as dark as rays say, up to the edge."""
    scene = _floor_and_lamp(_slab((1, 1, 1), (1.6, 0.5, 0.5)))
    camera = ml.Camera.look_at((2.5, 2.4, 6), (1.6, 0.4, 0.5), fov_y=35, width=128, height=128)
    exact, found = (_direct(renderer, scene, camera, **more) for more in ({"visibility": "ray"}, how))
    open_ = _direct(renderer, scene, camera, visibility="none")
    position = renderer.render(scene, camera, _settings()).position
    x, y, z = np.moveaxis(position, -1, 0)
    shade = (np.abs(y) < 1e-3) & (x > 2.1) & (x < 2.5) & (np.abs(z - 0.5) < 0.4)
    assert shade.sum() > 100
    assert exact[shade].mean() < 0.1 * open_[shade].mean()
    leak = (found[shade] - exact[shade]).mean() / open_[shade].mean()
    if how["visibility"] == "none":
        assert leak > 0.8, "negative control"
    else:
        assert abs(leak) < 0.08
        assert _error(found, exact) < 0.2


@pytest.mark.parametrize("march", ["uniform", "dda"])
def test_an_occluder_off_screen_counts_with_a_margin(renderer: ml.Renderer, march: str) -> None:
    scene = _floor_and_lamp(_slab((0.2, 1.1, 4), (1.9, 0.6, 0)))
    # Only floor right of x = 2.1 is in the view; the slab between it and the lamp is just left of it.
    camera = ml.Camera.look_at((3.0, 4.5, 0.05), (3.0, 0, 0), up=(0, 0, -1), fov_y=20, width=64, height=64)
    how: dict[str, Any] = {"visibility": "voxel", "voxel_march": march}
    scene.remove("ceiling")
    exact, without, wide = (
        _direct(renderer, scene, camera, **more)
        for more in ({"visibility": "ray"}, how, how | {"voxel_margin": 0.8})
    )
    open_ = _direct(renderer, scene, camera, visibility="none")
    assert 0.1 * open_.mean() < exact.mean() < 0.7 * open_.mean()
    assert np.array_equal(without, open_)
    assert _error(wide, exact) < 0.35 * _error(without, exact)


@pytest.mark.parametrize("march", ["uniform", "dda"])
def test_more_voxels_are_nearer_to_rays(renderer: ml.Renderer, march: str) -> None:
    things = [trimesh.creation.icosphere(3, 0.5), _slab((0.6, 1.2, 0.6), (-1.2, 0.6, 0.3))]
    things[0].apply_translation((0.6, 0.9, 0.6))
    scene, camera = _floor_and_lamp(*things), _view(128)
    exact = _direct(renderer, scene, camera, visibility="ray")
    errors = []
    for resolution, slices in ((64, 32), (128, 64), (512, 256)):
        grid = {"voxel_resolution": resolution, "voxel_slices": slices, "voxel_march": march}
        steps = {"voxel_steps": resolution // 4}
        errors.append(_error(_direct(renderer, scene, camera, visibility="voxel", **grid, **steps), exact))
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 0.5 * errors[0]
    assert errors[2] < 0.08


@pytest.mark.parametrize("how", COARSE)
def test_two_sided_lights_and_spots_are_hidden_too(renderer: ml.Renderer, how: dict[str, Any]) -> None:
    scene = _floor_and_lamp(_slab((1, 1, 1), (0, 0.5, 0)))
    scene.remove("lamp")
    scene.remove("ceiling")
    lamp = ml.AreaLight((-0.5, 2.4, 0.5), (1, 0, 0), (0, 0, -1), radiance=(8, 8, 8), two_sided=True)
    scene.add_light(lamp, name="lamp")
    scene.add_light(ml.SpotLight((2.5, 2.5, 1), (0, 0, 0), (40, 40, 40), cutoff=40), name="spot")
    camera = _view()
    exact, found, open_ = (
        _direct(renderer, scene, camera, **more)
        for more in ({"visibility": "ray"}, how, {"visibility": "none"})
    )
    assert _error(open_, exact) > 0.1
    assert _error(found, exact) < 0.5 * _error(open_, exact)


@pytest.mark.parametrize("how", COARSE)
@pytest.mark.parametrize("estimator", ["samples", "ratio"])
@pytest.mark.parametrize("refine", ["none", "one-pass"])
def test_plans_name_what_runs(adapter: str, how: dict[str, Any], estimator: str, refine: str) -> None:
    scene, camera = _floor_and_lamp(), _view(32)
    settings = _settings(direct_estimator=estimator, refine=refine, **how)
    with ml.Renderer(adapter) as renderer:
        if (estimator, refine) == ("ratio", "one-pass"):
            for work in (renderer.plan, renderer.render):
                with pytest.raises(
                    ml.SettingsError, match=f"visibility=.*{how['visibility']}.*one-pass.*ratio"
                ):
                    work(scene, camera, settings)
            return
        plan = renderer.plan(scene, camera, settings)
        stats = renderer.render(scene, camera, settings).stats
    assert [name for name in stats.stages if "/" in name] == list(plan.passes)
    own = {name for name in plan.passes if "voxel" in name or "map_" in name}
    assert len(own) == 3
    assert "direct/shadow" in plan.skipped
    assert (stats.rays > 32 * 32) == (how["visibility"] == "shadow-map")


def test_what_does_not_fit_is_refused_before_any_work(renderer: ml.Renderer) -> None:
    scene, camera = _floor_and_lamp(), _view(32)
    for changes, words in [
        ({"visibility": "voxel", "voxel_margin": 1e6}, "voxel_margin=1000000.*allows"),
        ({"visibility": "voxel", "voxel_margin": 1e300}, "voxel_margin=.*allows"),
        (
            {"visibility": "shadow-map", "shadow_map_resolution": 1024, "light_samples": 4096},
            "4096 maps.*allows",
        ),
    ]:
        with pytest.raises(ml.SettingsError, match=words):
            renderer.plan(scene, camera, _settings().replace(**changes))
    with pytest.raises(ml.SettingsError, match="voxel_slices.*100.*multiple of 32 from 32 up to 2048"):
        ml.Settings(voxel_slices=100)
