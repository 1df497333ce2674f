"""Light propagation volumes through the whole renderer: closed forms, walls, what is kept."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml
from miplight import _core
from tests.claim_scenes import far_rooms

LPV = ml.Settings(direct="off", indirect="lpv")
TOGETHER = LPV.replace(lpv_transport="together", lpv_resolution=16, lpv_samples=4096)
SMALL = LPV.replace(lpv_resolution=16, lpv_iterations=40, lpv_samples=4096)


def _view(origin: tuple[float, float, float], target: tuple[float, float, float]) -> ml.Camera:
    return ml.Camera.look_at(origin=origin, target=target, fov_y=60, width=32, height=32)


def _irradiance(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings, albedo: float
) -> NDArray[np.float64]:
    """Indirect irradiance of the pixels, red."""
    frame = renderer.render(scene, camera, settings)
    irradiance: NDArray[np.float64] = frame["indirect"][..., 0].astype(np.float64) * np.pi / albedo
    return irradiance


def test_inside_a_ball_all_get_the_same(renderer: ml.Renderer) -> None:
    """A matt patch of a ball lights all of it alike: what it reflects, over the ball's area."""
    radius, albedo, intensity, cutoff = 2.0, 0.5, 10.0, 40.0
    scene = ml.Scene()
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    scene.add_mesh(ball, name="ball", material=ml.Material((albedo,) * 3), shading="flat")
    scene.add_light(ml.SpotLight((0, 0.5, 0), (0, -1, 0.3), intensity=(intensity,) * 3, cutoff=cutoff))
    flux = albedo * intensity * 2 * np.pi * (1 - np.cos(np.radians(cutoff)))
    expected = flux / (4 * np.pi * radius**2)
    towards = [(0, -1, 0.3), (0, 1, 0.001), (1, 0, 0), (0, 0, -1), (0, 0, 1), (-1, 0.3, 0.2)]
    means = {}
    for transport in ("sides", "together", "faces"):
        settings = LPV.replace(lpv_transport=transport, lpv_resolution=32, lpv_iterations=96)
        views = [_irradiance(renderer, scene, _view((0, 0, 0), t), settings, albedo) for t in towards]
        means[transport] = np.array([view.mean() for view in views]) / expected
    print(means)
    assert abs(means["sides"] - 1).max() < 0.35
    assert abs(means["together"] - 1).max() < 0.5
    # negative control: as the literature has it the patch keeps its light
    assert means["faces"][0] > 2.5
    assert means["faces"][1:].max() < 0.6


def _two_rooms(thick: float, lift: float = 0.0) -> ml.Scene:
    """A box of 4 × 2 × 2 with a wall across its middle, light in one half."""
    scene = ml.Scene()
    white = ml.Material((0.8, 0.8, 0.8))
    box = trimesh.creation.box((4, 2, 2))
    scene.add_mesh(box, name="box", material=white, shading="flat")
    wall = trimesh.Trimesh(
        [(lift, -1, -1), (lift, 1, -1), (lift, 1, 1), (lift, -1, 1)], [(0, 1, 2), (0, 2, 3)]
    )
    if thick > 0:
        wall = trimesh.creation.box((thick, 2, 2))
    scene.add_mesh(wall, name="wall", material=white, shading="flat")
    lamp = ml.AreaLight((-1.4, 0.9, -0.4), (0.8, 0, 0), (0, 0, 0.8), radiance=(9, 9, 9))
    scene.add_light(lamp, name="lamp")
    return scene


@pytest.mark.parametrize(("thick", "lift"), [(0.25, 0.0), (0.0, 0.0), (0.0, 0.07), (0.0, 0.1), (0.0, 0.19)])
def test_no_light_leaks_through_a_wall(renderer: ml.Renderer, thick: float, lift: float) -> None:
    """Two cells thick or a sheet that lies anywhere in a cell; 5 % would be allowed."""
    scene = _two_rooms(thick, lift)
    settings = LPV.replace(lpv_resolution=34)
    bright = _irradiance(renderer, scene, _view((-1.8, 0.3, 0), (-1, -1, 0)), settings, 0.8)
    dark_view = _view((1.8, 0.3, 0), (0, -0.3, 0))
    dark = _irradiance(renderer, scene, dark_view, settings, 0.8)
    assert bright.mean() > 0.1
    assert dark.mean() <= 0.005 * bright.mean()
    # negative control: nothing blocks
    open_settings = settings.replace(indirect_visibility="off")
    assert _irradiance(renderer, scene, dark_view, open_settings, 0.8).mean() > 0.03 * bright.mean()


def test_a_sheet_shines_on_the_side_that_is_lit(renderer: ml.Renderer) -> None:
    scene = ml.Scene()
    white = ml.Material((0.8, 0.8, 0.8))
    for name, height in (("above", 1.0), ("sheet", 0.0), ("below", -1.0)):
        corners = [(-2, height, -2), (2, height, -2), (2, height, 2), (-2, height, 2)]
        # whichever way their triangles turn
        faces = [(0, 1, 2), (0, 2, 3)] if name == "sheet" else [(0, 2, 1), (0, 3, 2)]
        scene.add_mesh(trimesh.Trimesh(corners, faces), name=name, material=white, shading="flat")
    spot = ml.SpotLight((0, 0.9, 0), (0, 0, 0), intensity=(5, 5, 5), cutoff=50)
    scene.add_light(spot, name="spot")
    above = _irradiance(renderer, scene, _view((0, 0.2, 1.5), (0, 1, 0)), SMALL, 0.8)
    below = _irradiance(renderer, scene, _view((0, -0.2, 1.5), (0, -1, 0)), SMALL, 0.8)
    assert above.mean() > 0.1
    assert below.mean() < 0.1 * above.mean(), "what goes round its edges"


def test_frames_are_the_same_bits(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    images = [renderer.render(room, camera, SMALL).image for _ in range(2)]
    with ml.Renderer(renderer.adapter["name"]) as other:
        images.append(other.render(room, camera, SMALL).image)
    there = np.eye(4)
    there[0, 3], there[1, 3] = 0.3, 0.4
    back = np.eye(4)
    back[1, 3] = 0.4
    room.set_transform("box", there)
    moved = renderer.render(room, camera, SMALL).image
    room.set_transform("box", back)
    images.append(renderer.render(room, camera, SMALL).image)
    assert all((image == images[0]).all() for image in images)
    assert images[0].max() > 0
    assert (moved != images[0]).any()
    assert (renderer.render(room, camera, SMALL.replace(seed=1)).image != images[0]).any()


def test_samples_and_blocked_faces_are_kept(room: ml.Scene, camera: ml.Camera, adapter: str) -> None:
    made = {"indirect/surface_samples", "indirect/blockers", "indirect/blockers_trace"}
    with ml.Renderer(adapter) as renderer:
        first = renderer.render(room, camera, SMALL).stats
        assert made <= set(first.stages)
        second = renderer.render(room, camera, SMALL).stats
        assert not made & set(second.stages)
        assert made <= set(second.skipped)
        room.lights["lamp"].radiance = (1, 2, 3)
        assert not made & set(renderer.render(room, camera, SMALL).stats.stages)
        assert made <= set(renderer.render(room, camera, SMALL.replace(lpv_resolution=20)).stats.stages)
        room.set_transform("box", np.eye(4))
        assert made <= set(renderer.render(room, camera, SMALL.replace(lpv_resolution=20)).stats.stages)


def test_without_it_nothing_is_allocated(room: ml.Scene, camera: ml.Camera, adapter: str) -> None:
    settings = {"light_samples": 16}
    job = (room._core_snapshot(), camera._core_camera())

    def allocated(**changes: object) -> int:
        core = _core.Renderer(adapter)
        held: int = core.render(*job, {**settings, **changes}, []).stats["device_bytes"]
        core.close()
        return held

    without = allocated()
    assert allocated(lpv_resolution=128, lpv_samples=262_144) == without
    assert allocated(indirect="lpv", lpv_resolution=16, lpv_iterations=1) > without


def test_lights_add_up_and_scale(renderer: ml.Renderer) -> None:
    """Twice the radiance is twice the light; cutting the net flow is linear in all light of a cell."""
    scene = _two_rooms(0.25)
    camera = _view((-1.8, 0.3, 0), (-1, -1, 0))
    once = renderer.render(scene, camera, SMALL)["indirect"]
    scene.lights["lamp"].radiance = (18, 18, 18)
    twice = renderer.render(scene, camera, SMALL)["indirect"]
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-4, atol=1e-5 * once.max())


def test_more_steps_and_more_bounces_are_more_light(renderer: ml.Renderer) -> None:
    scene = _two_rooms(0.25)
    camera = _view((-1.8, 0.3, 0), (-1, -1, 0))
    with pytest.raises(ml.SettingsError, match="lpv_reflection=0.8.*together"):
        renderer.render(scene, camera, SMALL.replace(lpv_reflection=0.8))
    few, many, most = (
        _irradiance(renderer, scene, camera, SMALL.replace(lpv_iterations=n), 0.8).mean()
        for n in (4, 60, 1000)
    )
    assert few < 0.9 * many
    assert abs(most / many - 1) < 0.02, "stable, and at its end"
    many = _irradiance(renderer, scene, camera, TOGETHER.replace(lpv_iterations=60), 0.8).mean()
    again = _irradiance(
        renderer, scene, camera, TOGETHER.replace(lpv_reflection=0.8, lpv_iterations=400), 0.8
    )
    # radiosity of a closed room: 1 / (1 - 0.8) times the first bounce when all of it is seen
    assert 2 < again.mean() / many < 8


def test_volumes_inside_of_others_see_what_is_near(renderer: ml.Renderer) -> None:
    """Two rooms far apart: cells are large for one of them, against a gather in it alone."""
    alone, view = far_rooms(0, 32)
    gather = ml.Settings(direct="off", indirect="final-gather", gather_rays=256)
    truth = renderer.render(alone, view, gather, ("indirect", "surface_mask"))
    settings = LPV.replace(lpv_transport="together", lpv_resolution=16, lpv_iterations=48)

    def error(cascades: int) -> float:
        frame = renderer.render(*far_rooms(20, 32), settings.replace(lpv_cascades=cascades), ("indirect",))
        return ml.metrics.relative_rmse(frame["indirect"], truth.indirect, mask=truth.surface_mask)

    errors = [error(cascades) for cascades in (1, 2, 3)]
    print(errors)
    assert max(errors[1:]) < 0.75 * errors[0]


def test_volumes_inside_of_others_move_with_the_camera(
    adapter: str, room: ml.Scene, camera: ml.Camera
) -> None:
    """Kept while the camera stays in a cell, made anew when it leaves it; the same bits when it is back."""
    made = {"indirect/surface_samples", "indirect/blockers"}
    settings = TOGETHER.replace(lpv_cascades=2, lpv_samples=512)
    pose = np.array(camera.world_from_camera)
    pose[:3, 3] += (1.0, 0.0, 0.0)
    away = camera.replace(world_from_camera=pose)
    with ml.Renderer(adapter) as renderer:
        first = renderer.render(room, camera, settings)
        again = renderer.render(room, camera, settings)
        assert made <= set(again.stats.skipped)
        assert not made & set(again.stats.stages)
        moved = renderer.render(room, away, settings)
        assert made <= set(moved.stats.stages)
        back = renderer.render(room, camera, settings)
        assert (first.image == again.image).all()
        assert (first.image == back.image).all()
        single = renderer.render(room, camera, settings.replace(lpv_cascades=1))
        assert (single.image != first.image).any(), "control"


@pytest.mark.parametrize("refine", ["one-pass", "iterative", "incremental", "sub-fragment"])
def test_fragments_look_up_what_pixels_do(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, refine: str
) -> None:
    every = renderer.render(room, camera, SMALL)["indirect"]
    some = renderer.render(room, camera, SMALL.replace(refine=refine, upsample="edge-aware"))
    assert (some.indirect_fragments.level_map[some.surface_mask] > 0).any()
    difference = np.abs(some["indirect"] - every)[some.surface_mask]
    assert difference.mean() < 0.1 * every[some.surface_mask].mean()


def test_what_is_refused(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    for change in (
        {"lpv_resolution": 129},
        {"lpv_samples": 0},
        {"lpv_most_flow": 0},
        {"lpv_injection": "both"},
    ):
        with pytest.raises(ml.SettingsError, match=next(iter(change))):
            SMALL.replace(**change)
    assert "indirect/propagate" in renderer.plan(room, camera, SMALL).passes


def test_scenes_without_light_or_mesh(renderer: ml.Renderer, camera: ml.Camera, room: ml.Scene) -> None:
    assert (renderer.render(ml.Scene(), camera, SMALL).image == 0).all()
    room.lights["lamp"].radiance = (0, 0, 0)
    assert (renderer.render(room, camera, SMALL)["indirect"] == 0).all()
