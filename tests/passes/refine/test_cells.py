"""`cells`: the answers of the cell rays, a bit for each block of strata that a cell asked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import strata
from tests.passes.reference.cells import Layout, on_one_surface, pack
from tests.passes.reference.gbuffers import random_gbuffer
from tests.passes.reference.lights import Area, random_area, random_spot, table
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIST, MISS, RECEIVER, record

STALE = 0x12345678
PATTERN = 3
Bits = NDArray[np.bool_]


def _lamp(rng: np.random.Generator, *, two_sided: bool = False) -> tuple[Area, NDArray[np.float64]]:
    """A light, and four patterns of 256 points on it."""
    light = random_area(rng, two_sided=two_sided)
    return light, light.point(rng.uniform(size=(4, 256, 2)))


def _run(
    runner: Runner,
    layout: Layout,
    tiles: NDArray[np.int64],
    first: int,
    receivers: NDArray[Any],
    visible: NDArray[np.uint32],
    entry: str,
    lamp: tuple[Area, NDArray[np.float64]],
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Bits of all cells, and the two rows about the surface of each."""
    across, down = layout.tiles
    light, points = lamp
    surface = {
        "cell_surface": np.full((32 * across * down, 4), STALE, np.float32),
        "light_points": np.pad(points.reshape(-1, 3), ((0, 0), (0, 1))).astype(np.float32),
        "lights": table([random_spot(np.random.default_rng(0)), light]),
    }
    out = runner(
        "passes/refine/cells",
        len(receivers) // 4,
        entry=entry,
        params=record(
            LIST, width=layout.width, height=layout.height, light=1, first=first, patterns=4, blocks_u=4
        ),
        receivers=receivers,
        visible=visible,
        open_tiles=tiles.astype(np.uint32),
        cell_bits=np.full(16 * across * down, STALE, np.uint32),
        **(surface if entry == "main" else {}),
    )
    rows = np.zeros(0, np.float32) if entry == "spot" else read(out, "cell_surface", np.float32, -1, 2, 4)
    return read(out, "cell_bits", np.uint32), rows


def _receivers(awake: Bits) -> NDArray[Any]:
    receivers = np.zeros(awake.size, RECEIVER)
    receivers["pattern"] = np.where(awake.ravel(), PATTERN, MISS)
    return receivers


def _list(
    rng: np.random.Generator, layout: Layout, first: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """A list of tiles, and the cells from its entry `first` on."""
    count = layout.tiles[0] * layout.tiles[1]
    tiles = np.flatnonzero(rng.uniform(size=count) < 0.7) if count > 4 else np.arange(count)
    return tiles, (16 * tiles[first:, None] + np.arange(16)).ravel()


@pytest.mark.parametrize(("size", "first"), [((77, 45), 0), ((77, 45), 5), ((1, 19), 1), ((23, 1), 0)])
def test_a_cell_gathers_its_pixels_answers(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], first: int
) -> None:
    layout = Layout(*size)
    tiles, cells = _list(rng, layout, first)
    awake = (layout.number(layout.corners(cells)) >= 0) & (rng.uniform(size=(len(cells), 4)) < 0.8)
    block = np.arange(16)
    which = strata.single(layout.order[cells][:, None], block)[..., None] == np.arange(16)
    mine = strata.asker(block) == np.arange(4)[:, None]
    asked = mine[None, ..., None] & which[:, None] & awake[..., None, None]
    seen = asked & (rng.uniform(size=asked.shape) < 0.5)
    lamp = _lamp(rng, two_sided=size[0] < 50)
    receivers = _receivers(awake)
    g = random_gbuffer(rng, awake.size)
    for name, of in (("origin", g.origin), ("normal_geo", g.geometric), ("normal_shade", g.normal)):
        receivers[name] = of
    d = lamp[1][PATTERN].reshape(16, 16, 3) - g.origin[:, None, None]
    faces = ((d @ g.geometric[:, None, :, None])[..., 0] > 0) & ((d @ g.normal[:, None, :, None])[..., 0] > 0)
    faces &= lamp[0].two_sided | (d @ lamp[0].normal < 0)
    faced = asked & faces.reshape(asked.shape)
    assert 0.02 < faced.sum() / asked.sum() < 0.98
    found, _ = _run(runner, layout, tiles, first, receivers, strata.words(seen), "main", lamp)
    expected = pack(seen.any(axis=(1, 3)), faced.any(axis=(1, 3)))
    assert (found[cells] == expected).all()
    assert (np.delete(found, cells) == STALE).all(), "other cells keep what they have"
    other, _ = _run(runner, layout, tiles, first, receivers, strata.words(asked & ~seen), "main", lamp)
    questions = pack(asked.any(axis=(1, 3)), asked.any(axis=(1, 3))) & 0xFFFF
    assert (other[cells] ^ found[cells] == questions).all(), "the other answers, the same questions"
    assert not (other[cells] == expected).all()


def test_a_cell_says_where_it_lies_and_whether_on_one_surface(
    runner: Runner, rng: np.random.Generator
) -> None:
    """Mean place and normal of the pixels that are there; one surface when all are, and in one plane."""
    layout = Layout(61, 43)
    tiles, cells = _list(rng, layout, 0)
    awake = (layout.number(layout.corners(cells)) >= 0) & (rng.uniform(size=(len(cells), 4)) < 0.95)
    g = random_gbuffer(rng, awake.size)
    plane = np.repeat(g.geometric[::4], 4, axis=0)
    across = rng.normal(size=g.position.shape)
    across -= plane * (across * plane).sum(axis=1, keepdims=True)
    bumps = np.repeat(rng.choice([0.0, 0.05, 0.3, 3.0], len(cells)), 4)[:, None]
    g.position = (
        np.repeat(g.position[::4], 4, axis=0) + across + bumps * rng.normal(size=(len(plane), 1)) * plane
    )
    turned = plane + np.repeat(rng.choice([0.05, 0.3, 1.0], len(cells)), 4)[:, None] * g.normal
    receivers = _receivers(awake)
    live = awake.ravel()
    receivers["origin"][live] = g.position[live]
    receivers["normal_geo"][live] = (turned / np.linalg.norm(turned, axis=1, keepdims=True))[live]
    _, rows = _run(
        runner, layout, tiles, 0, receivers, np.zeros((awake.size, 8), np.uint32), "main", _lamp(rng)
    )
    assert (np.delete(rows, cells, axis=0) == np.float32(STALE)).all()
    found = rows[cells].astype(np.float64)
    some, whole = awake.any(axis=1), awake.all(axis=1)
    places, normals = (
        receivers[name].astype(np.float64).reshape(-1, 4, 3) for name in ("origin", "normal_geo")
    )
    mean = places.sum(axis=1) / np.maximum(awake.sum(axis=1), 1)[:, None]
    normal = normals.sum(axis=1) / np.maximum(np.linalg.norm(normals.sum(axis=1), axis=1), 1e-9)[:, None]
    bound = 16 * ULP * np.abs(places).max(axis=(1, 2))[some, None]
    assert_within(found[some, 0, :3], mean[some], bound, "places")
    assert_within(found[some, 1, :3], normal[some], 1e-5, "normals")
    assert_not_within(found[some, 0, :3], places[some, 0], bound)
    same, sure = on_one_surface(normal[:, None], places - mean[:, None], normals)
    one = np.logical_and(whole, same.all(axis=1))
    clear = np.logical_or(~whole, sure.all(axis=1))
    assert ((found[:, 0, 3] != 0) == one)[clear].all()
    assert clear.mean() > 0.98
    assert 0.2 < one[whole].mean() < 0.8


@pytest.mark.parametrize(("size", "first"), [((77, 45), 3), ((1, 19), 0)])
def test_of_a_spot_there_is_a_bit_a_pixel(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], first: int
) -> None:
    layout = Layout(*size)
    tiles, cells = _list(rng, layout, first)
    awake = (layout.number(layout.corners(cells)) >= 0) & (rng.uniform(size=(len(cells), 4)) < 0.8)
    seen = awake & (rng.uniform(size=awake.shape) < 0.5)
    found, _ = _run(
        runner, layout, tiles, first, _receivers(awake), seen.astype(np.uint32).ravel(), "spot", _lamp(rng)
    )
    blank = np.zeros((len(cells), 12), bool)
    expected = pack(*(np.concatenate([bits, blank], axis=1) for bits in (seen, awake)))
    assert (found[cells] == expected).all()
    assert (np.delete(found, cells) == STALE).all()
    assert not (found[cells] == np.roll(expected, 1)).all()
