"""`incremental`: which nodes are split for their light, and the fragments that follow [NPW10 Sec. 3.4]."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import pixel_numbers
from tests.passes.reference.nodes import (
    CHANGES,
    DIFFERS,
    ROUGH,
    Tree,
    alike,
    in_doubt,
    random_bits,
    random_tree,
)
from tests.passes.reference.pyramids import pyramid_record
from tests.passes.reference.refining import CULLED, FACES_AWAY, LIT, ROUGH_DEPTH, ROUGH_NORMAL
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import INCREMENTAL, NOTHING, SURFACE, record

STEM = "passes/refine/incremental"
LEAST_SHOWN = 2
CASES = [((37, 21), 3, 0), ((70, 45), 4, 1), ((1, 19), 3, 0), ((33, 18), 2, 0)]
MAP_CASES = [*CASES, ((23, 1), 4, 0), ((24, 16), 2, 2), ((1, 1), 5, 0), ((3, 50), 6, 1)]


def _given(tree: Tree, level: int, **params: Any) -> dict[str, NDArray[Any]]:
    """What every entry that works on a level reads."""
    first, count = tree.levels[level]
    return {
        "params": record(INCREMENTAL, first=first, count=count, **params),
        "pyramid": pyramid_record(tree.view, tree.coarsest, tree.finest, level),
        "node_at": tree.at_words(level),
    }


def _unmarked(tree: Tree, level: int) -> None:
    """Take the marks off the nodes of a level, which are what the pass is to find, and hide what is below."""
    for _, node in tree.of(level):
        node.marks = 0


def _marked(tree: Tree, rows: NDArray[np.uint32], numbers: Iterable[int], mark: int) -> NDArray[np.uint32]:
    """Rows with a mark at these nodes, unless their texel is rough."""
    made = rows.copy()
    clean = [number for number in numbers if not tree.nodes[number].rough]
    made[clean, 2] |= mark
    return made


def _light(rng: np.random.Generator, tree: Tree) -> NDArray[np.float32]:
    """Irradiance that grows slowly from left to right, with some noise."""
    light = np.zeros((tree.end, 4), np.float32)
    for number, node in tree.nodes.items():
        light[number, :3] = 1 + node.pixel % tree.size[0] / tree.size[0] + 0.05 * rng.uniform(size=3)
    return light


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1000])
def test_mean_of_the_coarsest_level(runner: Runner, rng: np.random.Generator, count: int) -> None:
    light = rng.uniform(0, 3, (count + 40, 4)).astype(np.float32)
    out = runner(
        STEM,
        1,
        entry="mean",
        groups=True,
        params=record(INCREMENTAL, first=30, count=count),
        node_irradiance=light,
        mean_irradiance=np.zeros((1, 4), np.float32),
    )
    found = read(out, "mean_irradiance", np.float32)[:3]
    mean = light[30 : 30 + count, :3].mean(axis=0, dtype=np.float64)
    assert_within(found, mean, 1e-6 * mean, "mean")
    assert_not_within(found, light[29 : 29 + count, :3].mean(axis=0, dtype=np.float64), 1e-6 * mean)


@pytest.mark.parametrize("strata", [1, 24, 64, 100])
@pytest.mark.parametrize(("size", "coarsest", "finest"), CASES)
def test_bits_in_doubt_split(
    runner: Runner,
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    finest: int,
    strata: int,
) -> None:
    tree = random_tree(rng, size, coarsest, finest)
    bits = random_bits(rng, tree, strata, noise=0.1)
    for level in range(coarsest, finest, -1):
        if not tree.levels[level][1]:
            continue
        _unmarked(tree, level)
        doubts = {
            number: int(in_doubt(bits, tree.neighbours(level, node.row, node.column)).sum())
            for number, node in tree.of(level)
        }
        least = max(int(np.median(list(doubts.values()))), 1)
        given = _given(tree, level, words=-(-strata // 32), least_bits=least)
        rows = tree.rows(level)
        out = runner(
            STEM, tree.levels[level][1], entry="bits", node_rows=rows, node_bits=bits.words(), **given
        )
        found = read(out, "node_rows", np.uint32, *rows.shape)

        chosen = [number for number, count in doubts.items() if count >= least]
        assert (found == _marked(tree, rows, chosen, CHANGES)).all()
        fewer = [number for number in chosen if doubts[number] > least or tree.nodes[number].rough]
        if len(fewer) < len(chosen):
            assert (found != _marked(tree, rows, fewer, CHANGES)).any(), "negative control: another threshold"


def _differing(tree: Tree, level: int, light: NDArray[np.float64], receivers: NDArray[Any]) -> Any:
    """Of every node of a level its largest difference to a neighbour, and how many beside it may be shown."""
    found = {}
    for number, node in tree.of(level):
        near = tree.neighbours(level, node.row, node.column)
        same = {k: n for k, n in enumerate(near) if n is not None and alike(receivers[number], receivers[n])}
        most = max(float(np.abs(light[n] - light[number]).sum()) for n in same.values())
        beside = [same[k] for k in (1, 3, 5, 7) if k in same]
        found[number] = most, sum(not tree.nodes[n].rough for n in beside)
    return found


@pytest.mark.parametrize(("size", "coarsest", "finest"), CASES)
def test_differences_of_irradiance_split(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, finest: int
) -> None:
    tree = random_tree(rng, size, coarsest, finest)
    light, receivers, mean = _light(rng, tree), tree.receivers(), np.array([[1.2, 1.0, 1.7, 1.0]], np.float32)
    reasons = set()
    for level in range(coarsest, finest, -1):
        if not tree.levels[level][1]:
            continue
        _unmarked(tree, level)
        found_of = _differing(tree, level, light[:, :3].astype(np.float64), receivers)
        values = np.unique([most for most, _ in found_of.values()])
        middle = len(values) // 2
        limit = float(values[middle - 1 : middle + 1].mean()) if len(values) > 1 else float(values[0]) + 1
        rows = tree.rows(level)
        out = runner(
            STEM,
            tree.levels[level][1],
            entry="differ",
            node_rows=rows,
            node_receivers=receivers,
            node_irradiance=light,
            mean_irradiance=mean,
            **_given(tree, level, threshold=limit / float(mean[0, :3].sum())),
        )
        found = read(out, "node_rows", np.uint32, *rows.shape)

        far = {number for number, (most, _) in found_of.items() if most > limit}
        bare = {number for number, (_, beside) in found_of.items() if beside < LEAST_SHOWN}
        assert (found == _marked(tree, rows, far | bare, DIFFERS)).all()
        for name, spoilt in (("limit", bare), ("shown", far)):
            reasons |= {name} if (found != _marked(tree, rows, spoilt, DIFFERS)).any() else set()
    assert reasons == {"limit", "shown"} or max(size) < 70, "negative control: each of the two splits some"


def _maps(tree: Tree) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.uint32]]:
    """Levels, reasons, and nodes of the texels that are fragments; culled ones are named as such."""
    width, height = tree.size
    levels, reasons = np.zeros((2, height, width), np.int64)
    at = np.zeros(sum(image.size for image in tree.states), np.uint32)
    kinds = tree.g.kind.reshape(height, width)
    for row in range(height):
        for column in range(width):
            level, above = tree.coarsest, 0
            while (number := tree.at.get((level, row >> level, column >> level))) is not None:
                node = tree.nodes[number]
                if level == tree.finest or not node.split:
                    break
                above, level = node.rough | node.marks, level - 1
            state = int(tree.states[level][row >> level, column >> level])
            order = ((ROUGH_DEPTH, 1), (ROUGH_NORMAL, 2), (DIFFERS, 3), (CHANGES, 4))
            reason = next((code for bit, code in order if above & bit), 0)
            if state:
                texel = tree.texel_number(level, row >> level, column >> level)
                at[texel] = number + 1 if state & LIT and number is not None else CULLED
            if kinds[row, column] != SURFACE:
                level, reason = (255, 255) if kinds[row, column] == NOTHING else (254, 6)
            elif not state & LIT:
                level, reason = 254, 7 if state & FACES_AWAY else 8
            levels[row, column], reasons[row, column] = level, reason
    return levels, reasons, at


@pytest.mark.parametrize(("size", "coarsest", "finest"), MAP_CASES)
def test_maps_and_fragments(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, finest: int
) -> None:
    tree = random_tree(rng, size, coarsest, finest)
    width, height = size
    places = len(pixel_numbers(width, height))
    out = runner(
        STEM,
        places,
        entry="choose",
        pyramid=pyramid_record(tree.view, coarsest, finest),
        node_rows=tree.rows(),
        node_at=tree.at_words(),
        texel_state=tree.state_words(),
        g_normal=tree.g.rows()["g_normal"],
        level_map=np.full(width * height, 77, np.uint32),
        reason_map=np.full(width * height, 77, np.uint32),
        fragment_at=np.zeros(sum(image.size for image in tree.states), np.uint32),
    )
    levels, reasons, at = _maps(tree)
    found = read(out, "level_map", np.uint32, height, width)
    assert (found == levels).all()
    assert (read(out, "reason_map", np.uint32, height, width) == reasons).all()
    assert (read(out, "fragment_at", np.uint32) == at).all()
    _partition(tree, found, read(out, "fragment_at", np.uint32))
    if width * height > 500 and coarsest > finest:
        assert set(np.unique(reasons)) >= {1, 2, 3, 4}
        split = next(node for node in tree.nodes.values() if node.split and not node.marks & ROUGH)
        split.marks = split.rough = 0
        assert (_maps(tree)[0] != found).any(), "negative control: another tree"


def _partition(tree: Tree, levels: NDArray[np.uint32], at: NDArray[np.uint32]) -> None:
    """Every shaded pixel lies in exactly one fragment, of the level that its map says."""
    owners = np.zeros(levels.size, int)
    for (level, row, column), number in tree.at.items():
        if at[tree.texel_number(level, row, column)] == number + 1:
            block = tree.block(level, row, column)
            owners[block] += 1
            assert np.isin(levels.ravel()[block], [level, 254, 255]).all()
    assert (owners[levels.ravel() < 254] == 1).all()
    assert (owners <= 1).all()
