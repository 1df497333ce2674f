"""`light_bounds`: where the pixels of a tile lie in a light's frame, and what kind of tile that makes."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import light_frames as frames
from tests.passes.reference.gbuffers import GBuffer, tiled_gbuffer
from tests.passes.reference.lights import Area, Light, Spot, random_area, random_spot, table
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIGHT_BOUNDS, SURFACE, TILE_BOUNDS, record

SIZES = [(141, 75), (1, 9), (37, 1), (64, 32)]
KINDS = ["one-sided", "two-sided", "spot"]


@dataclasses.dataclass
class Found:
    """What the pass wrote, and how much it added to the count."""

    bounds: NDArray[Any]
    flags: NDArray[np.uint32]
    pixels: NDArray[np.uint32]
    facing: int


def _light(rng: np.random.Generator, kind: str) -> Light:
    return random_spot(rng, 60) if kind == "spot" else random_area(rng, two_sided=kind == "two-sided")


def _run(
    runner: Runner,
    lights: list[Light],
    number: int,
    size: tuple[int, int],
    g: GBuffer,
    before: NDArray[np.uint32] | None = None,
    unshadowed: bool = False,
) -> Found:
    tiles = -(-size[0] // 8) * -(-size[1] // 8)
    out = runner(
        "passes/refine/light_bounds",
        8 * tiles,
        params=record(LIGHT_BOUNDS, width=size[0], height=size[1], light=number, unshadowed=unshadowed),
        frame=frames.light_frame(lights[number]),
        lights=table(lights),
        tile_bounds=np.zeros(tiles, TILE_BOUNDS),
        tile_flags=np.full(tiles, 0xFFFFFFFF, np.uint32),
        pixel_lights=np.zeros(size[0] * size[1], np.uint32) if before is None else before,
        facing_count=np.array([1000], np.uint32),
        **g.rows(),
    )
    return Found(
        read(out, "tile_bounds", TILE_BOUNDS),
        read(out, "tile_flags", np.uint32),
        read(out, "pixel_lights", np.uint32),
        int(read(out, "facing_count", np.uint32)[0]) - 1000,
    )


def _check(found: Found, expected: frames.Tiles) -> None:
    assert (found.flags == expected.flags).all()
    assert (found.bounds["facing"] == expected.facing).all()
    assert found.facing == expected.facing.sum()
    some = expected.facing > 0
    for name in ("lo", "hi"):
        assert_within(found.bounds[name][some], getattr(expected, name)[some], expected.rounding[some], name)
    assert (found.bounds["lo"][~some] > found.bounds["hi"][~some]).all(), "empty bounds hold nothing"


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_bounds_and_flags_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], kind: str
) -> None:
    light = _light(rng, kind)
    g = frames.without_doubt(light, tiled_gbuffer(rng, *size, surfaces=None if size[0] > 40 else 0.9))
    lights: list[Light] = [random_area(rng), light, random_spot(rng)]
    found = _run(runner, lights, 1, size, g)
    expected = frames.tiles(light, g, *size)
    _check(found, expected)
    if size[0] < 100:
        return
    turned = dataclasses.replace(g, geometric=-g.geometric, normal=-g.normal)
    with pytest.raises(AssertionError):
        _check(found, frames.tiles(light, turned, *size))
    some = expected.facing > 0
    assert_not_within(found.bounds["hi"][some], expected.hi[some] + 2e-5, expected.rounding[some])


@pytest.mark.parametrize("kind", KINDS)
def test_the_cases_hold_tiles_of_every_kind(rng: np.random.Generator, kind: str) -> None:
    """So that the agreement above says something of each flag."""
    light = _light(rng, kind)
    flags = frames.tiles(light, tiled_gbuffer(rng, 141, 75), 141, 75).flags
    kinds = {"FACING": frames.FACING, "ON_SURFACE": frames.ON_SURFACE, "FAR": frames.FAR}
    if kind != "spot":
        kinds |= {"NEAR": frames.NEAR, "CLIPPED": frames.CLIPPED}
    if kind == "two-sided":
        kinds |= {"BACK": frames.BACK, "MIXED_SIDES": frames.MIXED_SIDES}
    for name, bit in kinds.items():
        share = ((flags & bit) != 0).mean()
        assert 0.005 < share < 0.995, f"{name}: {share}"


@pytest.mark.parametrize("kind", KINDS)
def test_pixels_say_why_a_light_does_nothing_there(
    runner: Runner, rng: np.random.Generator, kind: str
) -> None:
    """What other lights said of them stays."""
    size = (50, 33)
    light = _light(rng, kind)
    g = frames.without_doubt(light, tiled_gbuffer(rng, *size))
    s = frames.seen_by(light, g)
    why = np.where(s.facing, frames.FACED, np.where(s.emits, frames.FACING_AWAY, frames.BEHIND_LIGHT))
    why[g.kind != SURFACE] = 0
    before = rng.integers(0, 8, len(why)).astype(np.uint32)
    found = _run(runner, [light], 0, size, g, before)
    assert (found.pixels == (before | why)).all()
    assert (found.pixels != why).any()
    assert found.facing == (why == frames.FACED).sum() > 0
    if kind == "two-sided":
        assert not (why == frames.BEHIND_LIGHT).any()


def test_what_nothing_can_shadow_is_lit(runner: Runner, rng: np.random.Generator) -> None:
    size = (50, 33)
    light = _light(rng, "one-sided")
    g = frames.without_doubt(light, tiled_gbuffer(rng, *size))
    flags = frames.tiles(light, g, *size).flags
    found = _run(runner, [light], 0, size, g, unshadowed=True)
    assert (found.flags == flags + frames.LIT * (flags & frames.FACING != 0)).all()
    assert not (found.flags == flags).all()


def _at(places: list[tuple[float, float, float]], normal: tuple[float, float, float]) -> GBuffer:
    """An 8 × 8 image of points about these places, that all look one way."""
    n = np.tile(np.array(normal, float), (64, 1))
    return GBuffer(np.resize(np.array(places, float), (64, 3)), np.zeros(64), n, n, np.full(64, SURFACE))


def test_hand_cases(runner: Runner) -> None:
    """A lamp of 2 × 1 at height 3 that shines down."""
    lamp = Area(np.array([-1.0, 3, 0.5]), np.array([0, 0, -1.0]), np.array([2.0, 0, 0]), np.ones(3))
    assert (lamp.normal == [0, -1, 0]).all()
    both = dataclasses.replace(lamp, two_sided=True)
    up, down = (0, 1.0, 0), (0, -1.0, 0)
    cases = [
        (lamp, _at([(0, 0, 0), (1, 1, 0)], up), frames.FACING | frames.NEAR),
        (lamp, _at([(0, 0, 0)], down), 0),
        (lamp, _at([(0, 5, 0)], down), 0),
        (both, _at([(0, 5, 0), (0, 4, 0)], down), frames.FACING | frames.NEAR | frames.BACK),
        (lamp, _at([(0, -20, 0), (0, 0, 0)], up), frames.FACING | frames.NEAR | frames.FAR),
        (lamp, _at([(0, 2, 0)], (1.0, 0, 0)), frames.FACING | frames.NEAR | frames.CLIPPED),
    ]
    for light, g, flags in cases:
        found = _run(runner, [light], 0, (8, 8), g)
        assert found.flags[0] == flags | frames.ON_SURFACE
    found = _run(runner, [lamp], 0, (8, 8), cases[0][1])
    # a runs along the first edge, (0, 0, −1) from z = 0.5; b along the second, (2, 0, 0) from x = −1
    assert_within(found.bounds["lo"][0], [0.5, 0.5, 2], 4 * ULP, "lo")
    assert_within(found.bounds["hi"][0], [0.5, 1, 3], 4 * ULP, "hi")
    found = _run(runner, [both], 0, (8, 8), cases[3][1])
    assert_within(found.bounds["hi"][0], [0.5, 0.5, 2], 4 * ULP, "h is turned to be positive")
    sides = _at([(0, 5, 0), (0, 0, 0)], up)
    sides.normal[::2] = sides.geometric[::2] = down
    found = _run(runner, [both], 0, (8, 8), sides)
    assert found.flags[0] == frames.FACING | frames.ON_SURFACE | frames.NEAR | frames.MIXED_SIDES
    assert_within(found.bounds["lo"][0, 2], -2, 4 * ULP, "h keeps its sign")


def test_a_spot_s_cone_and_distance(runner: Runner) -> None:
    spot = Spot(np.array([0, 2.0, 0]), np.array([0, -1.0, 0]), np.ones(3), float(np.cos(np.radians(45))))
    inside, outside = _at([(1.9, 0, 0)], (0, 1.0, 0)), _at([(2.1, 0, 0)], (0, 1.0, 0))
    far = frames.FACING | frames.ON_SURFACE | frames.FAR
    assert _run(runner, [spot], 0, (8, 8), inside).flags[0] == far
    found = _run(runner, [spot], 0, (8, 8), outside)
    assert found.flags[0] == frames.ON_SURFACE
    assert (found.pixels == frames.BEHIND_LIGHT).all()
