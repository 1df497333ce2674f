"""Closed rooms whose light is known: walls that glow all around, and the inside of a sphere."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml

ALBEDO = np.array([0.9, 0.5, 0.2])


def _cube(*lights: ml.AreaLight, albedo: np.ndarray = ALBEDO) -> ml.Scene:
    scene = ml.Scene()
    scene.add_mesh(trimesh.creation.box((2, 2, 2)), name="room", material=ml.Material(albedo), shading="flat")
    for light in lights:
        scene.add_light(light)
    return scene


def _glowing_walls(radiance: tuple[float, float, float] = (1, 1, 1)) -> list[ml.AreaLight]:
    """Each wall of the cube as a light that looks inside."""
    walls = []
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        u, v = np.roll(axis, 1), np.roll(axis, 2)
        if np.cross(u, v) @ axis > 0:
            u, v = v, u
        walls.append(ml.AreaLight(axis - u - v, 2 * u, 2 * v, radiance, visible=False))
    return walls


INSIDE = ml.Camera.look_at((0.2, 0.1, -0.3), (1, 0.5, 0.2), fov_y=100, width=32, height=32)


def test_glowing_walls_give_every_wall_pi(renderer: ml.Renderer) -> None:
    """The other five cover a wall's whole sky: E = πL, so that the walls reflect ρL everywhere."""
    lights = _glowing_walls((2, 2, 2))
    assert all(light.normal @ light.corner < 0 for light in lights)
    settings = ml.Settings.preset("brute-force").replace(light_samples=1024)
    frame = renderer.render(_cube(*lights), INSIDE, settings)
    expected = 2 * ALBEDO
    # samples fail near a light: look where the next wall is four strata away
    distance = np.sort(1 - np.abs(frame.position), axis=-1)[..., 1]
    inner = distance > 4 * 2 / 32
    assert inner.mean() > 0.5
    off = np.abs(frame.image[inner] / expected - 1)
    assert off.max() < 0.02
    assert abs((frame.image[inner] / expected).mean() - 1) < 1e-3
    five = renderer.render(_cube(*lights[:5]), INSIDE, settings).image[inner] / expected
    assert abs(five.mean() - 1) > 0.02, "without one wall something is missing"


def _sphere(light: ml.AreaLight | ml.SpotLight, albedo: np.ndarray = ALBEDO) -> tuple[ml.Scene, float]:
    """A sphere of radius 2 and its area: 20,480 triangles."""
    ball = trimesh.creation.icosphere(5, 2.0)
    scene = ml.Scene()
    scene.add_mesh(ball, name="sphere", material=ml.Material(albedo), shading="flat")
    scene.add_light(light)
    return scene, float(ball.area)


def _indirect(renderer: ml.Renderer, scene: ml.Scene, bounces: int) -> np.ndarray:
    settings = ml.Settings.preset("brute-force").replace(
        direct="off", indirect="final-gather", gather_rays=144, bounces=bounces
    )
    camera = ml.Camera.look_at((0, 0, 0), (1, 0.3, 0.2), fov_y=90, width=40, height=40)
    return renderer.render(scene, camera, settings).image.astype(np.float64)


@pytest.mark.parametrize("bounces", [1, 2, 4])
def test_a_sphere_spreads_light_evenly(renderer: ml.Renderer, bounces: int) -> None:
    """Inside a sphere every patch sees every other alike: of a flux Φ the n-th bounce is ρⁿΦ/4πr² everywhere.

    The spot in the middle has the flux 2π(1 − cos 60°) I; the camera sees lit and unlit walls.
    """
    spot = ml.SpotLight((0, 0, 0), (1, 0, 0), (8, 8, 8), 60)
    scene, area = _sphere(spot)
    flux = 2 * np.pi * (1 - np.cos(np.radians(60))) * 8

    def expected(count: int) -> np.ndarray:
        irradiance = sum(ALBEDO**n for n in range(1, count + 1)) * flux / area
        return np.asarray(ALBEDO / np.pi * irradiance)

    image = _indirect(renderer, scene, bounces)
    mean = image.mean(axis=(0, 1))
    # 1,600 pixels of 144 rays, a quarter of which meet light: 0.4 %
    assert np.allclose(mean, expected(bounces), rtol=6e-3)
    assert not np.allclose(mean, expected(bounces + 1), rtol=6e-3)
    assert not np.allclose(mean, expected(bounces - 1) if bounces > 1 else 0 * mean, rtol=6e-3)
    # the noise of stratified rays: nowhere darker or brighter than that
    left, right = image[:, :20].mean(axis=(0, 1)), image[:, 20:].mean(axis=(0, 1))
    assert np.allclose(left, right, rtol=1.5e-2)


def test_an_area_light_in_a_sphere(renderer: ml.Renderer) -> None:
    """The flux of a light of radiance L and area A on one side is πLA; both sides: twice that."""
    fluxes = {}
    for two_sided in (False, True):
        light = ml.AreaLight(
            (-0.2, 0.1, -0.2), (0.4, 0, 0), (0, 0, 0.4), (30, 30, 30), two_sided=two_sided, visible=False
        )
        scene, area = _sphere(light)
        mean = _indirect(renderer, scene, 1).mean(axis=(0, 1))
        fluxes[two_sided] = mean * np.pi / ALBEDO**2 * area
        expected = np.pi * 30 * 0.16 * (2 if two_sided else 1)
        assert np.allclose(fluxes[two_sided], expected, rtol=1e-2)
        assert not np.allclose(fluxes[two_sided], expected * 1.03, rtol=1e-2)


def test_no_energy_is_made(renderer: ml.Renderer) -> None:
    """With white walls the sphere's irradiance grows by Φ/A a bounce, no faster and no slower."""
    spot = ml.SpotLight((0, 0, 0), (1, 0, 0), (8, 8, 8), 60)
    scene, area = _sphere(spot, np.ones(3))
    step = 2 * np.pi * (1 - np.cos(np.radians(60))) * 8 / area / np.pi
    assert np.allclose(_indirect(renderer, scene, 5).mean(axis=(0, 1)), 5 * step, rtol=1e-2)


def test_black_walls_reflect_nothing(renderer: ml.Renderer) -> None:
    scene, _ = _sphere(ml.SpotLight((0, 0, 0), (1, 0, 0), (8, 8, 8), 60), np.zeros(3))
    assert not _indirect(renderer, scene, 2).any()


def test_one_bounce_from_a_wall_to_the_floor(renderer: ml.Renderer) -> None:
    """A wall lit evenly by a distant spot shines on the floor as a light of radiance ρE/π would."""
    far = 200.0
    spot = ml.SpotLight((0, 0.5, far), (0, 0.5, 0), (far**2 * np.pi,) * 3, 1.0)
    scene = ml.Scene()
    wall = [(-1, 0, 0), (1, 0, 0), (1, 1, 0), (-1, 1, 0)]
    faces = [(0, 1, 2), (0, 2, 3)]
    scene.add_arrays(wall, faces, name="wall", material=ml.Material((0.5, 0.5, 0.5)), shading="flat")
    ground = [(-1, 0, 0.2), (1, 0, 0.2), (1, 0, 1.2), (-1, 0, 1.2)]
    scene.add_arrays(ground, faces, name="ground", material=ml.Material((1, 1, 1)), shading="flat")
    scene.add_light(spot)
    camera = ml.Camera.look_at((0, 2, 0.7), (0, 0, 0.7), (0, 0, -1), 26, 24, 24)
    settings = ml.Settings.preset("brute-force").replace(
        direct="off", indirect="final-gather", gather_rays=1024
    )
    bounced = renderer.render(scene, camera, settings)
    seen = bounced.surface_mask

    lamp = ml.Scene()
    lamp.add_arrays(ground, faces, name="ground", material=ml.Material((1, 1, 1)), shading="flat")
    # E = π on the wall, which turns 0.5 of it into radiance 0.5
    lamp.add_light(ml.AreaLight((-1, 0, 0), (2, 0, 0), (0, 1, 0), (0.5, 0.5, 0.5), visible=False))
    direct = renderer.render(lamp, camera, ml.Settings.preset("brute-force"))
    assert seen.all()
    assert np.allclose(bounced.image.mean(axis=(0, 1)), direct.image.mean(axis=(0, 1)), rtol=5e-3)
    ratio = bounced.image[..., 0] / direct.image[..., 0]
    assert abs(np.median(ratio) - 1) < 1e-2
    assert np.abs(ratio - 1).mean() < 0.05
