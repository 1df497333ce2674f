"""`composite`: radiance = emitted + albedo/π · (direct + indirect irradiance)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.lights import Area, Light, random_area, random_spot, table
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import COMPOSITE, FIRST_LIGHT, NOTHING, SURFACE, record, row

NAMES = ("image", "direct", "indirect")


def _run(
    runner: Runner,
    kinds: NDArray[np.int64],
    colors: NDArray[np.float32],
    lights: list[Light],
    irradiance: tuple[NDArray[np.float32] | None, NDArray[np.float32] | None],
) -> dict[str, NDArray[np.float32]]:
    count = len(kinds)
    given = [np.zeros((1, 4), np.float32) if part is None else part for part in irradiance]
    blank = np.full((count, 4), np.nan, np.float32)
    out = runner(
        "passes/composite/composite",
        count,
        params=record(COMPOSITE, direct=irradiance[0] is not None, indirect=irradiance[1] is not None),
        g_normal=row(np.zeros((count, 3)), kinds),
        g_albedo=row(colors, 0),
        lights=table(lights) if lights else np.zeros((1, 4), np.float32),
        direct_irradiance=given[0],
        indirect_irradiance=given[1],
        image=blank,
        direct=blank,
        indirect=blank if irradiance[1] is not None else blank[:1],
    )
    return {name: read(out, name, np.float32).reshape(-1, 4) for name in NAMES}


def _random(rng: np.random.Generator, count: int) -> tuple[NDArray[Any], NDArray[Any], list[Any]]:
    kinds = rng.choice([NOTHING, SURFACE, SURFACE, SURFACE], count)
    colors = rng.uniform(0, 1, (count, 3)).astype(np.float32)
    parts = [rng.lognormal(0, 2, (count, 4)).astype(np.float32) for _ in range(2)]
    return kinds, colors, parts


@pytest.mark.parametrize("count", [1, 63, 333 * 217])
def test_surfaces_reflect_what_arrives(runner: Runner, rng: np.random.Generator, count: int) -> None:
    kinds, colors, parts = _random(rng, count)
    out = _run(runner, kinds, colors, [], (parts[0], parts[1]))
    reflected = np.where((kinds == SURFACE)[:, None], colors, 0) / np.pi
    direct, indirect = (reflected * part[:, :3].astype(np.float64) for part in parts)
    for name, expected in zip(NAMES, (direct + indirect, direct, indirect), strict=True):
        assert_within(out[name][:, :3], expected, 6 * ULP * expected, name)
        assert_not_within(out[name][:, :3], expected * (1 + 1e-6) + 1e-30, 6 * ULP * expected)
        assert (out[name][:, 3] == 1).all()


def test_a_white_surface_under_pi_is_one(runner: Runner) -> None:
    """A hand case: E = π on albedo 1 leaves with radiance 1."""
    e = np.full((1, 4), np.pi, np.float32)
    out = _run(runner, np.array([SURFACE]), np.ones((1, 3), np.float32), [], (e, None))
    assert_within(out["image"][0, :3], np.ones(3), 4 * ULP)


@pytest.mark.parametrize("there", [(True, False), (False, True), (False, False)])
def test_what_is_not_rendered_counts_as_nothing(
    runner: Runner, rng: np.random.Generator, there: tuple[bool, bool]
) -> None:
    kinds, colors, parts = _random(rng, 500)
    given = [part if here else None for part, here in zip(parts, there, strict=True)]
    out = _run(runner, kinds, colors, [], (given[0], given[1]))
    both = _run(runner, kinds, colors, [], (parts[0], parts[1]))
    expected = {"direct": both["direct"] if there[0] else 0 * both["direct"]}
    if there[1]:
        expected["indirect"] = both["indirect"]
    for name, values in expected.items():
        assert (out[name][:, :3] == values[:, :3]).all(), name
    total = sum((values[:, :3] for values in expected.values()), np.zeros((500, 3), np.float32))
    assert (out["image"][:, :3] == total).all()


def test_lights_show_their_radiance_on_the_lit_side(runner: Runner, rng: np.random.Generator) -> None:
    areas = [
        random_area(rng),
        random_area(rng, two_sided=True),
        random_area(rng, (4, 3)),
        random_area(rng, (2, 5), linear=True, two_sided=True),
        random_area(rng, (1, 1)),
    ]
    lights: list[Light] = [*areas, random_spot(rng)]
    count = 3000
    number = rng.integers(0, len(areas), count)
    seen = rng.uniform(0, 1, (count, 3)).astype(np.float32)
    seen[:, 2] = rng.integers(0, 2, count)
    e = rng.uniform(1, 2, (count, 4)).astype(np.float32)
    out = _run(runner, FIRST_LIGHT + number, seen, lights, (e, e))
    expected = np.zeros((count, 3))
    for k, light in enumerate(areas):
        mine = number == k
        lit = (seen[mine, 2] == 1) | light.two_sided
        expected[mine] = np.where(lit[:, None], light.emitted(seen[mine, :2]), 0)
    assert_within(out["image"][:, :3], expected, 2e-5, "emitted")
    assert (out["direct"][:, :3] == 0).all(), "a light reflects nothing"
    assert (out["indirect"][:, :3] == 0).all()
    black = ~expected.any(axis=1)
    assert 0 < black.sum() < count
    other = np.zeros((count, 3))
    for k, light in enumerate(areas):
        mine = number == k
        flipped = Area(light.corner, light.v, light.u, light.radiance, light.two_sided, light.linear)
        other[mine] = np.where(expected[mine].any(axis=1)[:, None], flipped.emitted(seen[mine, 1::-1]), 0)
    assert_not_within(out["image"][:, :3], other, 2e-5)


def test_what_lobes_reflect_is_added_to_image_and_direct(runner: Runner, rng: np.random.Generator) -> None:
    image, direct, reflected = rng.lognormal(0, 2, (3, 200, 4)).astype(np.float32)
    out = runner(
        "passes/composite/composite",
        200,
        entry="specular",
        specular_radiance=reflected,
        image=image,
        direct=direct,
    )
    for name, before in (("image", image), ("direct", direct)):
        found = read(out, name, np.float32, 200, 4)
        assert (found[:, :3] == (before + reflected)[:, :3]).all()
        assert (found[:, 3] == before[:, 3]).all()
