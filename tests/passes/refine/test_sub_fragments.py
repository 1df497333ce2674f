"""`sub_fragments`: where the four parts of a node ask, and what their bits split [KJ16 Sec. 3.1.2]."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.nodes import AGAIN, CHANGES, UNSTABLE, random_tree
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import ULP, Runner, assert_within, read
from tests.passes.reference.structs import MISS, RECEIVER, SUB_FRAGMENTS, record
from tests.passes.reference.sub_fragments import (
    SubBits,
    marks,
    pixel_patterns,
    random_sub_bits,
    sub_receivers,
)

STEM = "passes/refine/sub_fragments"
SIZES = [((37, 21), 3), ((70, 45), 4), ((1, 19), 5), ((23, 1), 2)]


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("classes", [1, 4])
@pytest.mark.parametrize(("size", "coarsest"), SIZES)
def test_shading_points_lie_in_the_four_texels_below(
    runner: Runner,
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    classes: int,
    together: bool,
) -> None:
    tree = random_tree(rng, size, coarsest, again=True)
    base = pixel_patterns(tree, 7, 3)
    receivers = tree.receivers()
    receivers["pattern"] = base
    asked = 0
    for level in range(coarsest, 0, -1):
        first, count = tree.levels[level]
        if not count:
            continue
        out = runner(
            STEM,
            4 * count,
            entry="points",
            params=record(SUB_FRAGMENTS, first=first, classes=classes, together=together),
            pyramid=pyramid_record(tree.view, coarsest, 0, level),
            texel_state=tree.state_words(),
            node_rows=tree.rows(),
            node_receivers=receivers,
            sub_receivers=np.full(4 * count, 7, RECEIVER),
            **tree.g.rows(),
        )
        found = read(out, "sub_receivers", RECEIVER)
        expected = sub_receivers(tree, level, classes, together, base)
        for name in ("normal_geo", "normal_shade", "pattern", "pixel", "flags"):
            assert (found[name] == expected[name]).all(), name
        origin = expected["origin"].astype(np.float64)
        assert_within(found["origin"], origin, 2 * ULP * np.abs(origin), "origins")
        asked += int((found["pixel"] != MISS).sum())
        if classes == 4 and count > 8:
            other = sub_receivers(tree, level, classes, not together, base)
            assert (found["pattern"] != other["pattern"]).any(), "negative control: the other sets"
    assert asked > 0


def _test(
    runner: Runner,
    bits: SubBits,
    least: int,
    most_apart: int,
    counts: bool,
    level: int = 2,
    there: NDArray[np.bool_] | None = None,
) -> NDArray[np.uint32]:
    """States of nodes after the test, which had a bit of their own before."""
    nodes, _, samples = bits.known.shape
    tree = random_tree(np.random.default_rng(0), (40, 24), 3, 1)
    rows = np.full((nodes + 5, 4), 1, np.uint32)
    receivers = np.zeros(4 * nodes, RECEIVER)
    if there is not None:
        receivers["pixel"][~there.ravel()] = MISS
        # some that are there are dark
        dark = np.flatnonzero(there.ravel() & ~bits.known.any(-1).ravel())[::2]
        receivers["pixel"][dark], receivers["flags"][dark] = MISS, 1
    out = runner(
        STEM,
        nodes,
        entry="test",
        params=record(
            SUB_FRAGMENTS,
            first=5,
            words=-(-samples // 32),
            least_bits=least,
            most_apart=most_apart,
            counts=counts,
            hard=there is not None,
        ),
        pyramid=pyramid_record(tree.view, 3, 1, level),
        node_rows=rows,
        sub_bits=bits.words(),
        sub_receivers=receivers,
    )
    found = read(out, "node_rows", np.uint32, nodes + 5, 4)
    assert (found[:5] == 1).all()
    assert (found[:, [0, 1, 3]] == 1).all()
    assert (found[5:, 2] & 1).all(), "what was known stays"
    return found[5:, 2] & ~np.uint32(1)


@pytest.mark.parametrize("counts", [False, True])
@pytest.mark.parametrize("samples", [16, 1, 40, 64])
@pytest.mark.parametrize(("least", "most_apart"), [(1, 4), (5, 0), (1, 0xFFFFFFFF), (0xFFFFFFFF, 4)])
def test_marks_agree_with_the_loops(
    runner: Runner, rng: np.random.Generator, samples: int, least: int, most_apart: int, counts: bool
) -> None:
    bits = random_sub_bits(rng, 300, samples)
    found = _test(runner, bits, least, most_apart, counts)
    assert (found == marks(bits, least, most_apart, counts, True)).all()
    assert ((found & CHANGES) != 0).any() == (least <= samples)
    assert (found != marks(bits, 1 if least > samples else least + 1, most_apart, counts, True)).any()
    if samples > 1 and least == 1 and most_apart == 4:
        turned = SubBits(bits.known[:, [1, 0, 2, 3]], bits.seen[:, [1, 0, 2, 3]])
        assert (found != marks(turned, least, most_apart, counts, True)).any(), "control: other edges"


def test_the_finest_level_is_never_split(runner: Runner, rng: np.random.Generator) -> None:
    bits = random_sub_bits(rng, 100, 16)
    found = _test(runner, bits, 1, 0, False, level=1)
    assert not (found & (CHANGES | 15 * AGAIN)).any()
    assert (found == marks(bits, 1, 0, False, False)).all()
    assert (found & (15 * UNSTABLE)).any()


def test_a_shadow_that_moves_shows_in_changes_and_not_in_counts(runner: Runner) -> None:
    """Half of the light is seen by all, but not the same half [KJ16: the text counts]."""
    known = np.ones((1, 4, 16), bool)
    seen = np.zeros((1, 4, 16), bool)
    seen[:, [0, 2], :8] = seen[:, [1, 3], 8:] = True
    bits = SubBits(known, seen)
    assert _test(runner, bits, 1, 4, False)[0] & (15 * AGAIN) == 15 * AGAIN
    assert _test(runner, bits, 1, 4, True)[0] == CHANGES | 15 * UNSTABLE


def test_a_step_between_two_sides_splits_both(runner: Runner) -> None:
    """One corner of four sees 5 of 16 less: it and those beside it are split again, not the one across."""
    seen = np.ones((4, 4, 16), bool)
    for part in range(4):
        seen[part, part, :5] = False
    found = _test(runner, SubBits(np.ones_like(seen), seen), 1, 4, False)
    across = {0: 3, 1: 2, 2: 1, 3: 0}
    for part, state in enumerate(found):
        assert state == CHANGES | (15 & ~(1 << across[part])) * (AGAIN | UNSTABLE)
    assert (_test(runner, SubBits(np.ones_like(seen), seen), 1, 5, False) & (15 * AGAIN) == 0).all()


def test_the_edge_of_a_cone_is_an_edge(runner: Runner, rng: np.random.Generator) -> None:
    """What a spot does not shine on sees nothing of it; of an area light the horizon is no edge."""
    inside = rng.uniform(size=(200, 4, 1)) < 0.5
    there = rng.uniform(size=(200, 4)) < 0.8
    bits = SubBits(inside & there[..., None], inside & there[..., None])
    found = _test(runner, bits, 1, 0, False, there=there)
    hard = SubBits(np.broadcast_to(there[..., None], inside.shape), bits.seen)
    assert (found == marks(hard, 1, 0, False, True)).all()
    assert (found & CHANGES).any()
    assert not _test(runner, bits, 1, 0, False).any(), "negative control"
