"""`sub_gather`: light of nodes by what their parts see, of pixels by what they see [NPW10 Eq. 2; KJ16]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.gather.test_interleaved import PATTERNS, Scene, scene
from tests.passes.reference.gathering import Case, geometry_terms, visibility_words
from tests.passes.reference.lights import Area, Spot
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import INTERLEAVED, record
from tests.passes.reference.sub_fragments import SubBits, random_sub_bits, sub_shares

STEM = "passes/gather/sub_gather"
Array = NDArray[np.float64]


def _params(s: Scene, first: int, words: int, grid: tuple[int, int] | None) -> NDArray[Any]:
    spot = isinstance(s.light, Spot)
    more: dict[str, Any] = {"row": 1}
    if grid is not None:
        assert isinstance(s.light, Area)
        along = [edge / count for edge, count in zip((s.light.u, s.light.v), grid, strict=True)]
        more = {"corner": s.light.corner, "step_u": along[0], "step_v": along[1], "row": grid[0] // 2}
    return record(
        INTERLEAVED,
        first=first,
        strata=s.strata,
        words=words,
        classes=s.classes,
        normal=s.light.axis if isinstance(s.light, Spot) else s.light.normal,
        cos_cutoff=s.light.cos_cutoff if isinstance(s.light, Spot) else -2,
        two_sided=spot or s.light.two_sided,
        **more,
    )


def _run(
    runner: Runner,
    s: Scene,
    level: int,
    words: NDArray[np.uint32] | None,
    grid: tuple[int, int] | None = None,
) -> Array:
    """What is added to the irradiance of each node of a level."""
    first, count = s.tree.levels[level]
    before = np.random.default_rng(3).uniform(0, 1, (s.tree.end, 4)).astype(np.float32)
    points = np.full_like(s.points, 9) if grid else s.points
    given = {} if level == 0 else {"node_rows": s.tree.rows()}
    out = runner(
        STEM,
        count,
        entry="pixels" if level == 0 else "subs",
        constants={"GRID": float(grid is not None)},
        params=_params(s, first, 0 if words is None else words.shape[1] // 2, grid),
        node_receivers=s.tree.receivers(PATTERNS),
        bits=np.zeros((1, 2), np.uint32) if words is None else words,
        light_points=np.pad(points, ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        light_radiance=np.pad(s.radiance, ((0, 0), (0, 1))).astype(np.float32),
        node_irradiance=before,
        **given,
    )
    after = read(out, "node_irradiance", np.float32, *before.shape)
    own = np.s_[first : first + count]
    others = np.ones(s.tree.end, bool)
    others[own] = False
    assert (after[others] == before[others]).all(), "other levels are left alone"
    assert (after[own, 3] == before[own, 3]).all()
    return after[own, :3] - before[own, :3].astype(np.float64)


def _expected(s: Scene, level: int, shares: Array) -> tuple[Array, Array]:
    """Σ_k v_k L_k cosθ_s cosθ_l / d² of every node of a level, and what float32 may lose."""
    first, count = s.tree.levels[level]
    receivers = s.tree.receivers(PATTERNS)[first : first + count]
    terms, far = geometry_terms(s.light, Case(receivers, s.points, s.radiance, None))
    loss = (1 / far**2 * (1 + 10 / far)) @ s.radiance * (40 + s.points.shape[1] / 8) * ULP
    split = np.array([node.split and level > 0 for _, node in s.tree.of(level)])
    return np.where(split[:, None], 0, (terms * shares) @ s.radiance), loss + 4 * ULP


def _simple(bits: SubBits, seen: NDArray[np.bool_]) -> None:
    """Let some nodes see all, and others nothing, of what faces them."""
    for k in range(len(seen)):
        if k % 3 < 2:
            bits.seen[k] = bits.known[k] & bool(k % 3)


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "spot"])
@pytest.mark.parametrize(("strata", "classes"), [(1, 1), (16, 4), (9, 4), (70, 1), (33, 4)])
def test_nodes_are_lit_by_what_their_parts_see(
    runner: Runner, rng: np.random.Generator, kind: str, strata: int, classes: int
) -> None:
    s = scene(rng, strata, classes, kind, traced=False, size=(70, 45), split=0.5)
    lit, differs = 0.0, False
    for level in (3, 2, 1):
        bits = random_sub_bits(rng, s.tree.levels[level][1], strata)
        _simple(bits, bits.seen)
        shares = sub_shares(bits, classes)
        # what sees all that faces it is lit by all samples, what sees nothing by none
        full = (bits.known == bits.seen).all((1, 2))
        shares[full] = 1
        expected, bound = _expected(s, level, shares)
        found = _run(runner, s, level, bits.words())
        assert_within(found, expected, bound, f"irradiance of level {level}")
        assert_not_within(found, expected * 1.001 + 1e-5, bound)
        lit = max(lit, (expected.sum(1) > 0).mean())
        turned = SubBits(bits.known[:, ::-1], bits.seen[:, ::-1])
        differs |= bool((abs(_run(runner, s, level, turned.words()) - expected) > bound).any())
    assert lit > 0.05
    assert differs == (classes == 4), "the parts ask sets of their own, if there are several"


@pytest.mark.parametrize("kind", ["one-sided", "spot"])
@pytest.mark.parametrize(("strata", "classes"), [(1, 1), (16, 4), (9, 4), (70, 1)])
def test_pixels_are_lit_by_what_they_see(
    runner: Runner, rng: np.random.Generator, kind: str, strata: int, classes: int
) -> None:
    s = scene(rng, strata, classes, kind, traced=False, size=(70, 45), split=0.5)
    seen = rng.uniform(size=(s.tree.levels[0][1], strata * classes)) < 0.5
    words = np.concatenate([visibility_words(rng.uniform(size=seen.shape) < 2), visibility_words(seen)], 1)
    expected, bound = _expected(s, 0, seen.astype(np.float64))
    found = _run(runner, s, 0, words)
    assert_within(found, expected, bound, "irradiance of pixels")
    assert_not_within(found, np.roll(expected, 1, 0), bound)


@pytest.mark.parametrize("level", [1, 0])
def test_without_bits_all_is_seen(runner: Runner, rng: np.random.Generator, level: int) -> None:
    s = scene(rng, 16, 4, traced=False, size=(70, 45), split=0.5)
    everything = np.ones((s.tree.levels[level][1], 64))
    expected, bound = _expected(s, level, everything)
    assert_within(_run(runner, s, level, None), expected, bound)
    assert (expected > 0).any()


@pytest.mark.parametrize("level", [1, 0])
@pytest.mark.parametrize("grid", [(8, 8), (4, 10), (16, 16)])
def test_middles_of_strata_need_no_table(
    runner: Runner, rng: np.random.Generator, grid: tuple[int, int], level: int
) -> None:
    s = scene(rng, grid[0] * grid[1] // 4, 4, traced=False, size=(70, 45), split=0.5)
    assert isinstance(s.light, Area)
    rows, columns = np.divmod(np.arange(s.strata), grid[0] // 2)
    cells = [(2 * columns + set_ % 2, 2 * rows + set_ // 2) for set_ in range(4)]
    middles = np.concatenate([np.stack([(x + 0.5) / grid[0], (y + 0.5) / grid[1]], -1) for x, y in cells])
    s.points = s.light.point(np.broadcast_to(middles, (PATTERNS, *middles.shape)))
    count = s.tree.levels[level][1]
    if level == 0:
        seen = rng.uniform(size=(count, 4 * s.strata)) < 0.5
        words = np.concatenate([visibility_words(np.ones_like(seen)), visibility_words(seen)], 1)
        shares = seen.astype(np.float64)
    else:
        bits = random_sub_bits(rng, count, s.strata)
        bits = dataclasses.replace(bits, known=np.ones_like(bits.known))
        words, shares = bits.words(), sub_shares(bits, 4)
    expected, bound = _expected(s, level, shares)
    found = _run(runner, s, level, words, grid)
    assert_within(found, expected, bound)
    s.points = s.points[:, ::-1]
    assert_not_within(found, _expected(s, level, shares)[0], bound)
