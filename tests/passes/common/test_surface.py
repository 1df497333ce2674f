"""From a hit to a surface, by hand: textures, smooth normals, sizes at which squares overflow or vanish."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.pictures import half, pack_half, repeated
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within
from tests.passes.reference.structs import HIT, INSTANCE, record
from tests.passes.reference.surfaces import Placed, pack

IMPORTS = "import package::common::surface::{texture_color, instances, texels};"
TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0.0)])
ONE = np.array([(0, 1, 2)], np.uint32)


def _colors(runner: Runner, texture: NDArray[Any], uv: NDArray[np.float32]) -> NDArray[np.float32]:
    at = record(INSTANCE, texture=3, texture_width=texture.shape[1], texture_height=texture.shape[0])
    padded = np.concatenate([np.zeros((3, 2), np.uint32), pack_half(texture)])
    given = np.pad(uv, ((0, 0), (0, 2)))
    body = "answer[i] = vec4f(texture_color(instances[0], given[i].xy), 0.0);"
    words = runner.function(IMPORTS, body, given, instances=at, texels=padded)
    return words[:, 0, :3].view(np.float32)


def _surface(
    runner: Runner, mesh: Placed, hit: tuple[float, float], direction: tuple[float, float, float]
) -> dict[str, NDArray[np.float64]]:
    """One hit of triangle 0, seen along a direction."""
    body = """
    let s = surface_at(Hit(1.0, given[i].x, given[i].y, 0u, 0u), DIRECTION);
    answer[4u * i] = vec4f(s.position, s.origin_error);
    answer[4u * i + 1u] = vec4f(s.normal_geo, f32(s.front));
    answer[4u * i + 2u] = vec4f(s.normal_shade, 0.0);
    answer[4u * i + 3u] = vec4f(s.albedo, 0.0);""".replace("DIRECTION", f"vec3f{direction}")
    imports = "import package::common::ray::Hit;\n" + IMPORTS.replace("texture_color", "surface_at, geometry")
    given = np.array([[*hit, 0, 0]], np.float32)
    words = runner.function(imports, body, given, rows=4, **pack([mesh]))
    values = words[0].view(np.float32).astype(np.float64)
    names = ("position", "normal_geo", "normal_shade", "albedo")
    found = {name: values[k, :3] for k, name in enumerate(names)}
    return {**found, "error": values[0, 3], "front": values[1, 3]}


def test_row_0_of_a_texture_lies_at_v_1(runner: Runner) -> None:
    """A hand case: red, green over blue, white, read at the texels' middles; and in their common corner."""
    texture = np.array([[(1, 0, 0), (0, 1, 0)], [(0, 0, 1), (1, 1, 1.0)]])
    uv = np.array([(0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25), (0.5, 0.5)], np.float32)
    found = _colors(runner, texture, uv)
    assert (found[:4] == texture.reshape(4, 3)).all()
    assert (found[4] == 0.5).all()
    assert not (found[:4] == texture[::-1].reshape(4, 3)).all()


def test_textures_repeat(runner: Runner) -> None:
    """A hand case at the seam: half of the last column and half of the first; and far away the same again."""
    texture = np.zeros((1, 4, 3))
    texture[0, :, 0] = (1, 0.5, 0.25, 0)
    uv = np.array([(0, 0.3), (1, 0.3), (-1, 0.3), (2.125, 7.5), (-0.875, -3), (-1e-9, 0.3)], np.float32)
    assert_within(_colors(runner, texture, uv)[:, 0], [0.5, 0.5, 0.5, 1, 1, 0.5], 1e-6)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (6, 1), (7, 4), (64, 32)])
def test_textures_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    texture = half(rng.uniform(0, 1, (*size, 3)))
    uv = rng.uniform(-3, 3, (4000, 2)).astype(np.float32)
    found = _colors(runner, texture, uv)
    # uv is off by half an ulp of 3, which the number of texels magnifies
    bound = 1e-6 + 8 * ULP * 3 * max(size)
    assert_within(found, repeated(texture, uv), bound, "colours")
    if size != (1, 1):
        assert_not_within(found, repeated(texture[::-1, ::-1], uv), bound)


def test_the_reference_texture_by_hand() -> None:
    texture = np.array([[(1.0, 0, 0), (0, 1, 0)], [(0, 0, 1), (1, 1, 1)]])
    uv = np.array([(0.25, 0.75), (0.75, 0.25), (0.5, 0.75), (0.0, 0.75)])
    expected = [(1, 0, 0), (1, 1, 1), (0.5, 0.5, 0), (0.5, 0.5, 0)]
    assert np.allclose(repeated(texture, uv), expected)


@pytest.mark.parametrize("scale", [1e-15, 1e-6, 1e6, 1e15])
def test_normals_are_unit_at_any_size(runner: Runner, scale: float) -> None:
    """Cross products of such edges are as small as 1e-30 or as large as 1e30."""
    mesh = Placed(TRIANGLE * scale, ONE, np.diag([1.0, 2, 3, 1]), np.ones(3))
    s = _surface(runner, mesh, (0.25, 0.5), (0.0, 0.0, -1.0))
    assert_within(s["position"], np.array([0.25, 1.0, 0]) * scale, 4 * ULP * scale, "position")
    assert_within(s["normal_geo"], [0, 0, 1], 1e-6, "normal")
    assert s["front"] == 1


@pytest.mark.parametrize("from_below", [False, True])
def test_normals_turn_towards_the_viewer(runner: Runner, from_below: bool) -> None:
    """Each by its own sign: a shading normal that looks away from a viewer of the front is turned as well."""
    tilted = np.tile(np.array([0.8, 0, 0.6]), (3, 1))
    mesh = Placed(TRIANGLE, ONE, np.eye(4), np.ones(3), normals=tilted, smooth=True)
    sign = -1.0 if from_below else 1.0
    s = _surface(runner, mesh, (0.2, 0.2), (0.0, 0.0, -sign))
    assert_within(s["normal_geo"], [0, 0, sign], 1e-6)
    assert_within(s["normal_shade"], sign * np.array([0.8, 0, 0.6]), 1e-6)
    assert s["front"] == (not from_below)
    # seen flatly along +x from above: the front of the face, the back of the shading normal
    s = _surface(runner, mesh, (0.2, 0.2), (1.0, 0.0, -0.5))
    assert_within(s["normal_geo"], [0, 0, 1], 1e-6)
    assert_within(s["normal_shade"], [-0.8, 0, -0.6], 1e-6)


def test_opposite_vertex_normals_leave_the_face_s_own(runner: Runner) -> None:
    opposite = np.array([(1, 0, 0), (-1, 0, 0), (1, 0, 0.0)])
    mesh = Placed(TRIANGLE, ONE, np.eye(4), np.ones(3), normals=opposite, smooth=True)
    s = _surface(runner, mesh, (0.5, 0.0), (0.0, 0.0, -1.0))
    assert_within(s["normal_shade"], [0, 0, 1], 1e-6)


def test_a_sphere_stretched_has_the_normals_of_an_ellipsoid(runner: Runner) -> None:
    """Normals move by the inverse transpose: that of x²/a² + y²/b² + z²/c² = 1 is (x/a², y/b², z/c²)."""
    axes = np.array([3.0, 0.5, 1.5])
    points = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1.0)])
    mesh = Placed(points, ONE, np.diag([*axes, 1.0]), np.ones(3), normals=points, smooth=True)
    s = _surface(runner, mesh, (1 / 3, 1 / 3), (-1.0, -1.0, -1.0))
    direction = np.ones(3) / axes
    expected = direction / np.linalg.norm(direction)
    assert_within(s["normal_shade"], expected, 1e-6)
    assert_not_within(s["normal_shade"], axes / np.linalg.norm(axes), 1e-6)


def test_colours_and_textures_multiply(runner: Runner) -> None:
    mesh = Placed(
        TRIANGLE,
        ONE,
        np.eye(4),
        np.array([0.5, 0.5, 1]),
        uvs=np.full((3, 2), 0.5),
        colors=np.array([(1, 0, 0), (1, 1, 0), (1, 1, 1.0)]),
        texture=np.full((2, 2, 3), 0.25),
    )
    s = _surface(runner, mesh, (0.25, 0.5), (0.0, 0.0, -1.0))
    hand = np.array([0.5 * 0.25 * 1, 0.5 * 0.25 * 0.75, 1 * 0.25 * 0.5])
    assert_within(s["albedo"], hand, 1e-6)
    assert HIT.itemsize == 20
