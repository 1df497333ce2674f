"""`reuse`: bits on which the nodes of the level above agree are taken, others asked [NPW10 Sec. 3.3.2]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.lights import Area, Spot, single
from tests.passes.reference.nodes import (
    Bits,
    Flags,
    Node,
    Tree,
    alike,
    pack,
    random_bits,
    random_tree,
    unpack,
)
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import REUSE, record

STEM = "passes/visibility/reuse"
FAR_APART, THIN, MOST_IN_DOUBT = 2, 5, 8
CLASSES = 4


@dataclasses.dataclass
class Case:
    """A tree, a light with its sample points, and what the nodes found so far."""

    tree: Tree
    light: Area | Spot
    points: NDArray[np.float64]
    bits: Bits

    @property
    def strata(self) -> int:
        """Samples that a node asks."""
        return self.points.shape[1]

    @property
    def words(self) -> int:
        """Words of bits a node."""
        return -(-self.strata // 32)


def _case(
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    grid: tuple[int, int],
    kind: str = "one-sided",
) -> Case:
    """A light beside the camera, which some of the surface faces, and which shines on some of it."""
    tree = random_tree(rng, size, coarsest, split=0.8)
    v = {name: tree.view[name][0].astype(np.float64) for name in ("eye", "right", "up", "backward")}
    corner = v["eye"] - 1.8 * v["backward"] + 0.8 * v["right"]
    area = Area(
        corner, 0.5 * v["up"], 0.5 * v["right"] - 0.6 * v["backward"], np.ones(3), kind == "two-sided"
    )
    strata = grid[0] * grid[1]
    if kind == "spot":
        light: Area | Spot = Spot(corner, -v["backward"] - 0.4 * v["right"], np.ones(3), 0.93)
        points = np.broadcast_to(single(corner), (CLASSES, strata, 3))
    else:
        light, points = area, single(area.point(rng.uniform(size=(CLASSES, strata, 2))))
    return Case(tree, light, np.asarray(points), random_bits(rng, tree, strata, 0.01))


def facing(case: Case, receivers: NDArray[Any]) -> Flags:
    """Samples in front of both normals, to which the light emits, (n, strata)."""
    d = case.points[receivers["pattern"]] - receivers["origin"].astype(np.float64)[:, None]
    above = [
        (d * receivers[name].astype(np.float64)[:, None]).sum(-1) > 0
        for name in ("normal_geo", "normal_shade")
    ]
    if isinstance(case.light, Spot):
        emits = case.light.lights(-d / np.linalg.norm(d, axis=-1, keepdims=True))
    else:
        emits = case.light.cosine(-d) > 0
    found: Flags = above[0] & above[1] & emits
    return found


def agreed(bits: Bits, nodes: list[int], enough: int) -> tuple[Flags, Flags]:
    """Samples that all of these nodes see or are turned away from, and those that all find hidden.

    `enough` of them must have asked.
    """
    known, seen = bits.known[nodes], bits.seen[nodes]
    asked = known.sum(axis=0) >= enough
    return asked & (seen | ~known).all(axis=0), asked & ~(seen & known).any(axis=0)


def around(node: Node) -> set[int]:
    """Which of the 3 × 3 about a node's parent have middles that surround its own."""
    beside = [2 if at % 2 else 0 for at in (node.row, node.column)]
    return {3 * row + column for row in (1, beside[0]) for column in (1, beside[1])}


def expected(case: Case, level: int, reuse: bool = True) -> tuple[Flags, Flags, Flags]:
    """Which samples of each node of a level face it, are asked, and are known to be seen."""
    tree = case.tree
    first, count = tree.levels[level]
    receivers = tree.receivers(1, CLASSES)
    face = facing(case, receivers[first : first + count])
    ask, lit = face.copy(), np.zeros_like(face)
    if not reuse or level == tree.coarsest:
        return face, ask, lit
    for i, (number, node) in enumerate(tree.of(level)):
        if level + 1 == tree.coarsest and tree.nodes[node.parent].rough:
            continue  # across an edge the coarsest nodes may have missed a shadow
        near = tree.neighbours(level + 1, node.row // 2, node.column // 2)
        there = [k for k in range(9) if near[k] is not None]
        same = [k for k in there if k in around(node) and alike(receivers[number], receivers[near[k]])]
        known = np.zeros((2, case.strata), bool)
        for chosen in (there, same):
            known |= agreed(case.bits, [int(near[k] or 0) for k in chosen], min(level + 1, 3))
        doubt, hidden = face[i] & ~known.any(axis=0), face[i] & known[1]
        # a shadow that begins, or that of something thin
        many = level >= FAR_APART or THIN * doubt.sum() > face[i].sum()
        if doubt.sum() > MOST_IN_DOUBT * hidden.sum() and many:
            doubt = face[i]
        ask[i], lit[i] = doubt, face[i] & known[0] & ~doubt
    return face, ask, lit


def ask(runner: Runner, case: Case, level: int, reuse: bool = True) -> tuple[Flags, Flags, Flags]:
    """What the pass makes of it: facing, asked, seen."""
    tree, light = case.tree, case.light
    first, count = tree.levels[level]
    spot = isinstance(light, Spot)
    axis = light.axis if isinstance(light, Spot) else light.normal
    params = record(
        REUSE,
        light_normal=axis,
        two_sided=spot or light.two_sided,
        cone_axis=axis,
        cos_cutoff=light.cos_cutoff if isinstance(light, Spot) else -2,
        first=first,
        strata=case.strata,
        words=case.words,
        reuse=reuse,
        corner=light.position if isinstance(light, Spot) else light.corner,
        edge_u=np.zeros(3) if isinstance(light, Spot) else light.u,
        edge_v=np.zeros(3) if isinstance(light, Spot) else light.v,
    )
    known = case.bits.words()
    known[first:] = 0xABCDABCD
    out = runner(
        STEM,
        count,
        entry="ask",
        params=params,
        pyramid=pyramid_record(tree.view, tree.coarsest, tree.finest, level),
        node_rows=tree.rows(level),
        node_at=tree.at_words(level),
        node_receivers=tree.receivers(1, CLASSES),
        points=np.pad(case.points, ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        node_bits=known,
        asked=np.full((tree.end, case.words), 0xABCDABCD, np.uint32),
    )
    words = read(out, "node_bits", np.uint32, tree.end, 2 * case.words)
    asked = read(out, "asked", np.uint32, tree.end, case.words)
    own = np.s_[first : first + count]
    assert (words[:first] == known[:first]).all(), "levels above are left alone"
    assert (asked[:first] == 0xABCDABCD).all()
    return (
        unpack(words[own, : case.words], case.strata),
        unpack(asked[own], case.strata),
        unpack(words[own, case.words :], case.strata),
    )


GRIDS = [(8, 8), (1, 1), (5, 7), (40, 3), (32, 32), (4, 4)]


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize(("size", "coarsest"), [((37, 21), 4), ((70, 45), 3), ((1, 19), 3)])
def test_bits_agree_with_the_loops(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, grid: tuple[int, int]
) -> None:
    case = _case(rng, size, coarsest, grid)
    asked, lit, faced = 0, 0, 0
    for level in range(coarsest, -1, -1):
        if not case.tree.levels[level][1]:
            continue
        found, wanted = ask(runner, case, level), expected(case, level)
        for name, one, other in zip(("facing", "asked", "seen"), found, wanted, strict=True):
            assert (one == other).all(), f"{name} of level {level}"
        if level < coarsest:
            asked, lit, faced = asked + wanted[1].sum(), lit + wanted[2].sum(), faced + wanted[0].sum()
            other_bits = dataclasses.replace(case.bits, seen=case.bits.known & ~case.bits.seen)
            spoilt = expected(dataclasses.replace(case, bits=other_bits), level)
            assert (spoilt[2] != found[2]).any() or not wanted[2].any(), "negative control: other bits above"
    if min(size) > 1 and grid != (1, 1):
        assert 0.02 * faced < asked < 0.95 * faced, "some are asked"
        assert lit > 0.02 * faced, "some are taken over"


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "spot"])
def test_what_is_asked_faces_the_surface(runner: Runner, rng: np.random.Generator, kind: str) -> None:
    """Without reuse every sample that faces a node is asked, and none is known."""
    case = _case(rng, (37, 21), 2, (1, 1) if kind == "spot" else (8, 6), kind)
    for level, reuse in ((2, True), (1, False), (0, False)):
        face, asked, lit = ask(runner, case, level, reuse)
        wanted = expected(case, level, reuse)[0]
        assert (face == wanted).all()
        assert (asked == wanted).all()
        assert not lit.any()
        assert 0.05 < wanted.mean() < 0.95, "some face it, some do not"


def test_answers_are_added(runner: Runner, rng: np.random.Generator) -> None:
    """What the trace left of the asked ones is seen, beside what was known to be."""
    case = _case(rng, (37, 21), 2, (8, 5))
    level = 1
    first, count = case.tree.levels[level]
    words = case.bits.words()
    answers = rng.uniform(size=(case.tree.end, case.strata)) < 0.3
    out = runner(
        STEM,
        count,
        entry="answer",
        params=record(REUSE, first=first, strata=case.strata, words=case.words),
        node_bits=words,
        asked=pack(answers),
    )
    found = read(out, "node_bits", np.uint32, *words.shape)
    wanted = case.bits.seen.copy()
    wanted[first : first + count] |= answers[first : first + count]
    assert (found == Bits(case.bits.known, wanted).words()).all()
    assert (found != words).any(), "negative control"
