"""The lights' table: where a light's radiance is looked up, and what its rows mean."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.lights import Area, Light, random_area, random_spot, table
from tests.passes.reference.pictures import emitted, stratum_means
from tests.passes.reference.run import Runner, assert_not_within, assert_within

IMPORTS = "import package::common::light::{light_at, light_radiance_at, lights};"
SQUARE = {"corner": np.zeros(3), "u": np.array([1.0, 0, 0]), "v": np.array([0, 1.0, 0])}


def _radiance(
    runner: Runner, lights: list[Light], number: NDArray[np.int64], ab: NDArray[np.float32]
) -> NDArray[np.float32]:
    given = np.zeros((len(ab), 4), np.float32)
    given[:, :2], given[:, 2] = ab, number
    body = "answer[i] = vec4f(light_radiance_at(light_at(u32(given[i].z)), given[i].xy), 0.0);"
    words = runner.function(IMPORTS, body, given, lights=table(lights))
    return words[:, 0, :3].view(np.float32)


def _ramp(height: int, width: int) -> NDArray[np.float64]:
    """Red tells the column, green the row, blue both."""
    row, column = np.mgrid[:height, :width] + 1.0
    return np.stack([column, 10 * row, column * row], axis=-1)


def test_row_0_lies_at_b_1_and_column_0_at_a_0(runner: Runner) -> None:
    """A hand case: 2 rows, 3 columns, constant patches."""
    picture = _ramp(2, 3)
    light = Area(**SQUARE, radiance=picture)
    ab = np.array([(0.1, 0.9), (0.5, 0.9), (0.9, 0.9), (0.1, 0.1), (0.9, 0.1)], np.float32)
    found = _radiance(runner, [light], np.zeros(5, int), ab)
    hand = [picture[0, 0], picture[0, 1], picture[0, 2], picture[1, 0], picture[1, 2]]
    assert (found == np.array(hand)).all()
    assert not (found == np.array(hand)[::-1]).all()


def test_corners_and_edges_stay_inside(runner: Runner) -> None:
    for linear in (False, True):
        picture = _ramp(4, 5)
        light = Area(**SQUARE, radiance=picture, linear=linear)
        ab = np.array([(0, 1), (1, 1), (0, 0), (1, 0)], np.float32)
        found = _radiance(runner, [light], np.zeros(4, int), ab)
        corners = [picture[0, 0], picture[0, -1], picture[-1, 0], picture[-1, -1]]
        assert (found == np.array(corners)).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (6, 1), (5, 9), (64, 48)])
@pytest.mark.parametrize("linear", [False, True])
def test_pictures_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], linear: bool
) -> None:
    """Among other lights, so that the offsets of rows and texels count."""
    lights: list[Light] = [
        random_area(rng, (3, 2)),
        random_spot(rng),
        random_area(rng),
        random_area(rng, size, linear=linear),
    ]
    ab = rng.uniform(0, 1, (4000, 2)).astype(np.float32)
    # a patch's edge may go either way
    texels = ab * np.array(size[::-1])
    clear = linear | (np.abs(texels - np.round(texels)).min(axis=1) > 1e-4)
    found = _radiance(runner, lights, np.full(4000, 3), ab)[clear]
    light = lights[3]
    assert isinstance(light, Area)
    assert_within(found, light.emitted(ab[clear]), 1e-4 if linear else 0, "radiance")
    if size != (1, 1):
        assert_not_within(found, light.emitted(1 - ab[clear]), 1e-4 if linear else 0)


def test_constant_lights_and_spots_have_one_value(runner: Runner, rng: np.random.Generator) -> None:
    lights: list[Light] = [random_area(rng), random_spot(rng), random_area(rng, (2, 2))]
    ab = rng.uniform(0, 1, (10, 2)).astype(np.float32)
    for number, light in enumerate(lights[:2]):
        found = _radiance(runner, lights, np.full(10, number), ab)
        value = light.radiance if isinstance(light, Area) else light.intensity
        assert (found == value.astype(np.float32)).all()


def test_rows_are_read_as_they_are_written(runner: Runner, rng: np.random.Generator) -> None:
    lights: list[Light] = [
        random_area(rng, (3, 2), two_sided=True, linear=True),
        random_spot(rng),
        random_area(rng),
    ]
    body = """
    let l = light_at(i);
    answer[6u * i] = vec4f(l.corner, f32(l.kind));
    answer[6u * i + 1u] = vec4f(l.edge_u, f32(l.two_sided));
    answer[6u * i + 2u] = vec4f(l.edge_v, 0.0);
    answer[6u * i + 3u] = vec4f(l.normal, l.area);
    answer[6u * i + 4u] = vec4f(l.radiance, l.cos_cutoff);
    answer[6u * i + 5u] = vec4f(f32(l.texels), f32(l.width), f32(l.height), f32(l.linear));"""
    rows = table(lights)
    words = runner.function(
        IMPORTS.replace("light_radiance_at, ", ""), body, np.zeros((3, 4), np.float32), rows=6, lights=rows
    )
    assert (words.view(np.float32).reshape(18, 4) == rows[:18]).all()


def test_the_reference_pictures_by_hand() -> None:
    """Two texels side by side: a jump in the middle, or a ramp from 1/4 to 3/4; their means over parts."""
    picture = np.array([[[0.0] * 3, [1.0] * 3]])
    ab = np.array([(0.1, 0.5), (0.4, 0.5), (0.5, 0.5), (0.6, 0.5), (0.9, 0.5)])
    assert np.allclose(emitted(picture, ab, False)[:, 0], [0, 0, 1, 1, 1])
    assert np.allclose(emitted(picture, ab, True)[:, 0], [0, 0.3, 0.5, 0.7, 1])
    assert np.allclose(stratum_means(picture, 3, 1, False)[0, :, 0], [0, 0.5, 1])
    # from 1/4 on the ramp rises by 2 a unit: up to 1/2 it gains 1/16
    assert np.allclose(stratum_means(picture, 2, 1, True)[0, :, 0], [1 / 8, 7 / 8])
    tall = picture.reshape(2, 1, 3)
    assert np.allclose(stratum_means(tall, 1, 2, False)[:, 0, 0], [1, 0]), "row 0 lies at b = 1"
    fine = np.stack(np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) / 400), axis=-1)
    picture = np.random.default_rng(1).uniform(size=(5, 3, 3))
    for linear in (False, True):
        sampled = emitted(picture, fine.reshape(-1, 2), linear).reshape(4, 100, 4, 100, 3).mean(axis=(1, 3))
        assert np.allclose(stratum_means(picture, 4, 4, linear), sampled, atol=5e-3)
