"""A final gather at points between the pixels through the whole renderer: closed forms, fragments, bits."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml
from tests.fragment_rules import assert_partition

POINTS = ml.Settings.preset("default").replace(indirect="final-gather", gather_rays=64)
EVERY = POINTS.replace(refine="none", coarsest_level=0)


def _ball() -> tuple[ml.Scene, float]:
    """The inside of a ball lit by a spot, and the indirect radiance that all of it has."""
    radius, albedo, intensity, cutoff = 2.0, 0.5, 10.0, 40.0
    scene = ml.Scene()
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    scene.add_mesh(ball, name="ball", material=ml.Material((albedo,) * 3), shading="smooth")
    scene.add_light(ml.SpotLight((0, 0.5, 0), (0, -1, 0.3), intensity=(intensity,) * 3, cutoff=cutoff))
    flux = albedo * intensity * 2 * np.pi * (1 - np.cos(np.radians(cutoff)))
    return scene, flux / (4 * np.pi * radius**2) * albedo / np.pi


def _view(size: int = 64) -> ml.Camera:
    return ml.Camera.look_at(origin=(0, 0, 0), target=(1, 0, 0), fov_y=70, width=size, height=size)


def test_inside_a_ball_all_get_the_same(renderer: ml.Renderer) -> None:
    scene, radiance = _ball()
    found = renderer.render(scene, _view(), POINTS.replace(gather_rays=1024)).indirect
    ratio = found.astype(np.float64) / radiance
    print(ratio.mean(), ratio.std())
    assert abs(ratio.mean() - 1) < 0.02
    assert ratio.std() < 0.05
    assert (
        abs(renderer.render(scene, _view(), EVERY.replace(gather_rays=64)).indirect.mean() / radiance - 1)
        < 0.02
    )


def test_bounces_are_a_geometric_series(renderer: ml.Renderer) -> None:
    """In a ball of albedo 1/2 each reflection has half of the last one's light."""
    scene, radiance = _ball()
    settings = POINTS.replace(gather_rays=256)
    for bounces, expected in ((1, 1.0), (2, 1.5), (4, 1.875)):
        found = renderer.render(scene, _view(48), settings.replace(bounces=bounces)).indirect
        assert abs(found.mean() / radiance / expected - 1) < 0.03, bounces


def test_points_have_the_light_of_every_pixel(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera
) -> None:
    """With a small part of the rays as near as every pixel by itself; rays and error fall together."""
    reference = renderer.render(room, camera, EVERY.replace(gather_rays=2048, seed=7))
    seen = reference.surface_mask
    mean = reference.indirect[seen].mean()

    def error(settings: ml.Settings) -> tuple[float, int]:
        frame = renderer.render(room, camera, settings)
        e = np.abs(frame.indirect - reference.indirect).mean(axis=-1)[seen]
        return float(np.sqrt((e**2).mean()) / mean), frame.stats.rays

    every, its_rays = error(EVERY.replace(gather_rays=64))
    points, rays = error(POINTS)
    many, _ = error(POINTS.replace(gather_rays=512, gather_reach=0.3))
    print(f"every pixel {every:.3f} with {its_rays} rays, points {points:.3f} with {rays}, finer {many:.3f}")
    assert points < every
    assert rays < 0.35 * its_rays
    assert many < 0.75 * points


def test_fragments_are_those_of_the_points(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    frame = renderer.render(room, camera, POINTS)
    assert frame.indirect_fragments is not None
    assert_partition(frame.indirect_fragments)
    levels = frame.indirect_fragments.level_map
    assert set(np.unique(levels)) >= {1, 2, 3, 255} - ({255} if frame.surface_mask.all() else set())
    finer = renderer.render(room, camera, POINTS.replace(gather_reach=0.2)).indirect_fragments
    assert finer.total > frame.indirect_fragments.total
    assert renderer.render(room, camera, POINTS.replace(gather_level=0)).indirect_fragments.counts[0] > 0


def test_in_the_open_nothing_is_refined(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    """A floor that sees nothing gets nothing, and a ray or two from each coarse block know it."""
    scene = ml.Scene()
    scene.add_mesh(trimesh.creation.box((40, 0.1, 40)), name="floor", shading="flat")
    scene.add_light(ml.AreaLight((-1, 5, -1), (2, 0, 0), (0, 0, 2), radiance=(9, 9, 9), visible=False))
    above = ml.Camera.look_at((0, 8, 0.1), (0, 0, 0), fov_y=45, width=64, height=64)
    frame = renderer.render(scene, above, POINTS)
    assert (frame.indirect == 0).all()
    assert frame.indirect_fragments.counts[3] == frame.indirect_fragments.total == 64
    assert renderer.render(room, camera, POINTS).indirect_fragments.counts[1] > 0, "negative control"


def test_the_same_bits(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    images = [renderer.render(room, camera, POINTS).image for _ in range(3)]
    with ml.Renderer(renderer.adapter["name"]) as other:
        images.append(other.render(room, camera, POINTS).image)
    assert all((image == images[0]).all() for image in images)
    assert (renderer.render(room, camera, POINTS.replace(seed=1)).image != images[0]).any()


@pytest.mark.parametrize("size", [(1, 1), (3, 1), (9, 8), (65, 33)])
def test_any_size(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, size: tuple[int, int]) -> None:
    view = ml.Camera(camera.world_from_camera, camera.fov_y, *size)
    for level in (0, 3, 6):
        frame = renderer.render(room, view, POINTS.replace(gather_rays=16, gather_level=level))
        assert np.isfinite(frame.indirect).all()
        assert (frame.indirect >= 0).all()
        assert_partition(frame.indirect_fragments)


def test_without_light_or_surfaces_there_is_none(renderer: ml.Renderer, camera: ml.Camera) -> None:
    assert (renderer.render(ml.Scene(), camera, POINTS).image == 0).all()
    scene, _ = _ball()
    assert (renderer.render(scene, camera, POINTS.replace(gather_rays=16)).indirect >= 0).all()
    plan = renderer.plan(scene, camera, POINTS)
    assert "indirect/point_smooth" in plan.passes
    assert "refine is not none" in plan.skipped["indirect/gather_rays"]
    assert "refine is none" in renderer.plan(scene, camera, EVERY).skipped["indirect/point_rays"]


def test_a_video_light_and_moved_things(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera) -> None:
    """Nothing of the last frame is left."""

    def image() -> NDArray[np.float32]:
        return renderer.render(room, camera, POINTS.replace(gather_rays=16)).image

    before = image()
    room.lights["lamp"].radiance = (1, 5, 1)
    assert (image() != before).any()
    room.lights["lamp"].radiance = (9, 9, 9)
    again = image()
    with ml.Renderer(renderer.adapter["name"]) as fresh:
        assert (fresh.render(room, camera, POINTS.replace(gather_rays=16)).image == again).all()
