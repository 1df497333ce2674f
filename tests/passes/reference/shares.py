"""The visible share of a light, how sure it is, and its averages over neighbours on the same surface."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import LIT, NONE, ZONE, on_one_surface
from .lights import Area
from .pictures import stratum_means
from .strata import quarter

Array = NDArray[np.float64]
Bits = NDArray[np.bool_]
CROSSED = 1e-3
"""Weight of a quarter that the horizon crosses."""
ONE_ANSWER = 0.17
"""Variance of a single yes or no: about 1/6, the mean of p (1 − p) over all p."""


def quarter_places(across: int) -> Array:
    """(a, b) in the middle of quarter q of block k, (16, 4, 2): a grid of `across` columns of blocks."""
    block, q = np.arange(16)[:, None], np.arange(4)
    columns, rows = 2 * (block % across) + q % 2, 2 * (block // across) + q // 2
    return np.stack([(columns + 0.5) / (2 * across), (rows + 0.5) * across / 32], axis=-1)


def strata_radiance(light: Area, across: int) -> Array:
    """Mean radiance times area of the 256 strata, (16, 16, 3): by block, and row by row in it."""
    if light.radiance.ndim == 1:
        return np.tile(light.radiance, (16, 16, 1)) * light.area / 256
    means = stratum_means(light.radiance, 4 * across, 64 // across, light.linear)
    block, within = np.arange(16)[:, None], np.arange(16)
    rows, columns = 4 * (block // across) + within // 4, 4 * (block % across) + within % 4
    found: Array = means.reshape(64 // across, 4 * across, 3)[rows, columns] * light.area / 256
    return found


Answers = tuple[Array, Bits, Array, Bits, Bits]
"""Visible parts of quarters (..., 4), which are known, variance of a block, strata seen (..., 16), and of
which quarters all strata were asked."""


def visible_parts(seen: Bits, asked: Bits) -> Answers:
    """From answers (..., 16).

    A quarter that asked nothing goes by its whole block; a block that asked nothing is not known.
    """
    where = quarter(np.arange(16)) == np.arange(4)[:, None]
    own = (asked[..., None, :] & where).sum(axis=-1)
    hits = (seen[..., None, :] & asked[..., None, :] & where).sum(axis=-1)
    count, total = own.sum(axis=-1), hits.sum(axis=-1)
    whole = total / np.maximum(count, 1)
    parts = np.where(own > 0, hits / np.maximum(own, 1), whole[..., None])
    variance = np.where(count == 1, ONE_ANSWER, whole * (1 - whole) / np.maximum(count - 1, 1))
    known = np.broadcast_to(count[..., None] > 0, parts.shape)
    return parts, known, variance, seen & asked, own == 4


@dataclasses.dataclass
class Share:
    """Share (n, 3), its standard error (n,), and how far float32 may put the two off."""

    share: Array
    error: Array
    rounding: Array


def share(
    light: Area,
    across: int,
    origin: Array,
    normal: Array,
    answers: Answers,
    strata: Array,
) -> Share:
    """Part of a light that arrives at points (n, 3): Σ w L v / Σ w L with w = cos_s cos_l / d² [HHM18].

    `answers`: of `visible_parts` (n, 16, …); `strata`: of `strata_radiance`. Where all strata of a
    picture's quarter were asked, each counts with its own radiance. What is not known has no weight. Where
    nothing weighs anything all counts as seen.
    """
    parts, known, variance, seen, full = answers
    d = light.point(quarter_places(across)) - origin[:, None, None]
    d2 = (d * d).sum(axis=-1)
    height = (d * normal[:, None, None]).sum(axis=-1)
    weight = np.clip(height, 0, None) * np.abs(d @ light.normal) / d2**2 * known
    # a quarter that the horizon crosses hardly counts
    corners = np.array([[i, j] for i in (-1, 1) for j in (-1, 1)]) / np.array([4 * across, 64 // across])
    rim = light.point(quarter_places(across)[..., None, :] + corners) - origin[:, None, None, None]
    lowest = (rim * normal[:, None, None, None]).sum(axis=-1).min(axis=-1)
    weight = np.where(lowest >= 0, weight, CROSSED * weight)
    reach = np.linalg.norm(light.corner - origin, axis=1) + np.linalg.norm(light.u) + np.linalg.norm(light.v)
    # of the height by what cancels in it, of the distances to the fourth by theirs; cos_l d is common to all
    off = (
        2.0**-20
        * reach[:, None, None]
        * (1 + 4 * np.abs(height) / np.sqrt(d2))
        * np.abs(d @ light.normal)
        / d2**2
    )
    where = (quarter(np.arange(16)) == np.arange(4)[:, None]).astype(float)
    radiance = np.einsum("ksc,qs->kqc", strata, where)
    visible = parts[..., None] * radiance
    if light.radiance.ndim > 1:
        each = np.einsum("nks,ksc,qs->nkqc", seen.astype(float), strata, where)
        visible = np.where(full[..., None], each, visible)
    total = weight.sum(axis=(1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        lit = np.einsum("nkq,nkqc->nc", weight, visible)
        blocks = np.einsum("nkq,kqc->nkc", weight, radiance)
        whole = blocks.sum(axis=1)
        found = np.where(whole > 0, lit / whole, 1)
        error = (np.sqrt((blocks**2 * variance[..., None]).sum(axis=1)) / whole).max(axis=1)
        doubt = (np.einsum("nkq,kqc->nc", off * known, radiance) / whole).max(axis=1)
        doubt = np.maximum(doubt, (off * known).sum(axis=(1, 2)) / total)
    dark = total <= 0
    below = np.where(height.max(axis=(1, 2)) < -1e-4 * reach, 0, np.inf)
    return Share(found, np.where(dark, 0.0, error), np.where(dark, below, 1e-6 + 2 * doubt))


@dataclasses.dataclass
class Picture:
    """What smoothing looks at, in rows and columns of pixels."""

    position: Array
    geometric: Array
    surface: Bits
    """Something is there."""
    state: NDArray[np.int64]
    """Of the pixel's cell."""
    share: Array
    error: Array

    def shifted(self, dx: int, dy: int) -> tuple[dict[str, NDArray[Any]], Bits]:
        """What lies so many pixels to the right and below, and where that is inside of the image."""
        h, w = self.surface.shape
        y, x = np.meshgrid(np.arange(h) + dy, np.arange(w) + dx, indexing="ij")
        inside = (x >= 0) & (x < w) & (y >= 0) & (y < h)
        at = np.where(inside, y, 0), np.where(inside, x, 0)
        return {name: array[at] for name, array in vars(self).items()}, inside


def averaged(picture: Picture, taps: list[tuple[int, int, Array]]) -> tuple[Array, Bits]:
    """Average over neighbours of the same surface, (h, w, 3), and where no neighbour is a case of doubt.

    `taps`: offsets and weights (h, w). A neighbour counts with its own share in the zone, 1 where it is lit,
    0 where it is dark, and not at all where nothing faces the light.
    """
    total = np.zeros(picture.share.shape)
    weights = np.zeros((*picture.surface.shape, 1))
    clear = np.ones(picture.surface.shape, bool)
    for dx, dy, weight in taps:
        there, inside = picture.shifted(dx, dy)
        same, sure = on_one_surface(
            picture.geometric, there["position"] - picture.position, there["geometric"]
        )
        counts = inside & there["surface"] & (there["state"] != NONE)
        clear &= sure | ~counts | (weight == 0)
        value = np.where(
            (there["state"] == ZONE)[..., None], there["share"], 1.0 * (there["state"] == LIT)[..., None]
        )
        w = (weight * (counts & same))[..., None]
        total += w * value
        weights += w
    own = np.where(weights > 0, total / np.maximum(weights, 1e-30), picture.share)
    return own, clear


def pixel_taps(radius: NDArray[np.int64]) -> list[tuple[int, int, Array]]:
    """Of the filter over pixels with these radii (h, w): 1, 1 2 1, or 1 2 2 2 1 along either axis."""
    rows = np.array([[0, 0, 1, 0, 0], [0, 1, 2, 1, 0], [1, 2, 2, 2, 1]], float)
    offsets = range(-2, 3)
    return [(x, y, rows[radius, x + 2] * rows[radius, y + 2]) for x, y in itertools.product(offsets, offsets)]


def cell_taps(shape: tuple[int, int]) -> list[tuple[int, int, Array]]:
    """Of the filter over cells: 1 2 2 2 1 about the pixel's own place, linear between the cells' middles."""
    y, x = np.indices(shape)
    hat = np.array([0, 0, 1, 2, 2, 2, 1, 0, 0], float)

    def along(odd: NDArray[np.int64], d: int) -> Array:
        # the pixel lies a quarter of a cell off the middle of its own, to the left or to the right
        return 0.75 * hat[d + 4] + 0.25 * hat[d + 4 - (2 * odd - 1)]

    offsets = range(-3, 4)
    return [(2 * a, 2 * b, along(x % 2, a) * along(y % 2, b)) for a, b in itertools.product(offsets, offsets)]
