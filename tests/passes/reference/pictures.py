"""Textures and light pictures as functions of the plane, in float64, by tents and boxes of their texels."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def half(texels: NDArray[Any]) -> Array:
    """Texels as half floats hold them."""
    rounded: Array = np.asarray(texels, np.float16).astype(np.float64)
    return rounded


def pack_half(texels: NDArray[Any]) -> NDArray[np.uint32]:
    """(h, w, 3) texels as two words each: red and green as halves of the first, blue in the second."""
    bits = np.asarray(texels, np.float16).view(np.uint16).astype(np.uint32).reshape(-1, 3)
    return np.stack([bits[:, 0] | bits[:, 1] << np.uint32(16), bits[:, 2]], axis=-1)


def repeated(texels: NDArray[Any], uv: NDArray[Any]) -> Array:
    """Bilinear, repeating texture: texel (r, c) is the value at u = (c + 1/2)/w, v = 1 − (r + 1/2)/h.

    Between the centres each texel weighs by its tent, and the picture goes on periodically; `uv` (n, 2).
    """
    height, width = texels.shape[:2]
    places = np.asarray(uv, np.float64)
    places = places - np.floor(places)

    def tents(x: Array, count: int) -> Array:
        centres = np.arange(count) + 0.5
        images = [np.clip(1 - np.abs(x[:, None] - centres - k * count), 0, None) for k in (-1, 0, 1)]
        return np.sum(images, axis=0)

    columns = tents(places[:, 0] * width, width)
    rows = tents((1 - places[:, 1]) * height, height)
    value: Array = np.einsum("nr,nc,rck->nk", rows, columns, np.asarray(texels, np.float64))
    return value


def _hats(x: NDArray[Any], count: int) -> Array:
    """Weights of `count` texels at places x (in texels): linear between centres, constant beyond the last."""
    centres = np.arange(count) + 0.5
    return np.stack([np.interp(x, centres, unit) for unit in np.eye(count)], axis=-1)


def _boxes(x: NDArray[Any], count: int) -> Array:
    """Weights of `count` texels at places x (in texels): the texel in whose box x lies."""
    return np.eye(count)[np.clip(np.floor(x).astype(int), 0, count - 1)]


def emitted(texels: NDArray[Any], ab: NDArray[Any], linear: bool) -> Array:
    """Radiance of a light picture at (a, b): row 0 lies at b = 1, column 0 at a = 0; patches or linear."""
    height, width = texels.shape[:2]
    weights = _hats if linear else _boxes
    places = np.asarray(ab, np.float64)
    columns = weights(places[:, 0] * width, width)
    rows = weights((1 - places[:, 1]) * height, height)
    value: Array = np.einsum("nr,nc,rck->nk", rows, columns, np.asarray(texels, np.float64))
    return value


def _mean_weights(cells: int, count: int, linear: bool) -> Array:
    """Mean weight of each texel over each of `cells` equal parts of the picture's width, (cells, count)."""
    edges = np.arange(cells + 1) * count / cells
    # every place where the weights bend, or jump
    bends = np.arange(count) + 0.5 if linear else np.arange(1, count)
    means = np.zeros((cells, count))
    for cell, (lo, hi) in enumerate(itertools.pairwise(edges)):
        knots = np.concatenate([[lo], bends[(bends > lo) & (bends < hi)], [hi]])
        if linear:  # the trapezoid rule is exact between bends
            ends = _hats(knots, count)
            pieces = (ends[:-1] + ends[1:]) / 2
        else:
            pieces = _boxes((knots[:-1] + knots[1:]) / 2, count)
        means[cell] = (np.diff(knots)[:, None] * pieces).sum(axis=0) / (hi - lo)
    return means


def stratum_means(texels: NDArray[Any], strata_u: int, strata_v: int, linear: bool) -> Array:
    """Mean radiance of every stratum, (strata_v, strata_u, 3), row 0 at b = 0: the integral, not a sample."""
    height, width = texels.shape[:2]
    columns = _mean_weights(strata_u, width, linear)
    rows = _mean_weights(strata_v, height, linear)[::-1]  # the picture's row 0 lies at b = 1
    value: Array = np.einsum("vr,uc,rck->vuk", rows, columns, np.asarray(texels, np.float64))
    return value
