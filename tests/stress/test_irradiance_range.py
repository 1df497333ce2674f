"""Irradiance of a rectangle over the whole range of sizes and distances (N3), and at the horizon (N4)."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import floor_points, floor_scene, light_irradiance, view_down
from tests.analytic.quadrature import irradiance
from tests.stress.common import ALBEDO, PRESETS, UP, Array, quick, sized

WIDTHS = [1e-6, 1e-3, 1.0, 1e2, 1e4]
DISTANCES = sized([1e-2, 1.0, 1e2, 1e4], [1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4])
PAIRS = [(width, distance) for width in WIDTHS for distance in DISTANCES]


def _light(width: float, distance: float) -> ml.AreaLight:
    """A tilted light about `distance` above the floor and beside the middle; all of it is above the floor."""
    u, v = width * np.array((1.0, 0.2, 0)), width * np.array((0.1, 0, 0.9))
    corner = distance * np.array((0.3, 1.0, 0.2)) - (u + v) / 2
    corner[1] = max(corner[1], 0.01 * distance)
    return ml.AreaLight(corner, u, v, (5.0, 3.0, 1.0), visible=False)


def _expected(light: ml.AreaLight, camera: ml.Camera, ratio: float) -> Array:
    """Lambert's formula near, quadrature far: the formula's terms cancel with the square of the distance."""
    points = floor_points(camera)
    if ratio < 1e3:
        return ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    return ALBEDO / np.pi * irradiance(light, points, UP)[:, None] * light.radiance


def _own_error(found: Array, expected: Array) -> float:
    """Largest error relative to a pixel's own value, of pixels above a thousandth of the brightest."""
    bright = expected > 1e-3 * expected.max()
    return float((np.abs(found.reshape(-1, 3) - expected)[bright] / expected[bright]).max())


@pytest.mark.parametrize(("width", "distance"), PAIRS)
def test_the_default_is_exact_over_ten_decades(renderer: ml.Renderer, width: float, distance: float) -> None:
    light, camera = _light(width, distance), view_down(10, 8, up=distance, fov_y=40)
    frame = renderer.render(floor_scene(light, size=4 * distance), camera, "default")
    expected = _expected(light, camera, distance / width)
    assert expected.min() >= 0
    assert expected.max() > 0
    assert _own_error(frame.direct, expected) < 1e-5
    assert _own_error(1.0001 * frame.direct, expected) > 1e-5, "negative control"


@pytest.mark.parametrize(("width", "distance"), [pair for pair in PAIRS if pair[1] >= 10 * pair[0]])
@pytest.mark.parametrize("preset", [name for name in PRESETS if name != "default"])
def test_samples_are_as_good_far_from_the_light(
    renderer: ml.Renderer, preset: str, width: float, distance: float
) -> None:
    """Seen under a tenth of a radian the sum over 64 samples is right to a thousandth (N2)."""
    light, camera = _light(width, distance), view_down(10, 8, up=distance, fov_y=40)
    settings = quick(preset, light_pattern="grid", coarsest_level=0)  # no noise, no interpolation
    frame = renderer.render(floor_scene(light, size=4 * distance), camera, settings)
    expected = _expected(light, camera, distance / width)
    assert _own_error(frame.direct, expected) < 1e-3
    assert _own_error(1.01 * frame.direct, expected) > 1e-3, "negative control"


def test_both_references_agree_where_they_meet() -> None:
    light, camera = _light(1.0, 1e3), view_down(4, 3, up=1e3, fov_y=40)
    near, far = _expected(light, camera, 1.0), _expected(light, camera, 1e6)
    np.testing.assert_allclose(near, far, rtol=1e-7)
    # and why the formula is not asked far away
    light, camera = _light(1.0, 1e7), view_down(4, 3, up=1e7, fov_y=40)
    assert np.abs(_expected(light, camera, 1.0) / _expected(light, camera, 1e6) - 1).max() > 1e-4


def _turned(degrees: float) -> ml.AreaLight:
    """A square of 0.8 × 0.8 two units from the origin, facing it, its middle `degrees` over the horizon."""
    angle = np.radians(degrees)
    out, up = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
    side = np.array([0, 0, 1.0])
    corner = 2 * out - 0.4 * up - 0.4 * side
    return ml.AreaLight(corner, 0.8 * side, 0.8 * up, (5.0, 3.0, 1.0), visible=False, two_sided=True)


@pytest.mark.parametrize("preset", ["default", "brute-force", "area-2010", "area-2016"])
def test_light_sets_without_a_jump(renderer: ml.Renderer, preset: str) -> None:
    """A light turns about a small floor through its horizon: always what Lambert says, down to zero."""
    exact, camera = preset == "default", view_down(4, 4, up=0.1, fov_y=10)
    steps = np.concatenate([np.linspace(14, -14, sized(20, 400)), [11.32, 11.30, 0.0, -11.3, -11.32]])
    settings = quick(preset).replace(light_samples=1024, light_pattern="grid", interleave=1)
    found, expected = [], []
    for degrees in np.sort(steps):
        light = _turned(float(degrees))
        found.append(renderer.render(floor_scene(light, size=0.2), camera, settings).direct[1, 1])
        expected.append(_expected(light, camera, 1.0)[5])
    got, want = np.array(found, np.float64), np.array(expected)
    assert want[0].max() == 0 < want[-1].min(), "it rises"
    assert not got[want.max(axis=1) == 0].any(), "no light from below"
    assert (np.diff(got, axis=0) > (-1e-6 if exact else -1e-3) * want.max()).all(), "it only grows"
    # a grid of 32 rows clips the light a row at a time, each of them grazing
    bound = 1e-5 if exact else 4e-3
    assert np.abs(got - want).max() < bound * want.max()
    assert np.abs(1.01 * got - want).max() > bound * want.max(), "negative control"
