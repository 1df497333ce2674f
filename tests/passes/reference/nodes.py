"""Trees of nodes in plain loops: which texels are nodes, their shading points, their neighbours."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer, wavy_gbuffer
from .hashing import pcg4d
from .image import random_view
from .pyramids import sizes
from .refining import FACES_AWAY, LIES_BEHIND, LIT, ROUGH_DEPTH, ROUGH_NORMAL, texel_states
from .structs import RECEIVER, SURFACE

Words = NDArray[np.uint32]
Flags = NDArray[np.bool_]
DIFFERS, CHANGES = 32, 64
ROUGH = ROUGH_DEPTH | ROUGH_NORMAL
SKIPS, AGAIN, UNSTABLE, OPEN = 512, 1024, 1 << 14, 1 << 18
SPLIT = ROUGH | DIFFERS | CHANGES | SKIPS
NO_PARENT = 0xFFFFFFFF
ALIGN = 64
STEEPEST, MOST_TURNED = 0.5, 0.7


@dataclasses.dataclass
class Node:
    """A texel that is looked at: where it is, what is known of it, and which node was split for it."""

    level: int
    row: int
    column: int
    pixel: int
    rough: int
    parent: int = NO_PARENT
    marks: int = 0

    @property
    def part(self) -> int:
        """Which of the four below its parent it is."""
        return self.column % 2 + 2 * (self.row % 2)

    @property
    def split(self) -> bool:
        """Whether its children are looked at."""
        return bool((self.rough | self.marks) & SPLIT)

    @property
    def set(self) -> int:
        """Which of the 2 × 2 interleaved sets of samples it asks [NPW10 Sec. 3.3.2]."""
        return self.part


@dataclasses.dataclass
class Tree:
    """The nodes of an image by number, those of a texel, and first node and count of every level."""

    view: NDArray[Any]
    g: GBuffer
    states: list[NDArray[np.int64]]
    coarsest: int
    finest: int
    nodes: dict[int, Node] = dataclasses.field(default_factory=dict)
    at: dict[tuple[int, int, int], int] = dataclasses.field(default_factory=dict)
    levels: dict[int, tuple[int, int]] = dataclasses.field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image."""
        return int(self.view["width"][0]), int(self.view["height"][0])

    @property
    def end(self) -> int:
        """One past the last node."""
        return max(first + count for first, count in self.levels.values())

    def of(self, level: int) -> list[tuple[int, Node]]:
        """Numbers and nodes of a level."""
        first, count = self.levels[level]
        return [(number, self.nodes[number]) for number in range(first, first + count)]

    def state_words(self) -> Words:
        """What is known of every texel, level after level."""
        return np.concatenate([image.ravel() for image in self.states]).astype(np.uint32)

    def candidates(self, level: int) -> list[tuple[int, int, int]]:
        """Row, column and parent of what may be a node of a level, in the order in which they are listed.

        Of the coarsest level all texels, of the others four places for every node above, column by column.
        """
        if level == self.coarsest:
            rows, columns = self.states[level].shape
            return [(row, column, NO_PARENT) for row in range(rows) for column in range(columns)]
        return [
            (2 * node.row + down, 2 * node.column + right, number)
            for number, node in self.of(level + 1)
            for down in (0, 1)
            for right in (0, 1)
        ]

    def wanted(self, level: int) -> list[bool]:
        """Which candidates are nodes: some light may reach them, and what they are children of was split."""
        rows, columns = self.states[level].shape
        return [
            row < rows
            and column < columns
            and bool(self.states[level][row, column] & LIT)
            and (parent == NO_PARENT or self.nodes[parent].split)
            for row, column, parent in self.candidates(level)
        ]

    def add(self, level: int, first: int) -> None:
        """Add the nodes of a level, none of them marked."""
        made = [c for c, wanted in zip(self.candidates(level), self.wanted(level), strict=True) if wanted]
        for number, (row, column, parent) in enumerate(made, first):
            rough = int(self.states[level][row, column]) & ROUGH if level > self.finest else 0
            pixel = middle_pixel(self.view, self.g, self.block(level, row, column))
            self.nodes[number] = Node(level, row, column, pixel, rough, parent)
            again = parent != NO_PARENT and self.nodes[parent].marks & (AGAIN << self.nodes[number].part)
            if again and level > self.finest:
                self.nodes[number].rough |= SKIPS
            self.at[level, row, column] = number
        self.levels[level] = first, len(made)

    def block(self, level: int, row: int, column: int) -> NDArray[np.int64]:
        """Numbers of the pixels of a texel."""
        width, height = self.size
        numbers = np.arange(width * height).reshape(height, width)
        side = 2**level
        return numbers[row * side : (row + 1) * side, column * side : (column + 1) * side].ravel()

    def texel_number(self, level: int, row: int, column: int) -> int:
        """Flat number of a texel."""
        columns, _, first, _ = sizes(*self.size)[level]
        return first + row * columns + column

    def rows(self, down_to: int = 0, marks: bool = True) -> Words:
        """A row a node of the levels from the coarsest down to this one: texel, pixel, state, parent."""
        made = np.zeros((self.end, 4), np.uint32)
        for number, node in self.nodes.items():
            if node.level >= down_to:
                texel = self.texel_number(node.level, node.row, node.column)
                state = node.rough | (node.marks if marks else 0)
                made[number] = texel, node.pixel, state, node.parent
        return made

    def at_words(self, down_to: int = 0) -> Words:
        """1 + the node of every texel, or 0, of the levels from the coarsest down to this one."""
        made = np.zeros(sum(image.size for image in self.states), np.uint32)
        for (level, row, column), number in self.at.items():
            if level >= down_to:
                made[self.texel_number(level, row, column)] = number + 1
        return made

    def receivers(self, patterns: int = 1, classes: int = 1, seed: int = 0) -> NDArray[Any]:
        """Shading points; one set of samples for each pattern and class."""
        made = np.zeros(self.end, RECEIVER)
        numbers, nodes = list(self.nodes), list(self.nodes.values())
        pixels = np.array([node.pixel for node in nodes], np.int64)
        row, column = np.divmod(pixels, self.size[0])
        sets = np.array([node.set if classes == 4 else 0 for node in nodes])
        made["origin"][numbers] = self.g.origin[pixels]
        made["normal_geo"][numbers] = self.g.geometric[pixels]
        made["normal_shade"][numbers] = self.g.normal[pixels]
        made["pixel"][numbers] = pixels
        made["pattern"][numbers] = pcg4d(column, row, seed, 1)[:, 0] % patterns * classes + sets
        return made

    def node_above(self, level: int, row: int, column: int) -> int | None:
        """The node of a texel, or of the finest texel above it that has one."""
        for up in range(self.coarsest - level + 1):
            number = self.at.get((level + up, row >> up, column >> up))
            if number is not None:
                return number
        return None

    def neighbours(self, level: int, row: int, column: int) -> list[int | None]:
        """Nodes at the 3 × 3 texels about one, row by row; none outside of the image."""
        rows, columns = self.states[level].shape
        return [
            self.node_above(level, r, c) if 0 <= r < rows and 0 <= c < columns else None
            for r in range(row - 1, row + 2)
            for c in range(column - 1, column + 2)
        ]


def middle_pixel(view: NDArray[Any], g: GBuffer, block: NDArray[np.int64]) -> int:
    """The first surface pixel that is nearest to the middle of a block."""
    line, column = np.divmod(block, int(view["width"][0]))
    far = (2 * line - line.min() - line.max()) ** 2 + (2 * column - column.min() - column.max()) ** 2
    far = np.where(g.kind[block] == SURFACE, far, 1 << 30)
    middle = (line.min() + line.max() + 1) // 2, (column.min() + column.max() + 1) // 2
    chosen = block[np.argmin(far)]
    # of the four around the middle the last one is taken where it sees a surface
    at = block[(line == middle[0]) & (column == middle[1])][0]
    return int(at if g.kind[at] == SURFACE else chosen)


def alike(one: Any, other: Any) -> bool:
    """Whether two shading points lie on one surface: near the tangent plane of the first, facing one way."""
    step = other["origin"].astype(np.float64) - one["origin"]
    off = abs(one["normal_geo"].astype(np.float64) @ step)
    turned = np.linalg.norm(other["normal_shade"].astype(np.float64) - one["normal_shade"])
    return bool(off <= STEEPEST * np.linalg.norm(step) and turned < MOST_TURNED)


def random_tree(
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    finest: int = 0,
    split: float = 0.4,
    again: bool = False,
) -> Tree:
    """A bumpy surface, patches of it unlit, and nodes that are split at random; gaps between the levels.

    `again`: some are split together with sub-fragments of theirs.
    """
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=0.05, step=0.5)
    dark = rng.choice([LIT, LIT, LIT, FACES_AWAY, LIES_BEHIND], (size[1] // 5 + 1, size[0] // 5 + 1))
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    bits = np.where(g.kind == SURFACE, dark[row // 5, column // 5], 0)
    texels = sum(level[3] for level in sizes(*size)[1 : coarsest + 1])
    rough = rng.choice([0, 0, 0, 0, ROUGH_DEPTH, ROUGH_NORMAL, ROUGH], texels)
    tree = Tree(view, g, texel_states(view, g, bits, rough, coarsest), coarsest, finest)
    first = ALIGN
    for level in range(coarsest, finest - 1, -1):
        tree.add(level, first)
        for _, node in tree.of(level):
            if level > finest and not node.rough and rng.uniform() < split:
                node.marks = int(rng.choice([DIFFERS, CHANGES, DIFFERS | CHANGES]))
                node.marks |= int(rng.integers(0, 16)) * AGAIN if again else 0
        first = -(-tree.end // ALIGN) * ALIGN
    return tree


@dataclasses.dataclass
class Bits:
    """Which samples face every node, and which of these it sees; rows of nodes that know nothing are zero."""

    known: Flags
    seen: Flags

    def words(self) -> Words:
        """Of each node the words of samples that face it, then of those that it sees."""
        return np.concatenate([pack(self.known), pack(self.seen)], axis=1)


def pack(flags: Flags) -> Words:
    """Flags as words: bit k % 32 of word k / 32 is sample k."""
    padded = np.pad(flags, ((0, 0), (0, -flags.shape[1] % 32)))
    return np.packbits(padded, axis=1, bitorder="little").view("<u4")


def unpack(words: Words, strata: int) -> Flags:
    """The first `strata` flags of every row of words."""
    flags = np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=1, bitorder="little")
    return flags[:, :strata].astype(bool)


def random_bits(rng: np.random.Generator, tree: Tree, strata: int, noise: float = 0.05) -> Bits:
    """A shadow that moves over the light from left to right, seen by nodes that face most samples."""
    known = rng.uniform(size=(tree.end, strata)) < 0.9
    cut = np.zeros(tree.end)
    for number, node in tree.nodes.items():
        # most of the nodes see all or nothing
        cut[number] = 2.0 * (node.pixel % tree.size[0] + 0.5) / tree.size[0] - 0.5
    known &= np.isin(np.arange(tree.end), list(tree.nodes))[:, None]
    place = (np.arange(strata) + 0.5) / strata + noise * rng.normal(size=known.shape)
    return Bits(known, known & (place < cut[:, None]))


def in_doubt(bits: Bits, nodes: Sequence[int | None]) -> Flags:
    """Samples that some of these nodes see, and that are hidden from others."""
    there = [number for number in nodes if number is not None]
    known, seen = bits.known[there], bits.seen[there]
    return np.logical_and((known & seen).any(axis=0), (known & ~seen).any(axis=0))
