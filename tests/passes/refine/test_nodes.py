"""`nodes`: which texels of a level are looked at, and their shading points, against plain loops."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.nodes import SKIPS, Tree, random_tree
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import NODES, RECEIVER, record

STEM = "passes/refine/nodes"
PATTERNS, SEED = 64, 5
CASES = [
    ((37, 21), 3, 0),
    ((70, 45), 4, 0),
    ((33, 18), 4, 2),
    ((1, 19), 5, 0),
    ((23, 1), 2, 1),
    ((1, 1), 0, 0),
    ((24, 16), 2, 2),
]


def _params(tree: Tree, level: int, classes: int, inherit: bool = False) -> NDArray[Any]:
    base = tree.levels[level][0]
    parents = tree.levels[level + 1][0] if level < tree.coarsest else 0
    return record(
        NODES, base=base, parents=parents, patterns=PATTERNS, classes=classes, seed=SEED, inherit=inherit
    )


def _flags(runner: Runner, tree: Tree, level: int) -> NDArray[np.uint32]:
    """Which candidates of a level are nodes."""
    given = {
        "texel_state": tree.state_words(),
        "node_flags": np.full(len(tree.candidates(level)), 77, np.uint32),
        "pyramid": pyramid_record(tree.view, tree.coarsest, tree.finest, level),
    }
    if level < tree.coarsest:
        given |= {"params": _params(tree, level, 1), "node_rows": tree.rows(level + 1)}
    entry = "roots" if level == tree.coarsest else "children"
    return read(runner(STEM, len(given["node_flags"]), entry=entry, **given), "node_flags", np.uint32)


def _write(
    runner: Runner, tree: Tree, level: int, classes: int, above: NDArray[Any] | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[Any]]:
    """Rows, nodes of texels and shading points after this level, those above it given."""
    wanted = np.flatnonzero(tree.wanted(level)).astype(np.uint32)
    out = runner(
        STEM,
        len(wanted),
        params=_params(tree, level, classes, above is not None),
        pyramid=pyramid_record(tree.view, tree.coarsest, tree.finest, level),
        texel_state=tree.state_words(),
        node_list=wanted,
        node_rows=tree.rows(level + 1),
        node_at=tree.at_words(level + 1),
        node_receivers=np.zeros(tree.end, RECEIVER) if above is None else above,
        **tree.g.rows(),
    )
    rows = read(out, "node_rows", np.uint32, tree.end, 4)
    return rows, read(out, "node_at", np.uint32), read(out, "node_receivers", RECEIVER)


@pytest.mark.parametrize(("size", "coarsest", "finest"), CASES)
def test_nodes_are_what_light_may_reach_below_what_was_split(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, finest: int
) -> None:
    tree = random_tree(rng, size, coarsest, finest, again=True)
    for level in range(coarsest, finest - 1, -1):
        if not tree.candidates(level):
            continue
        found = _flags(runner, tree, level)
        assert (found == tree.wanted(level)).all()
        if level < coarsest and size[0] * size[1] > 500:
            number = next(
                n for n, node in tree.of(level + 1) if node.split and found[_children(tree, n)].any()
            )
            kept, tree.nodes[number] = (
                tree.nodes[number],
                dataclasses.replace(tree.nodes[number], marks=0, rough=0),
            )
            assert (found != tree.wanted(level)).any(), "negative control: another tree has other nodes"
            tree.nodes[number] = kept


def _children(tree: Tree, number: int) -> slice:
    """Places of a node's children among the candidates of its level."""
    first = 4 * (number - tree.levels[tree.nodes[number].level][0])
    return slice(first, first + 4)


@pytest.mark.parametrize("classes", [1, 4])
@pytest.mark.parametrize(("size", "coarsest", "finest"), CASES)
def test_rows_and_shading_points_of_nodes(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, finest: int, classes: int
) -> None:
    tree = random_tree(rng, size, coarsest, finest)
    expected = tree.receivers(PATTERNS, classes, SEED)
    for level in range(coarsest, finest - 1, -1):
        first, count = tree.levels[level]
        if not count:
            continue
        rows, at, receivers = _write(runner, tree, level, classes)
        assert (at == tree.at_words(level)).all()
        own, marked = np.s_[first : first + count], np.arange(tree.end) < first
        assert (rows[own] == tree.rows(level, marks=False)[own]).all()
        assert (rows[marked] == tree.rows(level)[marked]).all(), "levels above are left alone"
        for name in ("normal_geo", "normal_shade", "pattern", "pixel", "flags"):
            assert (receivers[own][name] == expected[own][name]).all(), name
        origin = expected[own]["origin"].astype(np.float64)
        assert_within(receivers[own]["origin"], origin, 2 * ULP * np.abs(origin), "origins")
        if count > 1:
            assert_not_within(receivers[own]["origin"], np.roll(origin, 1, 0), 2 * ULP * np.abs(origin))
            assert (rows[own] != np.roll(tree.rows(level), 1, 0)[own]).any()
        assert set(receivers[own]["pattern"] % classes) <= set(range(classes))


def test_what_is_split_again_is_split_with_its_parent(runner: Runner, rng: np.random.Generator) -> None:
    tree = random_tree(rng, (70, 45), 4, again=True)
    skipped = 0
    for level in range(4, -1, -1):
        first, count = tree.levels[level]
        rows = _write(runner, tree, level, 1)[0][first : first + count]
        assert (rows == tree.rows(level, marks=False)[first : first + count]).all()
        skips = [bool(row[2] & SKIPS) for row in rows]
        assert level > 0 or not any(skips), "there is nothing below pixels"
        skipped += sum(skips)
        if any(skips):
            tree.nodes[first + skips.index(True)].rough ^= SKIPS
            assert (rows != tree.rows(level, marks=False)[first : first + count]).any(), "negative control"
            tree.nodes[first + skips.index(True)].rough ^= SKIPS
    assert skipped > 20


def test_pixels_use_the_points_of_the_node_above(runner: Runner, rng: np.random.Generator) -> None:
    tree = random_tree(rng, (33, 18), 2)
    above = np.zeros(tree.end, RECEIVER)
    above["pattern"] = 1000 + np.arange(tree.end)
    for level in (1, 0):
        own = np.arange(tree.levels[level][0], sum(tree.levels[level]))
        patterns = _write(runner, tree, level, 1, above)[2]["pattern"][own]
        parents = np.array([tree.nodes[number].parent for number in own.tolist()])
        assert (patterns == 1000 + parents).all() == (level == 0)


def test_two_by_two_neighbours_ask_all_four_sets(runner: Runner, rng: np.random.Generator) -> None:
    tree = random_tree(rng, (64, 40), 3)
    level = 3
    _, at, receivers = _write(runner, tree, level, 4)
    first = tree.texel_number(level, 0, 0)
    nodes = at[first : first + 40].reshape(5, 8).astype(int)
    sets = np.where(nodes > 0, receivers["pattern"][nodes - 1].astype(int) % 4, -1)
    whole = 0
    for row in range(4):
        for column in range(7):
            four = sets[row : row + 2, column : column + 2]
            whole += int((four >= 0).all())
            assert len(set(four[four >= 0])) == (four >= 0).sum(), "no two of them ask the same"
    assert whole > 10
