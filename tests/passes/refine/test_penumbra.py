"""`penumbra`: how wide it is at a cell in pixels, and what the cell does for that reason."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import cells as ref
from tests.passes.reference.cells import Layout
from tests.passes.reference.image import random_view
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import HIT, MISS, PENUMBRA, RAY, VIEW, record, row

SIZES = [(77, 45), (1, 19), (23, 1)]
LEVELS = {"untraced": 48.0, "one": 16.0, "four": 4.0, "narrow": 3.0, "wide": 20.0, "calm": 30.0}
Array = NDArray[np.float64]


def _zone(rng: np.random.Generator, layout: Layout, share: float) -> NDArray[np.int64]:
    inside = np.flatnonzero(layout.inside)
    return inside if len(inside) < 50 else inside[rng.uniform(size=len(inside)) < share]


def _widths(
    runner: Runner,
    layout: Layout,
    view: NDArray[Any],
    zone: NDArray[np.int64],
    rays: NDArray[Any],
    t: Array,
    geometric: Array,
    light_size: float,
    first: int = 0,
) -> NDArray[np.float32]:
    hits = np.zeros(len(rays), HIT)
    hits["t"], hits["instance"] = np.nan_to_num(t), np.where(np.isnan(t), MISS, 3)
    params = record(PENUMBRA, width=layout.width, height=layout.height, first=first, light_size=light_size)
    out = runner(
        "passes/refine/penumbra",
        len(rays),
        entry="widths",
        params=params,
        view=view,
        rays=rays,
        hits=hits,
        zone_cells=zone.astype(np.uint32),
        g_geometric=row(geometric, 0),
        cell_width=np.full(len(layout.order), -1, np.float32),
    )
    return read(out, "cell_width", np.float32)


def _plans(
    runner: Runner,
    layout: Layout,
    zone: NDArray[np.int64],
    width: Array,
    most_subs: int,
    before: NDArray[np.int64] | int = ref.PLAN_ZONE,
) -> NDArray[np.uint32]:
    out = runner(
        "passes/refine/penumbra",
        len(zone),
        entry="plans",
        params=record(PENUMBRA, width=layout.width, height=layout.height, most_subs=most_subs, **LEVELS),
        zone_cells=zone.astype(np.uint32),
        cell_width=width.astype(np.float32),
        cell_plan=np.broadcast_to(before, len(layout.order)).astype(np.uint32),
    )
    return read(out, "cell_plan", np.uint32)


@pytest.mark.parametrize("size", SIZES)
def test_widths_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    """Light's size times the ratio of the distances, over a pixel's size; its cosine is 0.05 or more."""
    layout = Layout(*size)
    view = random_view(rng, *size)
    zone = _zone(rng, layout, 0.4)
    first = len(zone) // 3
    rays = np.zeros(len(zone) - first, RAY)
    rays["origin"], rays["direction"] = rng.normal(size=(2, len(rays), 3)) * 4
    t = np.where(rng.uniform(size=len(rays)) < 0.9, rng.uniform(0.001, 0.999, len(rays)), np.nan)
    geometric = rng.normal(size=(size[0] * size[1], 3))
    geometric = (geometric / np.linalg.norm(geometric, axis=1, keepdims=True)).astype(np.float32)
    found = _widths(runner, layout, view, zone, rays, t, geometric, 0.7, first)
    mine = zone[first:]
    assert (np.delete(found, mine) == -1).all()
    normal = geometric[layout.number(layout.corners(mine)[:, 0])].astype(np.float64)
    to_eye = view["eye"][0].astype(np.float64) - rays["origin"]
    distance = np.linalg.norm(to_eye, axis=1)
    cosine = np.maximum(np.abs((normal * to_eye).sum(axis=1)) / distance, 0.05)
    pixel = distance / (max(view["fx"][0], view["fy"][0]) * cosine)
    to_occluder = np.linalg.norm(rays["direction"].astype(np.float64), axis=1) * t
    to_light = np.linalg.norm(rays["direction"].astype(np.float64), axis=1) * (1 - t)
    expected = np.nan_to_num(0.7 * to_occluder / to_light / pixel)
    bound = 1e-6 * expected * (1 + 1 / (1 - np.nan_to_num(t)) + 2 / cosine) + 1e-3 * (expected < 1e-3)
    assert_within(found[mine], expected, bound, "widths")
    assert ((found[mine] == 0) == np.isnan(t)).all(), "0 where it is not known, and only there"
    assert_not_within(found[mine], 1.01 * expected, bound)


def test_a_penumbra_by_hand(runner: Runner) -> None:
    """A light 2 wide at height 4, an edge at height 1: a penumbra 2/3 wide on the floor.

    Seen from 10 above a pixel is 10/100 wide there.
    """
    layout = Layout(8, 8)
    view = record(VIEW, eye=[0, 10, 0], width=8, height=8, fx=100, fy=80)
    rays = record(RAY, origin=[0, 0, 0], direction=[0, 4, 0], t_max=1)
    up = np.tile(np.array([0, 1.0, 0]), (64, 1))
    found = _widths(runner, layout, view, np.array([5]), rays, np.array([0.25]), up, 2.0)
    assert_within(found[5], 2 / 3 / 0.1, 1e-5)
    tilted = np.tile(np.array([0, 0.5, np.sqrt(0.75)]), (64, 1))
    half = _widths(runner, layout, view, np.array([5]), rays, np.array([0.25]), tilted, 2.0)
    assert_within(half[5], found[5] / 2, 1e-5, "a pixel covers twice as much of a surface at 60 degrees")
    assert_not_within(half[5], found[5], 1e-5)


def _expected(
    layout: Layout, width: Array, most_subs: int, calm: NDArray[np.bool_] | bool = False
) -> NDArray[np.int64]:
    """Plan of every cell, in image order, from the narrowest width of nine cells that is known, or else 0.

    Of calm cells in wide penumbrae no pixel asks for itself.
    """
    image = layout.image(width)
    beyond = np.where(image > 0, image, np.inf)
    padded = np.pad(beyond, 1, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    least = windows.min(axis=(-1, -2))
    least[np.isinf(least)] = 0
    subs = np.where(least >= LEVELS["one"], 1, np.where(least >= LEVELS["four"], 4, 16))
    radius = (least >= LEVELS["narrow"]).astype(int) + (least >= LEVELS["wide"])
    enough = (least >= LEVELS["untraced"]) | (calm & (least >= LEVELS["calm"]))
    traced = np.where(enough, 0, ref.PLAN_TRACED)
    return ref.PLAN_ZONE + traced + ref.PLAN_SUBS * np.minimum(subs, most_subs) + ref.PLAN_RADIUS * radius


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("most_subs", [1, 4, 16])
def test_plans_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], most_subs: int
) -> None:
    layout = Layout(*size)
    zone = _zone(rng, layout, 0.5)
    width = np.zeros(len(layout.order))
    scale = np.repeat(rng.choice([0.5, 3, 8, 30, 200], len(width) // 16), 16)[zone]
    width[zone] = scale * rng.uniform(0.5, 2, len(zone)) * (rng.uniform(size=len(zone)) < 0.7)
    width = width.astype(np.float32).astype(np.float64)
    calm = rng.uniform(size=len(width)) < 0.5
    before = ref.PLAN_ZONE + ref.PLAN_CALM * calm
    found = _plans(runner, layout, zone, width, most_subs, before)
    expected = layout.listed(_expected(layout, width, most_subs, layout.image(calm)))
    assert (found[zone] == expected[zone]).all()
    assert (np.delete(found, zone) == np.delete(before, zone)).all()
    if size[0] > 50:
        assert len(np.unique(expected[zone])) >= (4 if most_subs == 1 else 5)
        alone = np.where(width > 0, width, 1e9)
        assert not (found == layout.listed(_expected(layout, alone, most_subs, layout.image(calm)))).all()
        assert not (found == layout.listed(_expected(layout, width, most_subs))).all()


def test_where_no_width_is_known_everything_is_asked(runner: Runner) -> None:
    layout = Layout(16, 16)
    zone = np.arange(64)
    found = _plans(runner, layout, zone, np.zeros(64), 16)
    assert (found == ref.PLAN_ZONE + ref.PLAN_TRACED + 16 * ref.PLAN_SUBS).all()
    wide = _plans(runner, layout, zone, np.full(64, 500.0), 16)
    assert (wide == ref.PLAN_ZONE + ref.PLAN_SUBS + 2 * ref.PLAN_RADIUS).all()
    one_narrow = np.full(64, 500.0)
    one_narrow[37] = 1
    narrowed = layout.image(_plans(runner, layout, zone, one_narrow, 16) != wide)
    assert narrowed.sum() == 9, "it counts for its eight neighbours as well"
    assert ref.around(narrowed)[tuple(layout.order[37][::-1])].all()
