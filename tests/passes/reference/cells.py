"""Cells of 2 × 2 pixels: where they are, what they know of a light, and which of them lie in a penumbra."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .image import TILE
from .strata import BLOCKS

NONE, LIT, DARK, ZONE = range(4)
PLAN_ZONE, PLAN_TRACED, PLAN_SUBS, PLAN_CALM, PLAN_RADIUS = 1, 2, 1 << 2, 1 << 7, 1 << 8
"""Bits of a plan; what its numbers are multiplied by."""

Array = NDArray[np.float64]
Bits = NDArray[np.bool_]
Words = NDArray[np.uint32]


@dataclasses.dataclass
class Layout:
    """Orders of the tiles, cells and pixels of an image."""

    width: int
    height: int

    @property
    def tiles(self) -> tuple[int, int]:
        """Tiles across and down."""
        return -(-self.width // TILE), -(-self.height // TILE)

    @property
    def cells(self) -> tuple[int, int]:
        """Cells across and down that hold a pixel."""
        return -(-self.width // 2), -(-self.height // 2)

    @property
    def order(self) -> NDArray[np.int64]:
        """(column, row) of all cells of all tiles, in the order of the tiles, (n, 2)."""
        across, down = self.tiles
        columns, rows = np.meshgrid(np.arange(4 * across), np.arange(4 * down))
        grid = np.stack([columns, rows], axis=-1).reshape(down, 4, across, 4, 2)
        return grid.transpose(0, 2, 1, 3, 4).reshape(-1, 2)

    @property
    def inside(self) -> Bits:
        """Which of the cells of `order` hold a pixel."""
        return np.all(self.order < self.cells, axis=1)

    def corners(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Pixels (..., 4, 2) of the cells with these numbers: left and right above, left and right below."""
        return self.order[cells][..., None, :] * 2 + np.array([(0, 0), (1, 0), (0, 1), (1, 1)])

    def number(self, pixels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number of pixels (..., 2), −1 outside of the image."""
        x, y = pixels[..., 0], pixels[..., 1]
        return np.where((x < self.width) & (y < self.height), y * self.width + x, -1)

    def image(self, listed: NDArray[Any]) -> NDArray[Any]:
        """From the order of the tiles to rows and columns of cells, those that hold a pixel."""
        across, down = self.tiles
        whole = np.zeros((4 * down, 4 * across, *listed.shape[1:]), listed.dtype)
        whole[self.order[:, 1], self.order[:, 0]] = listed
        return whole[: self.cells[1], : self.cells[0]]

    def listed(self, image: NDArray[Any]) -> NDArray[Any]:
        """The reverse of `image`, zeros where a cell holds no pixel."""
        across, down = self.tiles
        whole = np.zeros((4 * down, 4 * across, *image.shape[2:]), image.dtype)
        whole[: image.shape[0], : image.shape[1]] = image
        return whole[self.order[:, 1], self.order[:, 0]]


def pack(low: Bits, high: Bits) -> Words:
    """Words of sixteen bits each, (..., 16) and (..., 16)."""
    weights = 1 << np.arange(BLOCKS)
    return ((low * weights).sum(axis=-1) | (high * weights).sum(axis=-1) << 16).astype(np.uint32)


def unpack(words: Words) -> tuple[Bits, Bits]:
    """The reverse of `pack`."""
    bits = (np.asarray(words, np.int64)[..., None] >> np.arange(32)) & 1 == 1
    return bits[..., :16], bits[..., 16:]


def around(image: NDArray[Any], reach: int = 1) -> NDArray[Any]:
    """All values within `reach` rows and columns, zeros beyond the edge: (rows, columns, ..., n²)."""
    side = 2 * reach + 1
    padded = np.pad(image, [(reach, reach)] * 2 + [(0, 0)] * (image.ndim - 2))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side), axis=(0, 1))
    return windows.reshape(*image.shape, side * side)


@dataclasses.dataclass
class Votes:
    """What cells know of a light, in image order: state (r, c), and of the blocks (r, c, 16)."""

    state: NDArray[np.int64]
    sure: Bits
    """Agreed on, as those beside it on the light are."""
    answer: Bits
    """To what; of the blocks that are not sure: agreed on all the same."""
    calm: Bits
    """All around lie on one surface and CALM_BLOCKS at most are in doubt, (r, c)."""


FLAT, LEAST_COSINE = 0.2, 0.8
"""Limits of one surface."""
ENOUGH = 6
"""Cells on one surface, of nine, whose agreement counts."""
CALM_BLOCKS = 3
"""Blocks in doubt with which a cell needs no answers of its pixels."""


def on_one_surface(normal: Array, to: Array, other: Array) -> tuple[Bits, Bits]:
    """Whether places at `to` with normal `other` belong to a surface, and whether that is beyond doubt.

    They do within FLAT of its tangent plane, as a share of their distance, turned by LEAST_COSINE at most.
    """
    height, distance = (normal * to).sum(axis=-1), np.linalg.norm(to, axis=-1)
    out, cosine = np.abs(height) - FLAT * distance, (normal * other).sum(axis=-1)
    sure = ((np.abs(out) > 1e-4 * distance) | (distance == 0)) & (np.abs(cosine - LEAST_COSINE) > 1e-5)
    return (out <= 0) & (cosine >= LEAST_COSINE), sure


@dataclasses.dataclass
class Surfaces:
    """Mean place and normal of cells, and whether their pixels lie on one surface; any order."""

    position: Array
    normal: Array
    one: Bits

    def rows(self) -> NDArray[np.float32]:
        """Two rows a cell."""
        first = np.concatenate([self.position, self.one[..., None]], axis=-1)
        second = np.concatenate([self.normal, np.zeros((*self.one.shape, 1))], axis=-1)
        return np.stack([first, second], axis=-2).astype(np.float32)

    def alike(self, counted: Bits, proven: Bits) -> NDArray[np.int64]:
        """How many of the nine cells around each, in image order, lie on its surface or need not to."""
        p, n = (np.moveaxis(around(a), -1, 2) for a in (self.position, self.normal))
        same, _ = on_one_surface(self.normal[:, :, None], p - self.position[:, :, None], n)
        open_ones = around(counted & self.one) & self.one[..., None]
        return (around(proven) | (same & open_ones)).sum(axis=-1)


def zone(
    seen: Bits, asked: Bits, facing: Bits, proven: NDArray[np.int64], alike: NDArray[np.int64], across: int
) -> Votes:
    """What follows from what cells (r, c, 16) see of the blocks they asked.

    What is seen but was not asked, a cell is turned away from.
    `facing`: the tile faces the light; `proven`: LIT, DARK or NONE of the tile; `alike`: how many cells
    of nine lie on the same surface, (r, c) each. A block is agreed on when someone among a cell and its eight
    neighbours asked it and all that did say the same, if ENOUGH of them are alike; and sure, when the blocks
    beside it on the light, in a grid of `across` columns, are agreed on as well.
    """
    away = seen & ~asked & (proven == NONE)[..., None] & facing[..., None]
    asked = (asked | (proven != NONE)[..., None]) & facing[..., None]
    seen = np.where((proven != NONE)[..., None], (proven == LIT)[..., None], seen) & asked
    some, missing = around(seen).any(axis=-1), around(asked & ~seen).any(axis=-1)
    agreed = some != missing
    nowhere = around(away).any(axis=-1) & ~some & ~missing
    state = np.full(facing.shape, ZONE)
    settled = (agreed | nowhere).all(axis=-1)
    state[settled & ~some.any(axis=-1)] = DARK
    state[settled & ~missing.any(axis=-1)] = LIT
    state = np.where(proven != NONE, proven, state)
    state[~(asked | away).any(axis=-1)] = NONE
    voted = agreed & (alike >= ENOUGH)[..., None]
    light = (voted | nowhere).reshape(*agreed.shape[:2], BLOCKS // across, across)
    padded = np.pad(light, [(0, 0), (0, 0), (1, 1), (1, 1)], constant_values=True)
    cross = [(1, 1), (0, 1), (2, 1), (1, 0), (1, 2)]
    shifted = [padded[..., dv : dv + light.shape[2], du : du + across] for dv, du in cross]
    sure = voted & np.all(shifted, axis=0).reshape(agreed.shape)
    calm = (alike == 9) & ((~(agreed | nowhere)).sum(axis=-1) <= CALM_BLOCKS)
    return Votes(state, sure, np.where(sure, some, voted), calm)
