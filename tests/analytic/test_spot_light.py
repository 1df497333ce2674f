"""A spot light on a plane: I cosθ/d² inside a cone with a hard edge, nothing outside."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import add_quad, floor_points, floor_scene, relative, view_down

ALBEDO = np.array([0.8, 0.6, 0.4])
INTENSITY = np.array([30.0, 20, 10])


def _expected(spot: ml.SpotLight, points: np.ndarray, cutoff: float) -> tuple[np.ndarray, np.ndarray]:
    """Radiance of the floor at each point, and the angle to the axis less the cutoff, degrees."""
    d = spot.position - points
    far = np.linalg.norm(d, axis=1)
    axis = (spot.target - spot.position) / np.linalg.norm(spot.target - spot.position)
    angle = np.degrees(np.arccos(np.clip(-(d / far[:, None]) @ axis, -1, 1))) - cutoff
    e = np.where((angle <= 0) & (d[:, 1] > 0), d[:, 1] / far**3, 0)
    return ALBEDO / np.pi * INTENSITY * e[:, None], angle


@pytest.mark.parametrize("cutoff", [2.0, 30.0, 45.0, 80.0])
@pytest.mark.parametrize("target", [(0.3, 0, 0.1), (1.2, 0.5, -0.7)])
def test_a_spot_on_a_floor(renderer: ml.Renderer, cutoff: float, target: tuple[float, float, float]) -> None:
    spot = ml.SpotLight((0.3, 1.5, 0.1), target, tuple(INTENSITY), cutoff)
    camera = view_down(60, 50)
    frame = renderer.render(floor_scene(spot), camera, "brute-force")
    expected, angle = _expected(spot, floor_points(camera), cutoff)
    clear = np.abs(angle) > 1e-3
    found = frame.image.reshape(-1, 3)[clear]
    assert (angle[clear] < 0).any()
    # rays start 32 roundings of the floor's half size above it
    assert relative(found, expected[clear]).max() < 2e-5
    assert relative(found, expected[clear] * 1.0001).max() > 2e-5
    wider = _expected(spot, floor_points(camera), cutoff + 1)[0][clear]
    if cutoff < 80:
        assert relative(found, wider).max() > 0.01, "the edge is where the cutoff says"


def test_the_edge_is_hard(renderer: ml.Renderer) -> None:
    """From one pixel to the next, across the edge of 30°, everything or nothing."""
    spot = ml.SpotLight((0, 2, 0), (0, 0, 0), tuple(INTENSITY), 30)
    edge = 2 * np.tan(np.radians(30))
    camera = ml.Camera.look_at((edge, 1, 0), (edge, 0, 0), (0, 0, -1), 1e-3, 201, 3)
    row = renderer.render(floor_scene(spot), camera, "brute-force").image[1, :, 0]
    inside = ALBEDO[0] / np.pi * INTENSITY[0] * np.cos(np.radians(30)) ** 3 / 4
    assert np.allclose(row[:98], inside, rtol=2e-3)
    assert (row[103:] == 0).all()


def test_a_spot_does_not_light_what_faces_away(renderer: ml.Renderer) -> None:
    """A floor under the floor is in its shadow, one seen from below is lit from behind and stays black."""
    spot = ml.SpotLight((0, 2, 0), (0, 0, 0), tuple(INTENSITY), 60)
    below = ml.Camera.look_at((0, -1.5, 0), (0, 0, 0), (0, 0, 1), 60, 24, 20)
    assert not renderer.render(floor_scene(spot), below, "brute-force").image.any()
    scene = floor_scene(spot, size=2.0)
    add_quad(scene, (-4, -1, 4), (8, 0, 0), (0, 0, -8), name="cellar")
    frame = renderer.render(scene, view_down(40, 40, up=6), "brute-force")
    cellar = np.abs(frame.position[..., 1] + 1) < 1e-3
    # the shadow of the upper floor, ±1 at a distance of 2, is ±1.5 at 3
    dark = cellar & (np.abs(frame.position[..., [0, 2]]).max(axis=-1) < 1.499)
    lit = cellar & (np.abs(frame.position[..., [0, 2]]).max(axis=-1) > 1.501)
    assert dark.any()
    assert not frame.image[dark].any()
    assert frame.image[lit].all(axis=-1).any()
    reach = np.linalg.norm(frame.position[..., [0, 2]], axis=-1) < 3 * np.tan(np.radians(60)) - 1e-3
    assert frame.image[lit & reach].min() > 0


def test_two_spots_add_up(renderer: ml.Renderer) -> None:
    one = ml.SpotLight((0.5, 2, 0), (0, 0, 0), (5, 1, 2), 50)
    two = ml.SpotLight((-0.5, 1, 0), (0, 0, 0.5), (1, 5, 2), 40)
    images = [
        renderer.render(floor_scene(*lights), view_down(), "brute-force").image.astype(np.float64)
        for lights in ((one,), (two,), (one, two))
    ]
    assert relative(images[2], images[0] + images[1]).max() < 1e-6
    assert relative(images[2], images[0]).max() > 0.1


def test_a_shadow_map_comes_near_rays(renderer: ml.Renderer) -> None:
    """A box over a floor: where map and rays differ is a seam as wide as a texel; a bare floor has none."""
    camera = ml.Camera.look_at((0, 3.5, 5), (0, 0.4, 0), fov_y=50, width=160, height=120)
    floor = ml.shapes.box((8, 0.1, 8), (0, -0.05, 0))
    spot = ml.SpotLight((1.5, 4, 1), (0, 0, 0), (20, 20, 20), cutoff=40)
    settings = ml.Settings.preset("brute-force")
    differs = []
    for resolution in (8, 16, 64):
        for things in (0, 1):
            scene = ml.Scene()
            scene.add_mesh(floor, name="floor", shading="flat")
            if things:
                scene.add_mesh(ml.shapes.box((0.9, 1.0, 0.9), (0, 0.9, 0)), name="box", shading="flat")
            scene.add_light(spot)
            exact, mapped = (
                renderer.render(
                    scene, camera, settings.replace(visibility=how, shadow_map_resolution=resolution)
                )
                for how in ("ray", "shadow-map")
            )
            apart = (exact.image.sum(-1) > 0) != (mapped.image.sum(-1) > 0)
            if things:
                differs.append(apart.mean())
            else:
                assert not apart.any(), "a bare floor has no shadow, and the whole cone is in the map"
    print(differs)
    assert differs[0] > differs[1] > differs[2]
    assert differs[2] < 0.002
