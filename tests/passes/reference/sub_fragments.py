"""Sub-fragments of nodes in plain loops: where they ask, what they see, and what that decides [KJ16]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .hashing import pcg4d
from .nodes import AGAIN, CHANGES, UNSTABLE, Flags, Node, Tree, Words, middle_pixel, pack
from .refining import LIT
from .structs import MISS, RECEIVER

CYCLE = (0, 1, 3, 2)
"""Sub-fragments one beside the next: left above, right above, right below, left below."""


def places(tree: Tree, node: Node) -> list[tuple[int, int] | None]:
    """Row and column of the four texels below a node; None where no light reaches, or outside."""
    rows, columns = tree.states[node.level - 1].shape
    all_ = [(2 * node.row + down, 2 * node.column + right) for down in (0, 1) for right in (0, 1)]
    lit = [r < rows and c < columns and bool(tree.states[node.level - 1][r, c] & LIT) for r, c in all_]
    return [place if counts else None for place, counts in zip(all_, lit, strict=True)]


def seen(tree: Tree, node: Node, part: int) -> bool:
    """Whether one of the four texels below a node sees a surface."""
    rows, columns = tree.states[node.level - 1].shape
    row, column = 2 * node.row + part // 2, 2 * node.column + part % 2
    return row < rows and column < columns and bool(tree.states[node.level - 1][row, column] & 7)


def set_of(node: Node, part: int, classes: int, together: bool) -> int:
    """Which of the interleaved sets a sub-fragment asks: that of its node, or its own."""
    return 0 if classes == 1 else node.set if together else part


def sub_receivers(tree: Tree, level: int, classes: int, together: bool, base: Words) -> NDArray[Any]:
    """Shading points of the sub-fragments of a level, four a node; `base`: the pattern of each node."""
    first, count = tree.levels[level]
    made = np.zeros(4 * count, RECEIVER)
    made["pattern"] = made["pixel"] = MISS
    for number, node in tree.of(level):
        for part, place in enumerate(places(tree, node)):
            at = 4 * (number - first) + part
            if place is None or node.split:
                made["flags"][at] = not node.split and seen(tree, node, part)
                continue
            pixel = middle_pixel(tree.view, tree.g, tree.block(level - 1, *place))
            made["origin"][at] = tree.g.origin[pixel]
            made["normal_geo"][at] = tree.g.geometric[pixel]
            made["normal_shade"][at] = tree.g.normal[pixel]
            made["pixel"][at] = pixel
            made["pattern"][at] = base[number] * classes + set_of(node, part, classes, together)
    return made


def pixel_patterns(tree: Tree, patterns: int, seed: int) -> Words:
    """The set of sample points of every node's pixel."""
    made = np.zeros(tree.end, np.uint32)
    for number, node in tree.nodes.items():
        row, column = divmod(node.pixel, tree.size[0])
        made[number] = pcg4d(np.array([column]), np.array([row]), seed, 1)[0, 0] % patterns
    return made


@dataclasses.dataclass
class SubBits:
    """Which samples face each of the four sub-fragments of a node, and which it sees: (nodes, 4, samples)."""

    known: Flags
    seen: Flags

    def words(self) -> Words:
        """Of each sub-fragment the words of samples that face it, then of those that it sees."""
        known, seen = (pack(flags.reshape(-1, flags.shape[-1])) for flags in (self.known, self.seen))
        return np.concatenate([known, seen], axis=1)


def random_sub_bits(rng: np.random.Generator, nodes: int, samples: int) -> SubBits:
    """Nodes that see all, nothing, the same part or different parts of a light; some samples face nobody."""
    known = rng.uniform(size=(nodes, 4, samples)) < rng.choice([0.7, 1.0, 1.0], (nodes, 1, 1))
    cut = rng.uniform(-0.5, 1.5, (nodes, 1, 1)) + rng.choice([0, 0, 0.02, 0.4], (nodes, 1, 1)) * rng.normal(
        size=(nodes, 4, 1)
    )
    return SubBits(known, known & ((np.arange(samples) + 0.5) / samples < cut))


def edges(bits: SubBits, counts: bool) -> NDArray[np.int64]:
    """Of every node what changes from each sub-fragment of the cycle to the next, (nodes, 4)."""
    found = []
    for one, other in zip(CYCLE, (*CYCLE[1:], CYCLE[0]), strict=True):
        both = bits.known[:, one] & bits.known[:, other]
        left, right = both & bits.seen[:, one], both & bits.seen[:, other]
        apart = np.abs(left.sum(1) - right.sum(1)) if counts else (left ^ right).sum(1)
        found.append(apart)
    return np.stack(found, 1)


def marks(bits: SubBits, least: int, most_apart: int, counts: bool, splits: bool) -> NDArray[np.int64]:
    """What a light's bits add to the state of every node."""
    some = (bits.known & bits.seen).any(1)
    not_all = (bits.known & ~bits.seen).any(1)
    changes = (some & not_all).sum(1) >= least
    made = np.where(changes & splits, CHANGES, 0)
    for flags, bit, counted in (
        (edges(bits, counts) > most_apart, AGAIN, changes & splits),
        (edges(bits, False) > 0, UNSTABLE, np.ones(len(made), bool)),
    ):
        for edge in range(4):
            for part in (CYCLE[edge], CYCLE[(edge + 1) % 4]):
                made |= np.where(flags[:, edge] & counted, bit << part, 0)
    return made


def sub_shares(bits: SubBits, classes: int) -> NDArray[np.float64]:
    """Share of each sample that is seen, set by set, (nodes, sets · samples).

    With four sets that of the sub-fragment whose set it is; of what does not face it, that of its stratum.
    """
    known, seen = bits.known.sum(1), bits.seen.sum(1)
    mean = seen / np.maximum(known, 1)
    if classes == 1:
        return mean
    own = np.where(bits.known, bits.seen, mean[:, None, :])
    return own.reshape(len(own), -1)
