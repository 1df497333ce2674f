"""`interleaved`: light at nodes from the samples that they and their neighbours see [NPW10 Eq. 2; KH01]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gathering import Case, geometry_terms
from tests.passes.reference.lights import Area, Light, Spot, random_spot, single
from tests.passes.reference.nodes import Bits, Tree, alike, random_bits, random_tree
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import INTERLEAVED, record

STEM = "passes/gather/interleaved"
MOST_APART = 0.2
PATTERNS = 3
Array = NDArray[np.float64]


@dataclasses.dataclass
class Scene:
    """Nodes, one light with its samples (pattern by pattern, set by set), and what the nodes see."""

    tree: Tree
    light: Light
    points: Array
    radiance: Array
    bits: Bits | None
    classes: int

    @property
    def strata(self) -> int:
        """Samples that a node asks."""
        return self.points.shape[1] // self.classes

    @property
    def receivers(self) -> NDArray[Any]:
        """Shading points of all nodes."""
        return self.tree.receivers(PATTERNS, self.classes)


def scene(
    rng: np.random.Generator,
    strata: int,
    classes: int,
    kind: str = "one-sided",
    traced: bool = True,
    size: tuple[int, int] = (37, 21),
    split: float = 0.8,
) -> Scene:
    """Nodes on a bumpy surface, and a light beside the camera."""
    tree = random_tree(rng, size, 3, split=split)
    v = {name: tree.view[name][0].astype(np.float64) for name in ("eye", "right", "up", "backward")}
    corner = v["eye"] - 1.2 * v["backward"] + 0.8 * v["right"]
    everything = strata * classes
    light: Light = Area(
        corner, 0.7 * v["up"], 0.7 * v["right"] - 0.6 * v["backward"], np.ones(3), kind == "two-sided"
    )
    if isinstance(light, Area):
        points = single(light.point(rng.uniform(size=(PATTERNS, everything, 2))))
    radiance = single(rng.uniform(0.2, 2, (everything, 3)))
    if kind == "spot":
        axis = -v["backward"] - 0.4 * v["right"]
        light = dataclasses.replace(random_spot(rng), position=corner, axis=axis, cos_cutoff=0.93)
        points = np.broadcast_to(light.position, (PATTERNS, everything, 3))
    bits = random_bits(rng, tree, strata, noise=0.03) if traced else None
    return Scene(tree, light, np.asarray(points), radiance, bits, classes)


def _seen(bits: Bits, number: int) -> float:
    """How much of the samples that face a node it sees."""
    return bits.seen[number].sum() / max(bits.known[number].sum(), 1)


def shares(s: Scene, level: int) -> tuple[Array, NDArray[np.bool_]]:
    """Of every node of a level the share of each sample that is seen, set by set.

    And which nodes' neighbours are clearly on one side of an edge of a shadow or the other.
    """
    tree, receivers = s.tree, s.receivers
    count = tree.levels[level][1]
    found, clear = np.ones((count, s.classes, s.strata)), np.ones(count, bool)
    if s.bits is None:
        return found.reshape(count, -1), clear
    for i, (number, node) in enumerate(tree.of(level)):
        known, seen = np.zeros((2, s.classes, s.strata))
        for row in range(node.row - 1, node.row + 2):
            for column in range(node.column - 1, node.column + 2):
                other = tree.at.get((level, row, column))
                if other is None or not alike(receivers[number], receivers[other]):
                    continue
                own = _seen(s.bits, number)
                if other != number and (s.classes == 1 or (level > 0 and own in (0, 1))):
                    continue
                apart = abs(_seen(s.bits, other) - _seen(s.bits, number))
                clear[i] &= abs(apart - MOST_APART) > 1e-6
                if apart < MOST_APART:
                    which = tree.nodes[other].set if s.classes == 4 else 0
                    known[which] += s.bits.known[other]
                    seen[which] += s.bits.seen[other]
        mean = seen.sum(0) / np.maximum(known.sum(0), 1)
        found[i] = np.where(known > 0, seen / np.maximum(known, 1), mean)
    return found.reshape(count, -1), clear


def irradiance(s: Scene, level: int) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Σ_k v_k L_k cosθ_s cosθ_l / d² of every node of a level, what float32 may lose, and which are clear."""
    first, count = s.tree.levels[level]
    receivers = s.receivers[first : first + count]
    receivers["pattern"] //= s.classes
    terms, far = geometry_terms(s.light, Case(receivers, s.points, s.radiance, None))
    share, clear = shares(s, level)
    everything = s.points.shape[1]
    loss = (1 / far**2 * (1 + 10 / far)) @ s.radiance * (40 + everything / 8) * ULP
    return (terms * share) @ s.radiance, loss, clear


def gather(
    runner: Runner, s: Scene, level: int, before: NDArray[np.float32], grid: tuple[int, int] | None = None
) -> NDArray[np.float32]:
    """What the pass makes of the irradiance of all nodes.

    `grid`: columns and rows of strata whose middles the samples are; where they are is not looked up then.
    """
    more: dict[str, Any] = {}
    if grid is not None:
        assert isinstance(s.light, Area)
        along = [edge / count for edge, count in zip((s.light.u, s.light.v), grid, strict=True)]
        more = {"corner": s.light.corner, "step_u": along[0], "step_v": along[1], "row": grid[0] // 2}
    first, count = s.tree.levels[level]
    spot = isinstance(s.light, Spot)
    params = record(
        INTERLEAVED,
        first=first,
        strata=s.strata,
        words=0 if s.bits is None else -(-s.strata // 32),
        classes=s.classes,
        normal=s.light.axis if isinstance(s.light, Spot) else s.light.normal,
        cos_cutoff=s.light.cos_cutoff if isinstance(s.light, Spot) else -2,
        two_sided=spot or s.light.two_sided,
        **{"row": 1, **more},
    )
    points = np.full_like(s.points, 9) if grid else s.points
    out = runner(
        STEM,
        count,
        constants={"GRID": float(grid is not None)},
        params=params,
        pyramid=pyramid_record(s.tree.view, s.tree.coarsest, s.tree.finest, level),
        node_rows=s.tree.rows(),
        node_at=s.tree.at_words(),
        node_receivers=s.receivers,
        node_bits=np.zeros((2, 1), np.uint32) if s.bits is None else s.bits.words(),
        light_points=np.pad(points, ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        light_radiance=np.pad(s.radiance, ((0, 0), (0, 1))).astype(np.float32),
        node_irradiance=before,
    )
    return read(out, "node_irradiance", np.float32, *before.shape)


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "spot"])
@pytest.mark.parametrize("traced", [True, False])
@pytest.mark.parametrize(("strata", "classes"), [(1, 1), (64, 4), (9, 4), (70, 1), (33, 4)])
def test_irradiance_agrees_with_the_loops(
    runner: Runner, rng: np.random.Generator, kind: str, traced: bool, strata: int, classes: int
) -> None:
    s = scene(rng, strata, classes, kind, traced)
    lit = 0.0
    for level in range(3, -1, -1):
        first, count = s.tree.levels[level]
        before = rng.uniform(0, 1, (s.tree.end, 4)).astype(np.float32)
        found = gather(runner, s, level, before)
        own = np.s_[first : first + count]
        others = np.ones(s.tree.end, bool)
        others[own] = False
        assert (found[others] == before[others]).all(), "other levels are left alone"
        expected, bound, clear = irradiance(s, level)
        bound = bound + 2 * ULP * np.abs(found[own, :3])
        added = found[own, :3] - before[own, :3].astype(np.float64)
        assert clear.mean() > 0.9
        assert_within(added[clear], expected[clear], bound[clear], f"irradiance of level {level}")
        lit = max(lit, (expected.sum(axis=1) > 0).mean())
        assert_not_within(added[clear], expected[clear] * 1.001 + 1e-5, bound[clear])
    assert lit > 0.1, "some nodes are lit"


@pytest.mark.parametrize("kind", ["one-sided", "two-sided"])
@pytest.mark.parametrize("grid", [(8, 8), (4, 10), (16, 16)])
def test_middles_of_strata_need_no_table(
    runner: Runner, rng: np.random.Generator, kind: str, grid: tuple[int, int]
) -> None:
    """Samples of one pattern, in the middle of their strata, are where the light's edges say."""
    s = scene(rng, grid[0] * grid[1] // 4, 4, kind)
    assert isinstance(s.light, Area)
    rows, columns = np.divmod(np.arange(s.strata), grid[0] // 2)
    cells = [(2 * columns + set_ % 2, 2 * rows + set_ // 2) for set_ in range(4)]
    middles = np.concatenate([np.stack([(x + 0.5) / grid[0], (y + 0.5) / grid[1]], -1) for x, y in cells])
    s.points = s.light.point(np.broadcast_to(middles, (PATTERNS, *middles.shape)))
    for level in range(3, -1, -1):
        first, count = s.tree.levels[level]
        before = np.zeros((s.tree.end, 4), np.float32)
        found = gather(runner, s, level, before, grid)[first : first + count, :3]
        expected, bound, clear = irradiance(s, level)
        assert_within(found[clear], expected[clear], bound[clear], f"irradiance of level {level}")
        assert_not_within(found[clear], expected[clear] * 1.001 + 1e-5, bound[clear])
        s.points, kept = s.points[:, ::-1], s.points
        assert_not_within(found[clear], irradiance(s, level)[0][clear], bound[clear])
        s.points = kept


def test_what_is_shared_matters(runner: Runner, rng: np.random.Generator) -> None:
    """Negative control: with neighbours' bits, positions or sets exchanged the sums are others."""
    s = scene(rng, 32, 4)
    level = 1
    first, count = s.tree.levels[level]
    found = gather(runner, s, level, np.zeros((s.tree.end, 4), np.float32))[first : first + count, :3]
    expected, bound, clear = irradiance(s, level)
    assert s.bits is not None
    assert_within(found[clear], expected[clear], bound[clear])
    rolled = Bits(np.roll(s.bits.known, 1, 0), np.roll(s.bits.seen, 1, 0))
    swapped = s.points.reshape(PATTERNS, 4, 32, 3)[:, ::-1].reshape(s.points.shape)
    for spoilt in (
        dataclasses.replace(s, bits=rolled),
        dataclasses.replace(s, points=swapped),
        dataclasses.replace(s, radiance=s.radiance[::-1]),
        dataclasses.replace(s, bits=None),
    ):
        assert_not_within(found[clear], irradiance(spoilt, level)[0][clear], bound[clear])


def test_all_sets_count_alike(runner: Runner, rng: np.random.Generator) -> None:
    """Where the neighbours agree, interleaved samples give what all samples asked at each node give."""
    s = scene(rng, 16, 4)
    assert s.bits is not None
    s.bits = Bits(s.bits.known | True, s.bits.seen | True)
    bare = dataclasses.replace(s, bits=None)
    for level in range(3, -1, -1):
        first, count = s.tree.levels[level]
        before = np.zeros((s.tree.end, 4), np.float32)
        one, other = (gather(runner, each, level, before)[first : first + count] for each in (s, bare))
        assert_within(one, other, 4 * ULP * other, "irradiance")
        assert one.any()
