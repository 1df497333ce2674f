"""What must not change the default's direct light: size, place, cut, the other lights, brightness."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
from tests.analytic.closed_forms import relative
from tests.analytic.test_invariance import room, view
from tests.claim_scenes import CLAIMS

Array = NDArray[np.float64]
DEFAULT = ml.Settings.preset("default")
SIZE = {"width": 96, "height": 77}
EYE = np.eye(4)


def render(renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera) -> ml.Frame:
    return renderer.render(scene, camera, DEFAULT, ("image", "direct", "surface_mask", "fragments"))


@pytest.fixture
def plain(renderer: ml.Renderer) -> ml.Frame:
    return render(renderer, room(EYE), view(EYE, **SIZE))


def share_off(found: Array, expected: Array, bound: float = 1e-3) -> float:
    """Share of pixels that are off by more than `bound` of the brightest."""
    return float((relative(found, expected).max(axis=-1) > bound).mean())


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 37.0, 1e5])
def test_size_does_not_matter(renderer: ml.Renderer, plain: ml.Frame, scale: float) -> None:
    matrix = np.diag([scale, scale, scale, 1.0])
    frame = render(renderer, room(matrix, scale), view(matrix, **SIZE))
    assert share_off(frame.direct, plain.direct) < 0.005
    assert abs(frame.direct.mean() / plain.direct.mean() - 1) < 1e-3
    assert abs(frame.fragments.total / plain.fragments.total - 1) < 0.01
    # negative control: a spot whose intensity does not go with the square of the size
    assert share_off(render(renderer, room(matrix), view(matrix, **SIZE)).direct, plain.direct) > 0.05


def test_a_power_of_two_changes_no_bit(renderer: ml.Renderer, plain: ml.Frame) -> None:
    matrix = np.diag([1024.0, 1024, 1024, 1])
    frame = render(renderer, room(matrix, 1024), view(matrix, **SIZE))
    assert (frame.image == plain.image).all()
    assert frame.fragments == plain.fragments


def test_a_million_units_away_it_looks_the_same(renderer: ml.Renderer, plain: ml.Frame) -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = (1e6, -2e6, 5e5)
    camera = view(matrix, **SIZE)
    assert share_off(render(renderer, room(matrix), camera).direct, plain.direct) < 0.005
    matrix[0, 3] += 0.05
    assert share_off(render(renderer, room(matrix), camera).direct, plain.direct) > 0.1


def test_brightness_is_linear(renderer: ml.Renderer, plain: ml.Frame) -> None:
    """What is asked does not depend on how bright the lights are."""
    scene = room(EYE)
    for light in scene.lights.values():
        if isinstance(light, ml.AreaLight):
            light.radiance = light.radiance * np.float32(8)
        else:
            light.intensity = light.intensity * np.float32(8)
    bright = render(renderer, scene, view(EYE, **SIZE))
    assert (bright.direct == 8 * plain.direct).all()
    assert bright.fragments == plain.fragments
    assert bright.direct.any()


def test_lights_add_up(renderer: ml.Renderer, plain: ml.Frame) -> None:
    """Each light's share is its own, though fragments are shared."""
    names = list(room(EYE).lights)
    assert len(names) == 3
    total = np.zeros_like(plain.direct, np.float64)
    for name in names:
        scene = room(EYE)
        for other in names:
            if other != name:
                light = scene.lights[other]
                dark = np.zeros(3, np.float32)
                setattr(light, "radiance" if isinstance(light, ml.AreaLight) else "intensity", dark)
        total += render(renderer, scene, view(EYE, **SIZE)).direct
    assert relative(plain.direct, total).max() < 1e-6
    assert relative(plain.direct, 1.001 * total).max() > 1e-6


@pytest.mark.parametrize("name", ["sphere_card", "torture_wide"])
def test_seeds_differ_and_agree_on_the_mean(renderer: ml.Renderer, name: str) -> None:
    scene, camera = CLAIMS[name].build(96, 77)
    one, two = (renderer.render(scene, camera, DEFAULT.replace(seed=seed)).image for seed in (0, 12345))
    assert (one != two).any()
    assert abs(one.mean() / two.mean() - 1) < 0.005


@pytest.mark.parametrize("shift", [(8, 8), (32, 64)])
def test_a_cut_has_the_same_pixels(renderer: ml.Renderer, shift: tuple[int, int]) -> None:
    """The window of a larger picture, cut along its tiles, but for what lies at the window's edge."""
    scene, whole = CLAIMS["boxes"].build(160, 144)
    row, column = shift
    k = whole.K.copy()
    k[0, 2] -= column
    k[1, 2] -= row
    part = ml.Camera.from_intrinsics(k, whole.world_from_camera, 72, 64)
    large = render(renderer, scene, whole).direct[row : row + 64, column : column + 72]
    small = render(renderer, scene, part).direct
    inner = slice(16, -16)
    # jitter goes by the pixel's place in the picture: the same light, other samples
    error = np.sqrt(((small - large)[inner, inner] ** 2).mean()) / large.mean()
    assert error < 0.05
    assert np.sqrt(((small - np.roll(large, 8, 1))[inner, inner] ** 2).mean()) / large.mean() > 0.05


def test_other_work_in_between_changes_no_bit(renderer: ml.Renderer, plain: ml.Frame) -> None:
    for width in (5, 170, 33, 1):
        render(renderer, room(EYE), view(EYE, width=width, height=19))
    again = render(renderer, room(EYE), view(EYE, **SIZE))
    assert (again.image == plain.image).all()
    assert again.fragments == plain.fragments
