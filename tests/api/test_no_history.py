"""What was rendered before leaves no trace: buffers are kept from light to light and from frame to frame."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml

PLACES = {
    "right": ((2.5, 0.4, 2.5), (0, 3, 0)),
    "left": ((-2, 0.5, 2), (0.3, 3, 0.2)),
    "above": ((1.5, 2.6, 2.4), (0, 0, 0)),
}


def _quad(corner: tuple[float, ...], u: tuple[float, ...], v: tuple[float, ...]) -> trimesh.Trimesh:
    c, a, b = (np.array(x, float) for x in (corner, u, v))
    return trimesh.Trimesh([c, c + a, c + a + b, c + b], [[0, 1, 2], [0, 2, 3]], process=False)


def _scene() -> ml.Scene:
    """A lamp flush with the ceiling, lamps below a card, a picture and a spot; penumbrae everywhere."""
    scene = ml.Scene()
    grey = ml.Material((0.7, 0.7, 0.7))
    scene.add_mesh(_quad((-3, 3, -3), (6, 0, 0), (0, 0, 6)), name="ceiling", material=grey)
    scene.add_mesh(_quad((-3, 0, -3), (0, 0, 6), (6, 0, 0)), name="floor", material=grey)
    scene.add_mesh(_quad((-0.5, 1.8, -3), (0, 0, 6), (1, 0, 0)), name="card", material=grey)
    scene.add_light(ml.AreaLight((-0.9, 2.999, -1.5), (1.8, 0, 0), (0, 0, 3), radiance=(5, 5, 5)), "flush")
    scene.add_light(ml.AreaLight((-0.6, 0.5, -0.6), (0, 0, 1.2), (1.2, 0, 0), radiance=(9, 2, 1)), "low")
    picture = np.random.default_rng(5).uniform(0, 9, (4, 6, 3))
    scene.add_light(ml.AreaLight((-2.5, 1, 1), (0, 0, -2), (0, 1, 0), radiance=picture), "picture")
    spot = ml.SpotLight(position=(1.5, 2.5, 1.5), target=(0, 1, 0), intensity=(9, 9, 9), cutoff=40)
    scene.add_light(spot, "spot")
    return scene


def _camera(name: str, width: int = 150, height: int = 117) -> ml.Camera:
    eye, target = PLACES[name]
    return ml.Camera.look_at(eye, target, fov_y=70, width=width, height=height)


@pytest.mark.parametrize("name", PLACES)
def test_a_frame_is_the_same_after_any_other(renderer: ml.Renderer, adapter: str, name: str) -> None:
    """Bit for bit, also after larger and smaller images."""
    scene, settings = _scene(), ml.Settings.preset("default")
    with ml.Renderer(adapter=adapter) as fresh:
        expected = fresh.render(scene, _camera(name), settings).image
    others = [_camera(other) for other in PLACES if other != name]
    others += [others[0].replace(width=97, height=61), _camera(name, 160, 140)]
    for other in others:
        assert renderer.render(scene, other, settings).image.any()
        found = renderer.render(scene, _camera(name), settings).image
        assert (found == expected).all(), f"{(found != expected).any(axis=2).sum()} pixels differ"
    turned = renderer.render(scene, others[0], settings).image
    assert not (turned == expected).all(), "another camera sees another image"
