"""`sub_bits`: what sub-fragments and pixels ask of a light, and what is known then [KJ16 Sec. 3.1.2]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.lights import Area, Spot, single
from tests.passes.reference.nodes import (
    OPEN,
    ROUGH,
    SKIPS,
    Bits,
    Flags,
    pack,
    random_tree,
    unpack,
)
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import MISS, REUSE, record
from tests.passes.reference.sub_fragments import (
    SubBits,
    pixel_patterns,
    random_sub_bits,
    set_of,
    sub_receivers,
)
from tests.passes.visibility.test_reuse import Case, facing

STEM = "passes/visibility/sub_bits"
PATTERNS = 3
JUNK = 0xABCDABCD


def _case(
    rng: np.random.Generator, size: tuple[int, int], sets: int, samples: int, kind: str = "one-sided"
) -> Case:
    """A light that some of the surface faces; a row of points for each pattern and set, `samples` each."""
    tree = random_tree(rng, size, 3, split=0.8, again=True)
    v = {name: tree.view[name][0].astype(np.float64) for name in ("eye", "right", "up", "backward")}
    corner = v["eye"] - 1.8 * v["backward"] + 0.8 * v["right"]
    light: Area | Spot = Area(
        corner, 0.5 * v["up"], 0.5 * v["right"] - 0.6 * v["backward"], np.ones(3), kind == "two-sided"
    )
    if isinstance(light, Area):
        points = single(light.point(rng.uniform(size=(PATTERNS * sets, samples, 2))))
    if kind == "spot":
        light = Spot(corner, -v["backward"] - 0.4 * v["right"], np.ones(3), 0.93)
        points = np.broadcast_to(single(corner), (PATTERNS * sets, samples, 3))
    return Case(tree, light, np.asarray(points), Bits(np.zeros((1, 1), bool), np.zeros((1, 1), bool)))


def _params(case: Case, **more: Any) -> NDArray[Any]:
    light, spot = case.light, isinstance(case.light, Spot)
    axis = light.axis if isinstance(light, Spot) else light.normal
    return record(
        REUSE,
        light_normal=axis,
        two_sided=spot or light.two_sided,
        cone_axis=axis,
        cos_cutoff=light.cos_cutoff if isinstance(light, Spot) else -2,
        strata=case.strata,
        words=case.words,
        corner=light.position if isinstance(light, Spot) else light.corner,
        edge_u=np.zeros(3) if isinstance(light, Spot) else light.u,
        edge_v=np.zeros(3) if isinstance(light, Spot) else light.v,
        **more,
    )


def _points(case: Case) -> NDArray[np.float32]:
    return np.pad(case.points, ((0, 0), (0, 0), (0, 1))).astype(np.float32)


def _faces(case: Case, receivers: NDArray[Any]) -> Flags:
    """Samples that face each point; none of those that are no points."""
    there = receivers["pixel"] != MISS
    given = receivers.copy()
    given["pattern"][~there] = 0
    return facing(case, given) & there[:, None]


def _split(words: NDArray[np.uint32], samples: int) -> tuple[Flags, Flags]:
    half = words.shape[1] // 2
    return unpack(words[:, :half], samples), unpack(words[:, half:], samples)


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "spot"])
@pytest.mark.parametrize("samples", [16, 1, 40])
def test_points_ask_all_that_faces_them(
    runner: Runner, rng: np.random.Generator, samples: int, kind: str
) -> None:
    case = _case(rng, (70, 45), 4, samples, kind)
    receivers = sub_receivers(case.tree, 2, 4, True, pixel_patterns(case.tree, PATTERNS, 1))
    count = len(receivers)
    out = runner(
        STEM,
        count,
        entry="ask_all",
        params=_params(case),
        receivers=receivers,
        points=_points(case),
        bits=np.full((count, 2 * case.words), JUNK, np.uint32),
        asked=np.full((count, case.words), JUNK, np.uint32),
    )
    known, seen = _split(read(out, "bits", np.uint32, count, 2 * case.words), samples)
    expected = _faces(case, receivers)
    assert (known == expected).all()
    assert not seen.any()
    assert (unpack(read(out, "asked", np.uint32, count, case.words), samples) == expected).all()
    assert 0.01 < expected.mean() < 0.95
    assert (known != np.roll(expected, 1, 0)).any(), "negative control"


@dataclasses.dataclass
class Own:
    """What `ask_own` was given, and what it made of it."""

    given: SubBits
    receivers: NDArray[Any]
    known: Flags
    seen: Flags
    asked: Flags
    own: NDArray[Any]


def _ask_own(runner: Runner, case: Case, given: SubBits, level: int) -> Own:
    tree = case.tree
    first, count = tree.levels[level]
    receivers = sub_receivers(tree, level, 4, True, pixel_patterns(tree, PATTERNS, 1))
    out = runner(
        STEM,
        count,
        entry="ask_own",
        params=_params(case, first=first, classes=4, together=1),
        pyramid=pyramid_record(tree.view, 3, 0, level),
        node_rows=tree.rows(),
        receivers=receivers,
        own_receivers=np.zeros_like(receivers),
        points=_points(case),
        bits=given.words(),
        asked=np.full((4 * count, case.words), JUNK, np.uint32),
    )
    known, seen = _split(read(out, "bits", np.uint32, 4 * count, 2 * case.words), case.strata)
    asked = unpack(read(out, "asked", np.uint32, 4 * count, case.words), case.strata)
    return Own(given, receivers, known, seen, asked, read(out, "own_receivers", receivers.dtype))


@pytest.mark.parametrize("samples", [16, 40])
def test_nodes_in_doubt_ask_the_other_sets(runner: Runner, rng: np.random.Generator, samples: int) -> None:
    case = _case(rng, (70, 45), 4, samples)
    level, asks = 1, 0
    count = case.tree.levels[level][1]
    for number, node in case.tree.of(level):
        if number % 3 == 0:
            node.marks |= OPEN
    found = _ask_own(runner, case, random_sub_bits(rng, count, samples), level)
    known, seen = found.given.known.copy(), found.given.seen.copy()
    asked, own = np.zeros_like(known), found.receivers.copy()
    for i, (_, node) in enumerate(case.tree.of(level)):
        mixed = 0 < seen[i].sum() < known[i].sum()
        doubtful = not node.split and (mixed or bool(node.marks & OPEN))
        for part in range(4):
            at = 4 * i + part
            if own["pixel"][at] == MISS:
                continue
            own["pattern"][at] = int(own["pattern"][at]) + part - node.set
            if doubtful and part != node.set:
                asked[i, part] = known[i, part] = _faces(case, own[at : at + 1])[0]
                seen[i, part] = False
                asks += 1
    flat = (4 * count, samples)
    assert (found.asked == asked.reshape(flat)).all()
    assert (found.known == known.reshape(flat)).all()
    assert (found.seen == seen.reshape(flat)).all()
    assert (found.own["pattern"] == own["pattern"]).all()
    assert asks > 20
    assert (found.known != found.given.known.reshape(flat)).any(), "negative control: something was asked"


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize(("sets", "samples"), [(4, 16), (4, 9), (1, 64), (4, 40), (1, 1)])
def test_pixels_ask_what_was_not_asked_there(
    runner: Runner, rng: np.random.Generator, sets: int, samples: int, together: bool
) -> None:
    case = _case(rng, (37, 21), 1, sets * samples)
    tree = case.tree
    (first, count), (above, parents) = tree.levels[0], tree.levels[1]
    given = random_sub_bits(rng, parents, samples)
    receivers = tree.receivers(PATTERNS)
    out = runner(
        STEM,
        count,
        entry="ask_pixels",
        params=_params(case, first=first, above=above, reuse=1, classes=sets, together=together),
        pyramid=pyramid_record(tree.view, 3, 0, 0),
        node_rows=tree.rows(),
        receivers=receivers,
        points=_points(case),
        bits=np.full((count, 2 * case.words), JUNK, np.uint32),
        asked=np.full((tree.end, case.words), JUNK, np.uint32),
        sub_bits=given.words(),
    )
    known, seen = _split(read(out, "bits", np.uint32, count, 2 * case.words), case.strata)
    words = read(out, "asked", np.uint32, tree.end, case.words)
    face = _faces(case, receivers[first : first + count])
    carried, lit = (np.zeros((count, sets * samples), bool) for _ in range(2))
    for i, (_, node) in enumerate(tree.of(0)):
        parent = tree.nodes[node.parent]
        if not parent.rough & (ROUGH | SKIPS):
            start = samples * set_of(parent, node.part, sets, together)
            carried[i, start : start + samples] = True
            lit[i, start : start + samples] = given.seen[node.parent - above, node.part]
    assert (known == face).all()
    assert (unpack(words[first : first + count], case.strata) == (face & ~carried)).all()
    assert (words[:first] == JUNK).all()
    assert (seen == lit).all()
    assert carried.any()
    assert not carried.all(axis=1).all()
    assert lit.any()
    assert (seen != np.roll(lit, 1, 0)).any(), "negative control: another pixel's bits"


def test_without_a_level_above_pixels_ask_all(runner: Runner, rng: np.random.Generator) -> None:
    case = _case(rng, (24, 16), 1, 64)
    case.tree = random_tree(rng, (24, 16), 0)
    tree = case.tree
    first, count = tree.levels[0]
    out = runner(
        STEM,
        count,
        entry="ask_pixels",
        params=_params(case, first=first, classes=4, together=1),
        pyramid=pyramid_record(tree.view, 0, 0, 0),
        node_rows=tree.rows(),
        receivers=tree.receivers(PATTERNS),
        points=_points(case),
        bits=np.full((count, 4), JUNK, np.uint32),
        asked=np.full((tree.end, 2), JUNK, np.uint32),
        sub_bits=np.full(8, 0xFFFFFFFF, np.uint32),
    )
    face = _faces(case, tree.receivers(PATTERNS)[first : first + count])
    assert (unpack(read(out, "asked", np.uint32, tree.end, 2)[first:], 64)[:count] == face).all()
    assert not _split(read(out, "bits", np.uint32, count, 4), 64)[1].any()


def test_answers_are_added(runner: Runner, rng: np.random.Generator) -> None:
    before = random_sub_bits(rng, 30, 40)
    answers = rng.uniform(size=(130, 40)) < 0.3
    case = _case(rng, (8, 8), 1, 40)
    out = runner(
        STEM,
        120,
        entry="take",
        params=_params(case, first=10),
        bits=before.words(),
        asked=pack(answers),
    )
    known, seen = _split(read(out, "bits", np.uint32, 120, 4), 40)
    assert (known == before.known.reshape(120, 40)).all()
    assert (seen == (before.seen.reshape(120, 40) | answers[10:])).all()
    assert (seen != (before.seen.reshape(120, 40) | answers[:120])).any(), "negative control: others' answers"
