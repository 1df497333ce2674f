"""`share`: Σ w L v / Σ w L over the 64 quarters of a light's blocks [HHM18], and its standard error."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import cells as ref
from tests.passes.reference import shares, strata
from tests.passes.reference.cells import Layout
from tests.passes.reference.gbuffers import GBuffer, random_gbuffer
from tests.passes.reference.lights import Area, random_area, random_spot, table
from tests.passes.reference.polygons import parallelogram_irradiance
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIST, MISS, RECEIVER, SURFACE, record

STALE = 0.125
Array = NDArray[np.float64]
Bits = NDArray[np.bool_]


@dataclasses.dataclass
class Case:
    """A light in blocks of so many columns, a G-buffer, listed cells, and what is known in all cells."""

    light: Area
    across: int
    layout: Layout
    g: GBuffer
    cells: NDArray[np.int64]
    sure: Bits
    answer: Bits
    """Of blocks that are not sure: one answer is enough."""
    subs: NDArray[np.int64]
    brightness: NDArray[np.int64] | int = 1

    @property
    def pixels(self) -> NDArray[np.int64]:
        """Of the listed cells, (n, 2)."""
        return self.layout.corners(self.cells).reshape(-1, 2)

    def bindings(self, first: int) -> dict[str, NDArray[Any]]:
        """What both entries are given."""
        lights = [random_spot(np.random.default_rng(0)), self.light]
        return {
            "params": record(
                LIST,
                width=self.layout.width,
                height=self.layout.height,
                light=1,
                first=first,
                blocks_u=self.across,
                boosts=strata.boosts(self.brightness),
            ),
            "listed_cells": self.cells.astype(np.uint32),
            "cell_agreed": ref.pack(self.sure, self.answer),
            "lights": table(lights),
            "light_radiance": np.pad(
                shares.strata_radiance(self.light, self.across), ((0, 0), (0, 0), (0, 1))
            )
            .astype(np.float32)
            .reshape(256, 4),
            "share": np.full((self.layout.width * self.layout.height, 4), STALE, np.float32),
        }


def _case(rng: np.random.Generator, size: tuple[int, int], light: Area, across: int) -> Case:
    layout = Layout(*size)
    count = len(layout.order)
    inside = np.flatnonzero(layout.inside)
    cells = inside if len(inside) < 50 else inside[rng.uniform(size=len(inside)) < 0.6]
    sure = rng.uniform(size=(count, 16)) < rng.choice([0.0, 0.5, 0.9], (count, 1))
    answer = rng.uniform(size=(count, 16)) < 0.5
    g = random_gbuffer(rng, size[0] * size[1], surfaces=0.85)
    return Case(light, across, layout, g, cells, sure, answer, rng.choice([1, 4, 16], count))


def _light(rng: np.random.Generator, kind: str) -> Area:
    return random_area(rng, (5, 3) if kind == "picture" else None, two_sided=kind == "two-sided")


def _pixels(runner: Runner, case: Case, live: Bits, seen: Bits, first: int = 0) -> NDArray[np.float32]:
    """Shares of the image; `live`: which of the listed pixels are there, `seen`: their strata (n, 16, 16)."""
    at = case.layout.number(case.pixels)
    receivers = np.zeros(len(at), RECEIVER)
    receivers["pattern"] = np.where(live, 1, MISS)
    receivers["pixel"] = np.where(live, at, MISS)
    for name, of in (
        ("origin", case.g.origin),
        ("normal_shade", case.g.normal),
        ("normal_geo", case.g.geometric),
    ):
        receivers[name][live] = of[at[live]]
    plan = ref.PLAN_ZONE + ref.PLAN_TRACED + ref.PLAN_SUBS * case.subs + ref.PLAN_RADIUS
    out = runner(
        "passes/gather/share",
        len(at) - 4 * first,
        entry="pixels",
        receivers=receivers[4 * first :],
        visible=strata.words(seen)[4 * first :],
        cell_plan=plan.astype(np.uint32),
        **case.bindings(first),
    )
    return read(out, "share", np.float32, -1, 4)


def _cells(runner: Runner, case: Case, seen: Bits, asked: Bits, first: int = 0) -> NDArray[np.float32]:
    """Shares of the image, from what each of all cells sees of the blocks (n, 16) that it asked."""
    rows = case.g.rows()
    out = runner(
        "passes/gather/share",
        4 * (len(case.cells) - first),
        entry="cells",
        cell_bits=ref.pack(seen, asked),
        g_position=rows["g_position"],
        g_normal=rows["g_normal"],
        **case.bindings(first),
    )
    return read(out, "share", np.float32, -1, 4)


def _questions(case: Case) -> Bits:
    """What the listed pixels ask, (n, 16, 16)."""
    mine = np.repeat(case.cells, 4)
    return strata.by_plan(case.pixels, case.subs[mine], case.sure[mine], case.answer[mine], case.brightness)


def _compare(found: NDArray[np.float32], expected: shares.Share, least: float = 0.4) -> None:
    """Shares and errors, and that a comparison with others would fail."""
    sure = expected.rounding < 1e-3
    assert sure.mean() > least
    assert sure.any()
    bound = expected.rounding[sure]
    assert_within(found[sure, :3], expected.share[sure], bound[:, None], "shares")
    assert_within(found[sure, 3], expected.error[sure], 2 * bound + 1e-4 * expected.error[sure], "errors")
    assert_not_within(found[sure, :3], 0.99 * expected.share[sure], bound[:, None])


@pytest.mark.parametrize("size", [(61, 35), (1, 19)])
@pytest.mark.parametrize("across", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "picture"])
def test_shares_of_pixels_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], across: int, kind: str
) -> None:
    case = _case(rng, size, _light(rng, kind), across)
    case.brightness = rng.integers(0, 3, 16)
    at = case.layout.number(case.pixels)
    live = (at >= 0) & (case.g.kind[at] == SURFACE)
    asked = _questions(case)
    seen = asked & (rng.uniform(size=asked.shape) < rng.choice([0.0, 0.2, 0.7, 1.0], (len(asked), 16, 1)))
    first = 5 if size[0] > 50 else 0
    found = _pixels(runner, case, live, seen, first)
    live[: 4 * first] = False
    mine = np.repeat(case.cells, 4)
    sure, answer = case.sure[mine][..., None], case.answer[mine][..., None]
    answers = shares.visible_parts(np.where(sure, answer, seen), asked | sure)
    strata_of = shares.strata_radiance(case.light, across).astype(np.float32).astype(np.float64)
    g = case.g
    given = (a[live] for a in answers)
    expected = shares.share(
        case.light, across, g.origin[at[live]], g.normal[at[live]], tuple(given), strata_of
    )
    assert (np.delete(found, at[live], axis=0) == np.float32(STALE)).all(), "others keep what they have"
    _compare(found[at[live]], expected)


@pytest.mark.parametrize("size", [(61, 35), (1, 19)])
@pytest.mark.parametrize("across", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "picture"])
def test_shares_of_cells_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], across: int, kind: str
) -> None:
    """A block that the cell did not ask goes by the neighbours; if they do not agree it has no weight."""
    case = _case(rng, size, _light(rng, kind), across)
    count = len(case.layout.order)
    asked = rng.uniform(size=(count, 16)) < rng.choice([1.0, 0.7], (count, 1))
    asked[:, 0] = True
    # whoever asked is part of an agreement
    agree = np.logical_or(~case.sure, rng.uniform(size=(count, 16)) < 2)
    seen = asked & np.where(case.sure, case.answer, rng.uniform(size=(count, 16)) < 0.5) & agree
    first = 5 if size[0] > 50 else 0
    found = _cells(runner, case, seen, asked, first)
    at = case.layout.number(case.pixels)
    live = (at >= 0) & (case.g.kind[at] == SURFACE)
    live[: 4 * first] = False
    mine = np.repeat(case.cells, 4)[live]
    # one answer speaks for a block, sixteen for one that is agreed on
    one = np.zeros((len(mine), 16, 16), bool)
    one[..., 0] = asked[mine]
    sure = case.sure[mine][..., None]
    all_seen = np.where(sure, case.answer[mine][..., None], seen[mine][..., None])
    answers = shares.visible_parts(np.broadcast_to(all_seen, one.shape), one | sure)
    strata_of = shares.strata_radiance(case.light, across).astype(np.float32).astype(np.float64)
    position, normal = case.g.position[at[live]], case.g.normal[at[live]]
    expected = shares.share(case.light, across, position, normal, answers, strata_of)
    assert (np.delete(found, at[live], axis=0) == np.float32(STALE)).all()
    _compare(found[at[live]], expected)


def _above(rng: np.random.Generator, radiance: Array, across: int, subs: int, far: float = 1.0) -> Case:
    """A floor of 16 × 16 pixels under a lamp, all of whose cells are listed; nothing is agreed on."""
    light = Area(np.array([-0.5, 2, -0.5]) * far, np.array([1.0, 0, 0]), np.array([0, 0, 1.5]), radiance)
    layout = Layout(16, 16)
    places = rng.uniform(-1, 1, (256, 3)) * [1, 0, 1]
    up = np.tile(np.array([0, 1.0, 0]), (256, 1))
    places = places.astype(np.float32).astype(np.float64)
    g = GBuffer(places, np.zeros(256), up, up, np.full(256, SURFACE))
    blank = np.zeros((64, 16), bool)
    return Case(light, across, layout, g, np.arange(64), blank, blank, np.full(64, subs))


@pytest.mark.parametrize("entry", ["pixels", "cells"])
@pytest.mark.parametrize("subs", [1, 4, 16])
def test_the_share_is_1_where_all_is_seen_0_where_nothing_is_and_between_otherwise(
    runner: Runner, rng: np.random.Generator, entry: str, subs: int
) -> None:
    case = _above(rng, np.array([3.0, 1, 2]), 4, subs)
    asked, everything = _questions(case), np.ones((64, 16), bool)
    part = rng.uniform(size=asked.shape) < 0.5

    def run(seen: Bits) -> NDArray[np.float32]:
        if entry == "pixels":
            return _pixels(runner, case, np.ones(256, bool), asked & seen)
        return _cells(runner, case, seen[::4, :, 0], everything)

    assert_within(run(np.ones_like(asked))[:, :3], np.ones((256, 3)), 1e-6, "all")
    assert (run(np.zeros_like(asked))[:, :3] == 0).all()
    some = run(part)[:, :3]
    assert ((some > 0) & (some < 1)).all()
    assert_within(some, some[:, :1].repeat(3, axis=1), 1e-6, "a constant light has no colour of its own")
    rest = run(~part)[:, :3]
    assert_within(some + rest.astype(np.float64), np.ones((256, 3)), 2e-6, "a part and the rest")
    assert_not_within(some, np.ones((256, 3)), 1e-6)


@pytest.mark.parametrize("across", [2, 4, 8])
def test_the_share_of_a_half_goes_with_its_own_irradiance(
    runner: Runner, rng: np.random.Generator, across: int
) -> None:
    """A picture of a bright half and a dark one, each seen alone."""
    texels = np.ones((1, 2, 3))
    texels[0, 1] = [4, 2, 1]
    case = _above(rng, texels, across, 16)
    left = (np.arange(16) % across < across // 2)[:, None] & np.ones((256, 16, 16), bool)
    up = np.array([0, 1.0, 0])

    def irradiance(start: float, end: float, o: Array) -> float:
        corner = case.light.corner + start * case.light.u - o
        return parallelogram_irradiance(up, up, corner, (end - start) * case.light.u, case.light.v)

    halves = np.array([[irradiance(*ends, o) for ends in ((0, 0.5), (0.5, 1))] for o in case.g.position])
    for seen, half, colour in ((left, 0, texels[0, 0]), (~left, 1, texels[0, 1])):
        found = _pixels(runner, case, np.ones(256, bool), seen)
        at = case.layout.number(case.pixels)
        both = halves[at, 0, None] * texels[0, 0] + halves[at, 1, None] * texels[0, 1]
        expected = halves[at, half, None] * colour / both
        assert_within(found[at, :3], expected, 0.01 * expected, "shares")
        assert_not_within(found[at, :3], expected[:, ::-1], 0.01 * expected)


@pytest.mark.parametrize("subs", [1, 4])
def test_the_standard_error_is_that_of_the_share(runner: Runner, rng: np.random.Generator, subs: int) -> None:
    """Of strata that are seen by chance, with another chance for each block, over many draws."""
    case = _above(rng, np.ones(3), 4, subs, far=3.0)
    asked = _questions(case)
    spread, claimed = [], []
    for _ in range(20):
        chance = rng.uniform(size=(256, 16, 1))
        found = _pixels(runner, case, np.ones(256, bool), asked & (rng.uniform(size=asked.shape) < chance))
        at = case.layout.number(case.pixels)
        parts = np.broadcast_to(chance, (256, 16, 4))
        none = np.zeros((256, 16, 16), bool)
        answers = (parts, np.ones(parts.shape, bool), np.zeros((256, 16)), none, none[..., :4])
        lamp = shares.strata_radiance(case.light, 4)
        truth = shares.share(case.light, 4, case.g.origin[at], case.g.normal[at], answers, lamp).share
        spread.append((found[at, 0] - truth[:, 0]) ** 2)
        claimed.append(found[at, 3].astype(np.float64) ** 2)
    # 5120 draws know a variance to 2 %
    assert_within(np.mean(claimed), np.mean(spread), 0.08 * np.mean(spread), "variance")
    assert_not_within(np.mean(claimed), 1.3 * np.mean(spread), 0.08 * np.mean(spread))
