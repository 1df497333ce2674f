"""Bases and the cosine-weighted hemisphere of the shaders."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.hemisphere import concentric, frame
from tests.passes.reference.run import Runner, assert_not_within, assert_within

SIDE = 256


def _normals(rng: np.random.Generator) -> NDArray[np.float32]:
    """Directions everywhere, along the axes, and crowded about ±z where other constructions fail."""
    around = rng.normal(size=(4000, 3))
    tilt = rng.normal(size=(2000, 3)) * 10.0 ** rng.uniform(-9, -1, (2000, 1))
    z = np.array([0, 0, 1])
    poles = np.concatenate([tilt[:1000] + z, tilt[1000:] - z])
    axes = np.concatenate([np.eye(3), -np.eye(3), [[-0.0, -0.0, -1.0], [0.6, 0.8, -0.0]]])
    n = np.concatenate([around, poles, axes])
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)


def _four(v: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.pad(v, ((0, 0), (0, 4 - v.shape[1])))


def _middles(count: int) -> NDArray[np.float64]:
    return (np.arange(count) + 0.5) / count


def _squares(side: int = SIDE) -> NDArray[np.float32]:
    """Middles of side × side cells of the unit square."""
    return np.stack(np.meshgrid(_middles(side), _middles(side)), axis=-1).reshape(-1, 2).astype(np.float32)


def _tangents(runner: Runner, n: NDArray[np.float32]) -> NDArray[np.float64]:
    words = runner.function(
        "import package::common::basis::tangents;",
        """
    let m = tangents(given[i].xyz);
    answer[2u * i] = vec4f(m[0], 0.0);
    answer[2u * i + 1u] = vec4f(m[1], 0.0);""",
        _four(n),
        rows=2,
    )
    return words.view(np.float32)[..., :3].astype(np.float64)


def _directions(runner: Runner, n: NDArray[np.float32], squares: NDArray[np.float32]) -> NDArray[np.float64]:
    x, y, z = (f"bitcast<f32>({int(c)}u)" for c in n.view(np.uint32))
    body = f"answer[i] = vec4f(cosine_direction(vec3f({x}, {y}, {z}), given[i].xy), 0.0);"
    words = runner.function("import package::common::basis::cosine_direction;", body, _four(squares))
    return words[:, 0].view(np.float32)[:, :3].astype(np.float64)


def test_tangents_are_orthonormal_and_right_handed(runner: Runner, rng: np.random.Generator) -> None:
    n = _normals(rng)
    t = _tangents(runner, n)
    basis = np.concatenate([t, n[:, None].astype(np.float64)], axis=1)
    gram = basis @ basis.transpose(0, 2, 1)
    assert_within(gram, np.broadcast_to(np.eye(3), gram.shape), 5e-7, "dot products")
    assert_within(np.linalg.det(basis), np.ones(len(n)), 1e-6, "handedness")
    assert_within(t, frame(n.astype(np.float64)), 5e-7, "tangents")
    basis[:, 0] += 1e-5 * basis[:, 1]
    assert_not_within(basis @ basis.transpose(0, 2, 1), gram, 5e-7)


def test_the_disc_map_is_shirley_s_and_chiu_s(runner: Runner, rng: np.random.Generator) -> None:
    edges = np.array([(0, 0), (1, 1), (0, 1), (1, 0), (0.5, 0.5), (0.5, 0), (0, 0.5), (1, 0.5)])
    squares = np.concatenate([_squares(64), rng.uniform(size=(5000, 2)), edges]).astype(np.float32)
    words = runner.function(
        "import package::common::basis::disc_from_square;",
        "answer[i] = vec4f(disc_from_square(given[i].xy), 0.0, 0.0);",
        _four(squares),
    )
    disc = words[:, 0].view(np.float32)[:, :2].astype(np.float64)
    expected = concentric(squares.astype(np.float64))
    assert_within(disc, expected, 1e-6, "places in the disc")
    assert_not_within(disc, concentric(squares[:, ::-1].astype(np.float64)), 1e-6)
    assert (np.linalg.norm(disc, axis=1) <= 1 + 1e-6).all()


def test_the_reference_disc_map_keeps_areas_and_is_one_to_one() -> None:
    """Its Jacobian is π/4 everywhere, by central differences off the diagonals; no two cells overlap."""
    squares = _squares(63).astype(np.float64)
    p = 2 * squares - 1
    smooth = np.abs(np.abs(p[:, 0]) - np.abs(p[:, 1])) > 1e-3
    h = 1e-5
    x, y = (concentric(squares + s) - concentric(squares - s) for s in ([h, 0], [0, h]))
    jacobian = (x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])[smooth] / (2 * h) ** 2
    # the unit square has area 1, the disc π: with squares in [0, 1] the determinant is π
    assert_within(np.abs(jacobian), np.full(smooth.sum(), np.pi), 1e-4, "Jacobian")
    assert (np.sign(jacobian) == np.sign(jacobian[0])).all()


@pytest.mark.parametrize("pole", [(0, 0, 1), (0, 0, -1), (0.6, -0.48, 0.64), (1, 0, 0), (1e-4, 2e-4, -1)])
def test_directions_have_the_moments_of_a_cosine(runner: Runner, pole: tuple[float, ...]) -> None:
    """Density cosθ/π: means (0, 0, 2/3), second moments diag(1/4, 1/4, 1/2)."""
    n = np.array(pole) / np.linalg.norm(pole)
    d = _directions(runner, n.astype(np.float32), _squares())
    assert_within(np.linalg.norm(d, axis=1), np.ones(len(d)), 3e-7, "lengths")
    local = d @ np.concatenate([frame(n[None])[0], n[None]]).T
    assert local[:, 2].min() >= -1e-6
    # the midpoint rule over a root's edge is off by h^1.5 = 2.4e-4
    assert_within(local.mean(axis=0), [0, 0, 2 / 3], [1e-6, 1e-6, 2.4e-4], "means")
    second = local.T @ local / len(local)
    assert_within(second, np.diag([0.25, 0.25, 0.5]), 2e-5, "second moments")
    # the cells make rings, one in 128 of the disc's area apart at most
    assert_within(np.sort(local[:, 2]) ** 2, _middles(len(d)), 1 / 128, "distribution: P(z < c) = c²")
    assert_not_within(second, np.diag([0.25, 0.25, 0.5]) * 1.001, 2e-5)


def test_directions_agree_with_the_reference(runner: Runner, rng: np.random.Generator) -> None:
    n = rng.normal(size=3)
    n = (n / np.linalg.norm(n)).astype(np.float32)
    squares = rng.uniform(size=(4000, 2)).astype(np.float32)
    d = _directions(runner, n, squares)
    disc = concentric(squares.astype(np.float64))
    z = np.sqrt(np.clip(1 - (disc**2).sum(axis=1), 0, None))
    full = np.concatenate([frame(n[None].astype(np.float64))[0], n[None]])
    expected = np.concatenate([disc, z[:, None]], axis=1) @ full
    # the height above the disc is ill-conditioned at its rim: an error e of r becomes e/z
    bound = 1e-6 + 4e-7 / np.maximum(z, 4e-4)
    assert_within(d, expected, bound[:, None], "directions")
    assert_not_within(d, expected[::-1], bound[:, None])
