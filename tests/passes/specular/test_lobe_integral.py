"""`lobe_integral`: the unshadowed light of a lobe, against sums over the whole light in float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import random_view
from tests.passes.reference.lights import Area
from tests.passes.reference.lobes import Glossy, lobe_light, reflected, sums
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import NOTHING, SURFACE, row

Array = NDArray[np.float64]
STEM = "passes/specular/lobe_integral"
SIDE = 8


def floor(rng: np.random.Generator, exponent: float, tilt: float = 0.0) -> tuple[NDArray[Any], Glossy]:
    """SIDE² points of a floor seen at all angles, and the view; `tilt`: shading off the geometric normal."""
    view = random_view(rng, SIDE, SIDE)
    view["eye"][0] = (0.0, 1.5, 4.0)
    count = SIDE * SIDE
    position = np.column_stack([rng.uniform(-2, 2, count), np.zeros(count), rng.uniform(-1.5, 2.5, count)])
    up = np.broadcast_to([0.0, 1.0, 0.0], (count, 3))
    normal = up + tilt * rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    arrays = [position, normal, up, np.broadcast_to([0.3, 0.5, 0.7], (count, 3))]
    made = [a.astype(np.float32).astype(np.float64) for a in arrays]
    return view, Glossy(*made, np.full(count, exponent), view["eye"][0].astype(np.float64))


def screen(picture: Array, distance: float = 2.0) -> Area:
    """An upright screen behind the floor that shines towards the eye."""
    corner = np.array([-1.5, 0.2, -distance])
    return Area(corner, np.array([3.0, 0, 0]), np.array([0, 2.0, 0.2]), picture)


def shade(runner: Runner, view: NDArray[Any], points: Glossy, light: Area, kinds: Any = SURFACE) -> Array:
    """Lobe light a pixel as the pass makes it."""
    count = len(points.position)
    out = runner(
        STEM,
        count,
        source=lobe_light(light),
        view=view,
        g_position=row(points.position, np.float32(1e-6).view(np.uint32)),
        g_normal=row(points.normal, kinds),
        g_geometric=row(points.geometric, 0),
        lobe_surface=np.column_stack([points.color, points.exponent]).astype(np.float32),
        light_sums=sums(light),
        lobe_light=np.full((count, 4), np.nan, np.float32),
    )
    return read(out, "lobe_light", np.float32, count, 4).astype(np.float64)


@pytest.mark.parametrize("exponent", [0.0, 10.0, 200.0, 1000.0])
@pytest.mark.parametrize("tilt", [0.2])
def test_a_plain_light_is_integrated(
    runner: Runner, rng: np.random.Generator, exponent: float, tilt: float
) -> None:
    view, points = floor(rng, exponent, tilt)
    light = screen(np.full((1, 1, 3), 2.0))
    found = shade(runner, view, points, light)
    expected = reflected(light, points)
    # nodes meet a horizon that crosses the light, and the border of a patch, with a jump
    bound = 0.02 * expected + 0.005 * expected.max()
    assert_within(found[:, :3], expected, bound, "radiance")
    assert np.sqrt(np.mean((found[:, :3] - expected) ** 2)) < 0.004 * expected.max()
    assert_not_within(found[:, :3], expected * 1.05, bound)
    assert ((found[:, 3] == 1) == (found[:, :3] > 0).any(1)).all()


@pytest.mark.parametrize("exponent", [10.0, 1000.0])
def test_a_picture_is_integrated(runner: Runner, rng: np.random.Generator, exponent: float) -> None:
    view, points = floor(rng, exponent)
    light = screen(rng.uniform(0, 1, (7, 9, 3)) ** 3 * 5)
    found = shade(runner, view, points, light)[:, :3]
    expected = reflected(light, points, 315)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.02 * np.sqrt(np.mean(expected**2))
    upside_down = Area(light.corner, light.u, light.v, light.radiance[::-1])
    wrong = reflected(upside_down, points)
    assert np.sqrt(np.mean((found - wrong) ** 2)) > 0.1 * np.sqrt(np.mean(expected**2))


def test_a_lobe_full_of_light_reflects_its_colour(runner: Runner, rng: np.random.Generator) -> None:
    """Straight above, a light that fills the lobe: specular · L, because the lobe integrates to 1."""
    view, points = floor(rng, 60.0)
    points.position[:] = view["eye"][0] = (0, 0, 0)
    view["eye"][0] = points.eye[:] = (0, 3, 0)
    light = Area(
        np.array([-6, 1, -6.0]), np.array([12.0, 0, 0]), np.array([0, 0, 12.0]), np.full((1, 1, 3), 4.0)
    )
    found = shade(runner, view, points, light)
    assert_within(found[:, :3], 4 * points.color, 2e-3 * 4 * points.color, "specular · L")


def test_what_sees_nothing_or_lies_behind_has_none(runner: Runner, rng: np.random.Generator) -> None:
    view, points = floor(rng, 10.0)
    light = screen(np.ones((1, 1, 3)))
    behind = Area(light.corner, light.v, light.u, light.radiance)
    assert not shade(runner, view, points, behind).any()
    both = Area(light.corner, light.v, light.u, light.radiance, two_sided=True)
    assert shade(runner, view, points, both)[:, :3].any()
    assert not shade(runner, view, points, light, NOTHING).any()
    points.color[:] = 0
    assert not shade(runner, view, points, light).any()


def test_each_pixel_gets_the_lobe_of_its_instance(runner: Runner, rng: np.random.Generator) -> None:
    lobes = rng.uniform(0, 1, (5, 4)).astype(np.float32)
    kinds, at = rng.choice([NOTHING, SURFACE, 2], 200), rng.integers(0, 5, 200)
    out = runner(
        STEM,
        200,
        entry="surfaces",
        g_normal=row(np.zeros((200, 3)), kinds),
        g_albedo=row(np.zeros((200, 3)), np.where(kinds == SURFACE, at, 0xFFFFFFFF)),
        instance_lobes=lobes,
        lobe_surface=np.full((200, 4), np.nan, np.float32),
    )
    found = read(out, "lobe_surface", np.float32, 200, 4)
    assert (found == np.where((kinds == SURFACE)[:, None], lobes[at], 0)).all()
