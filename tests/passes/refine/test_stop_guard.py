"""`stop_guard`: what is not proven of a tile splits the nodes that hold it, and marks those inside (N20)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.nodes import CHANGES, OPEN, Tree, random_tree
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import STOP_GUARD, record

STEM = "passes/refine/stop_guard"
FACING, PARTLY, PROVEN_LIT, PROVEN_DARK = 1, 128, 256, 512
TILE_LEVEL = 3


def _expected(tree: Tree, level: int, flags: NDArray[np.uint32], hard: bool) -> list[int]:
    """States of the nodes of a level."""
    states = []
    for _, node in tree.of(level):
        block = tree.block(level, node.row, node.column)
        line, column = np.divmod(block, tree.size[0])
        here = flags[line // 8, column // 8]
        is_open = ((here & FACING != 0) & (here & (PROVEN_LIT | PROVEN_DARK) == 0)).any()
        is_open |= hard and (here & PARTLY != 0).any()
        mark = CHANGES if level >= TILE_LEVEL and level > tree.finest else OPEN
        states.append(node.rough | node.marks | (mark if is_open and not node.split else 0))
    return states


@pytest.mark.parametrize("hard", [False, True])
@pytest.mark.parametrize(("size", "finest"), [((70, 45), 0), ((37, 21), 0), ((70, 45), 4), ((9, 1), 0)])
def test_what_is_not_proven_does_not_stop(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], finest: int, hard: bool
) -> None:
    tree = random_tree(rng, size, 5, finest, again=True)
    shape = -(-size[1] // 8), -(-size[0] // 8)
    flags = rng.choice([0, 1, 1 | 256, 1 | 512, 1 | 256 | 128], shape, p=[0.2, 0.1, 0.3, 0.3, 0.1]).astype(
        np.uint32
    )
    marked = 0
    for level in range(5, max(finest, 1) - 1, -1):
        first, count = tree.levels[level]
        if not count:
            continue
        rows = tree.rows()
        out = runner(
            STEM,
            count,
            params=record(STOP_GUARD, first=first, hard=hard),
            pyramid=pyramid_record(tree.view, 5, finest, level),
            node_rows=rows,
            tile_flags=flags,
        )
        found = read(out, "node_rows", np.uint32, *rows.shape)
        expected = _expected(tree, level, flags, hard)
        assert (found[first : first + count, 2] == expected).all()
        found[first : first + count, 2] = rows[first : first + count, 2]
        assert (found == rows).all(), "nothing else changes"
        marked += int((np.array(expected) != rows[first : first + count, 2]).sum())
        if size == (70, 45) and level in (1, 2):
            assert expected != _expected(tree, level, flags[::-1], hard), "negative control: other tiles"
    assert marked > 0 or size == (9, 1)
