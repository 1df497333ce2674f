"""Light is linear: radiance scales, lights add up, exchange is mutual."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import add_quad, floor_scene, relative, view_down


def lamp(x: float = 0.0, radiance: float = 4.0, **options: bool) -> ml.AreaLight:
    """A light of one unit above the floor that looks down."""
    return ml.AreaLight((x - 0.5, 1.5, -0.5), (1, 0, 0), (0, 0, 1), (radiance, radiance / 2, 1.0), **options)


def _room(*lights: ml.AreaLight | ml.SpotLight) -> ml.Scene:
    scene = floor_scene(*lights, size=4)
    add_quad(scene, (-2, 0, -1), (4, 0, 0), (0, 2, 0), name="wall", albedo=(0.5, 0.7, 0.9))
    add_quad(scene, (0.2, 0.3, 0.2), (0.5, 0, 0), (0, 0.2, 0.3), name="board", albedo=(0.9, 0.2, 0.2))
    return scene


CAMERA = ml.Camera.look_at((0, 1.2, 3), (0, 0.5, 0), fov_y=50, width=24, height=20)


def test_twice_the_radiance_is_twice_the_image(renderer: ml.Renderer, gather: ml.Settings) -> None:
    """To the bit, direct and indirect: a power of two changes no rounding."""
    light, spot = lamp(), ml.SpotLight((1, 1, 1), (0, 0, 0), (3, 4, 5), 50)
    scene = _room(light, spot)
    settings = gather.replace(gather_rays=16, bounces=2)
    before = renderer.render(scene, CAMERA, settings)
    light.radiance, spot.intensity = 2 * light.radiance, 2 * spot.intensity
    after = renderer.render(scene, CAMERA, settings, outputs=("image", "direct", "indirect"))
    for name in ("image", "direct", "indirect"):
        if name == "image":
            assert (after[name] == 2 * before[name]).all()
    assert after.indirect.any()
    light.radiance = 1.01 * light.radiance
    assert not (renderer.render(scene, CAMERA, settings).image == after.image).all()


def test_lights_add_up(renderer: ml.Renderer, grid: ml.Settings) -> None:
    lights = [lamp(-0.6), lamp(0.6, 9.0), ml.SpotLight((1, 1, 1), (0, 0, 0), (3, 4, 5), 50)]
    for light in lights[:2]:
        assert isinstance(light, ml.AreaLight)
        light.visible = False
    settings = grid.replace(light_samples=64)
    alone = [renderer.render(_room(light), CAMERA, settings).image.astype(np.float64) for light in lights]
    together = renderer.render(_room(*lights), CAMERA, settings).image
    assert relative(together, sum(alone)).max() < 1e-6
    assert relative(together, alone[0] + alone[1]).max() > 1e-2


def test_direct_and_indirect_add_up(renderer: ml.Renderer, gather: ml.Settings) -> None:
    scene, settings = _room(lamp()), gather.replace(gather_rays=16)
    outputs = ("image", "direct", "indirect", "light_mask")
    both = renderer.render(scene, CAMERA, settings, outputs=outputs)
    assert both.light_mask.any()
    surface = ~both.light_mask
    assert relative(both.image[surface], (both.direct + both.indirect)[surface]).max() < 1e-7
    direct = renderer.render(scene, CAMERA, settings.replace(indirect="off"), outputs=outputs)
    indirect = renderer.render(scene, CAMERA, settings.replace(direct="off"), outputs=outputs)
    assert (direct.direct == both.direct).all()
    assert not direct.indirect.any()
    assert (indirect.indirect == both.indirect).all()
    assert not indirect.direct.any()
    assert both.indirect[surface].any()


@pytest.mark.parametrize("blocked", [False, True])
def test_exchange_is_mutual(renderer: ml.Renderer, blocked: bool) -> None:
    """Helmholtz: what B gets from A shining is what A gets from B shining alike, obstacle or not.

    A and B are a 1 × 1 and a 2 × 1 rectangle; a camera that looks at a rectangle head-on samples it evenly.
    """
    a = ((-0.5, 0, 0.2), (1.0, 0, 0), (0, 0.6, -0.8))
    b = ((-1.2, 1.5, -1), (0, 0, 2.0), (0.8, 0.6, 0))
    flux = []
    for target, source in ((a, b), (b, a)):
        scene = ml.Scene()
        corner, u, v = (np.array(x, np.float64) for x in target)
        normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        lamp_normal = np.cross(source[1], source[2])
        towards = np.array(target[0]) + 0.5 * (u + v) - np.array(source[0])
        edges = (source[1], source[2]) if lamp_normal @ towards > 0 else (source[2], source[1])
        add_quad(scene, *target, albedo=(1, 1, 1))
        scene.add_light(ml.AreaLight(source[0], *edges, (1, 1, 1), visible=False))
        if blocked:
            add_quad(scene, (-0.6, 0.8, -0.3), (0.7, 0, 0), (0, 0.1, 0.5), name="board")
        middle = corner + 0.5 * (u + v)
        side = np.sign(normal @ (np.array(source[0]) - middle))
        # close to the rectangle, between it and the board
        eye = middle + side * normal * 0.15
        aspect = np.linalg.norm(u) / np.linalg.norm(v)
        height = 48
        width = round(height * aspect)
        k = [
            [height * 0.15 / np.linalg.norm(v), 0, width / 2],
            [0, height * 0.15 / np.linalg.norm(v), height / 2],
            [0, 0, 1],
        ]
        facing = ml.Camera.look_at(eye, middle, v, 60, width, height)
        camera = ml.Camera.from_intrinsics(k, facing.world_from_camera, width, height)
        frame = renderer.render(scene, camera, ml.Settings.preset("brute-force"))
        assert frame.surface_mask.all()
        assert np.abs((frame.position - middle) @ normal).max() < 1e-4, "the camera sees the rectangle alone"
        area = np.linalg.norm(np.cross(u, v))
        flux.append(np.pi * frame.image[..., 0].astype(np.float64).mean() * area)
    assert flux[0] == pytest.approx(flux[1], rel=2e-3)
    assert flux[0] > 0.02
    assert flux[0] != pytest.approx(flux[1] * 1.01, rel=2e-3)


def test_view_down_is_the_view_of_the_other_tests(renderer: ml.Renderer) -> None:
    """The floor fills the picture: nothing of the closed forms is compared with the void."""
    assert renderer.render(floor_scene(lamp(visible=False)), view_down(), "brute-force").surface_mask.all()
