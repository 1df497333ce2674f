"""From fragments to pixels in float64: nearest, plain bilinear, and bilinear that keeps to its surface."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer
from .pyramids import Texels, depths, pixel_width, sizes
from .refining import CULLED
from .structs import SURFACE

Array = NDArray[np.float64]
MOST_OFF, MOST_TURNED = 0.25, 0.7


@dataclasses.dataclass
class Case:
    """Fragments of an image: `at` a texel 0, 1 + number or CULLED; `light` a fragment's irradiance (n, 3)."""

    view: NDArray[Any]
    g: GBuffer
    texels: Texels
    coarsest: int
    level_map: NDArray[Any]
    at: NDArray[np.uint32]
    light: Array

    @property
    def levels(self) -> list[tuple[int, int, int, int]]:
        """Columns, rows, first number and texels of each level."""
        return sizes(int(self.view["width"][0]), int(self.view["height"][0]))

    @property
    def shaded(self) -> NDArray[np.bool_]:
        """Pixels that belong to a fragment."""
        return (self.level_map < 254).ravel()

    def own(self, level: int) -> tuple[Array, NDArray[np.bool_]]:
        """Irradiance of the texels of a level that are fragments, (n, 3), and which texels have any."""
        _, _, first, count = self.levels[level]
        at = self.at[first : first + count]
        fragment = (at != 0) & (at != CULLED)
        light = np.zeros((count, 3))
        light[fragment] = self.light[at[fragment] - 1]
        return light, at != 0

    def corners(self, level: int) -> Iterator[tuple[NDArray[np.int64], Array, NDArray[np.int64]]]:
        """For each texel of `level` the four of the level above about it, with weights, 0 outside.

        And the texel of the same level that is next to it on that side.
        """
        columns, _, _, count = self.levels[level]
        wide, high, _, _ = self.levels[level + 1]
        row, column = np.divmod(np.arange(count), columns)
        # receivers lie half a pixel beyond the middle of their fragment: towards the pixels that is undone
        middle = 0.5 if level else 0.0
        y, x = (row + middle) / 2 - 0.5, (column + middle) / 2 - 0.5
        for down in (0, 1):
            for right in (0, 1):
                r, c = np.floor(y).astype(int) + down, np.floor(x).astype(int) + right
                weight = (1 - np.abs(y - r)) * (1 - np.abs(x - c))
                inside = (r >= 0) & (r < high) & (c >= 0) & (c < wide)
                near = (row + r - row // 2) * columns + column + c - column // 2
                yield (
                    np.where(inside, r * wide + c, 0),
                    np.where(inside, weight, 0.0),
                    np.where(inside, near, 0),
                )

    def part(self, values: Array, level: int) -> Array:
        """The rows of `values`, one a texel from level 1 on, that belong to a level."""
        _, _, first, count = self.levels[level]
        start = first - self.levels[1][2]
        return values[start : start + count]


def nearest(case: Case) -> Array:
    """Every pixel its fragment's irradiance."""
    out = np.zeros((len(case.g.kind), 3))
    width = case.levels[0][0]
    for pixel in np.flatnonzero(case.shaded):
        level = int(case.level_map.ravel()[pixel])
        row, column = divmod(int(pixel), width)
        columns, _, first, _ = case.levels[level]
        number = first + (row >> level) * columns + (column >> level)
        out[pixel] = case.light[case.at[number] - 1]
    return out


def bilinear(case: Case) -> Array:
    """Means of what is finer, then between the centres of the level above, whatever lies there."""
    values: list[tuple[Array, NDArray[np.bool_]]] = [case.own(0)]
    for level in range(1, case.coarsest + 1):
        light, has = case.own(level)
        below, has_below = values[-1]
        columns, _, _, count = case.levels[level - 1]
        row, column = np.divmod(np.arange(count), columns)
        parent = (row // 2) * case.levels[level][0] + column // 2
        total, number = np.zeros_like(light), np.zeros(len(light))
        np.add.at(total, parent[has_below], below[has_below])
        np.add.at(number, parent[has_below], 1)
        mean = total / np.maximum(number, 1)[:, None]
        values.append((np.where(has[:, None], light, mean), has | (number > 0)))
    for level in range(case.coarsest - 1, -1, -1):
        light, has = values[level]
        above, has_above = values[level + 1]
        total, weights = np.zeros_like(light), np.zeros(len(light))
        for texel, bare, _ in case.corners(level):
            weight = bare * has_above[texel]
            total += weight[:, None] * above[texel]
            weights += weight
        found = total / np.maximum(weights, 1e-30)[:, None]
        values[level] = np.where(has[:, None], light, found), has | (weights > 0)
    return np.where(case.shaded[:, None], values[0][0], 0)


def _unit(v: Array) -> Array:
    unit: Array = v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-6)
    return unit


def _fade(share: Array) -> Array:
    faded: Array = np.clip(1 - share**2, 0, None) ** 2
    return faded


def edge_aware(case: Case) -> Array:
    """Between texels that have light at their level, near the plane of what is lit and facing its way."""
    t, view = case.texels, case.view
    light, has = case.own(case.coarsest)
    for level in range(case.coarsest - 1, -1, -1):
        if level:
            p, n, g = (case.part(v, level) for v in (t.position, t.normal, t.geometric))
            n, g, seen = _unit(n), _unit(g), case.part(t.count, level) > 0
        else:
            p, n, g, seen = case.g.position, case.g.normal, case.g.geometric, case.g.kind == SURFACE
        q, m = (case.part(v, level + 1) for v in (t.position, t.normal))
        m, some = _unit(m), case.part(t.count, level + 1) > 0
        own, is_own = case.own(level)
        total, weights = np.zeros_like(own), np.zeros(len(own))
        for texel, bare, near in case.corners(level):
            # where the level above has no light, the neighbour of the same level stands in for it
            stands = ~has[texel] & (level > 0)
            side = np.where(stands, 2.0**level, 2.0 ** (level + 1))
            place = np.where(stands[:, None], p[near], q[texel])
            normal = np.where(stands[:, None], n[near], m[texel])
            seen_there = np.where(stands, seen[near], some[texel])
            has_light = np.where(stands, is_own[near], has[texel])
            off = np.abs((g * (place - p)).sum(1))
            width = side * pixel_width(view) * np.maximum(depths(view, place), 1e-30)
            alike = _fade(off / (MOST_OFF * width)) * _fade(np.linalg.norm(normal - n, axis=1) / MOST_TURNED)
            weight = bare * has_light * seen_there * alike
            total += weight[:, None] * np.where(stands[:, None], own[near], light[texel])
            weights += weight
        columns, _, _, count = case.levels[level]
        row, column = np.divmod(np.arange(count), columns)
        home = (row // 2) * case.levels[level + 1][0] + column // 2
        found = np.where((weights > 1e-12)[:, None], total / np.maximum(weights, 1e-30)[:, None], light[home])
        take = ~is_own & seen & has[home]
        light, has = np.where(take[:, None], found, own), is_own | take
    return np.where((case.g.kind == SURFACE)[:, None], light, 0)
