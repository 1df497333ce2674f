"""Irradiance of a parallelogram: near and far, whole and cut by horizons, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.polygons import contour, parallelogram_irradiance, subdivided
from tests.passes.reference.run import Runner, assert_not_within, assert_within

Array = NDArray[np.float64]
IMPORTS = "import package::common::polygon::parallelogram_irradiance;"
BODY = """
    if i % 5u == 0u {
        answer[i].x = parallelogram_irradiance(
            given[i].xyz, given[i + 1u].xyz, given[i + 2u].xyz, given[i + 3u].xyz, given[i + 4u].xyz);
    }"""
UP = np.array([0.0, 0, 1])


def _unit(v: Array) -> Array:
    made: Array = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return made


def _shader(runner: Runner, cases: Array) -> Array:
    """`cases` (n, 5, 3): normal, geometric normal, corner, u, v."""
    given = np.zeros((len(cases) * 5, 4), np.float32)
    given[:, :3] = cases.reshape(-1, 3)
    words = runner.function(IMPORTS, BODY, given)
    return words.view(np.float32)[::5, 0, 0].astype(np.float64)


def _reference(cases: Array) -> Array:
    exact = cases.astype(np.float32).astype(np.float64)
    return np.array([parallelogram_irradiance(*case) for case in exact])


def _cases(rng: np.random.Generator, count: int, distance: float, tilt: float = 0.0) -> Array:
    """Parallelograms of about unit size at a distance, anywhere about the point; normals alike or tilted."""
    normal = _unit(rng.normal(size=(count, 3)))
    geometric = _unit(normal + tilt * rng.normal(size=(count, 3)))
    u, v = _unit(rng.normal(size=(count, 3))), rng.normal(size=(count, 3))
    v = _unit(v - 0.7 * (v * u).sum(axis=1, keepdims=True) * u) * rng.uniform(0.3, 1, (count, 1))
    middle = distance * _unit(rng.normal(size=(count, 3)))
    return np.stack([normal, geometric, middle - (u + v) / 2, u, v], axis=1)


def test_the_references_agree_with_each_other_and_by_hand() -> None:
    """Contour and quadrature; a square straight above at distance 1 of side 2; a half-space."""
    rng = np.random.default_rng(5)
    for n, _, corner, u, v in _cases(rng, 20, 3.0):
        corners = np.array([corner, corner + u, corner + u + v, corner + v])
        if (corners @ n > 0).all():
            assert contour(n, corners) == pytest.approx(subdivided(n, corner, u, v), rel=1e-6)
    # E = 4/√2 · atan(1/√2) for a square of half side 1 at height 1: four triangles of the contour
    square = np.array([(-1.0, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)])
    assert contour(UP, square) == pytest.approx(4 / np.sqrt(2) * np.arctan(1 / np.sqrt(2)), rel=1e-12)
    huge = square * [1e6, 1e6, 1]
    assert contour(UP, huge) == pytest.approx(np.pi, rel=1e-5)


@pytest.mark.parametrize("distance", [0.6, 1.0, 2.0, 4.9, 5.1, 10.0, 100.0, 1e4])
@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_irradiance_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, distance: float, tilt: float
) -> None:
    cases = _cases(rng, 1500, distance, tilt)
    found, expected = _shader(runner, cases), _reference(cases)
    # near: the contour's angles hold 1e-6 each; far: the quadrature's error, and the rounding of cosines
    bound = 2e-5 * expected + (4e-6 if distance < 5 else 1e-6 / distance**2)
    assert (expected > 0).mean() > 0.3
    assert_within(found, expected, bound, "irradiance")
    assert_not_within(found, 1.001 * expected, bound)


def test_a_polygon_sinks_below_the_horizon_smoothly(runner: Runner) -> None:
    """Turned through the horizon in small steps, irradiance only falls, and to zero (N4)."""
    angle = np.linspace(-0.9, 0.9, 2001)
    normal = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    corner, u, v = np.array([-2, -0.5, -0.5]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0])
    cases = np.stack(np.broadcast_arrays(normal, normal, corner, u, v), axis=1)
    found = _shader(runner, np.array(cases))
    steps = np.diff(found)
    assert (steps <= 1e-6).all()
    assert np.abs(steps).max() < 2e-3
    assert found[0] > 0.05
    assert found[-1] == 0


def test_scale_does_not_matter(runner: Runner, rng: np.random.Generator) -> None:
    cases = _cases(rng, 200, 3.0)
    base = _shader(runner, cases)
    for scale in (1e-15, 1e-5, 1e5, 1e15):
        sized = cases.copy()
        sized[:, 2:] *= scale
        assert_within(_shader(runner, sized), base, 2e-5 * base + 4e-6, f"scale {scale}")


def test_hand_cases(runner: Runner) -> None:
    """Straight above, below, on edge, and with the point on the polygon's rim and in its plane."""
    x, y, z = np.eye(3)
    above = [UP, UP, -x - y + z, 2 * x, 2 * y]
    below = [UP, UP, -x - y - z, 2 * x, 2 * y]
    upright = [UP, UP, x - y - z, 2 * y, 2 * z]
    coplanar = [UP, UP, 2 * x, x, y]
    geometric = [UP, -UP, -x - y + z, 2 * x, 2 * y]
    found = _shader(runner, np.array([above, below, upright, coplanar, geometric]))
    full = 4 / np.sqrt(2) * np.arctan(1 / np.sqrt(2))
    # the upper half of an upright square: by the contour of its four corners
    half = contour(UP, np.array([x - y, x + y, x + y + z, x - y + z]))
    assert_within(found, np.array([full, 0, half, 0, 0]), 4e-6, "by hand")
    assert np.isfinite(
        _shader(runner, np.array([[UP, UP, 0 * x, x, y], [UP, UP, -x - y, 2 * x, 2 * y]]))
    ).all()
