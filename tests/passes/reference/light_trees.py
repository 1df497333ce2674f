"""The tree over the texels of reflective shadow maps in float64, level by level from its equations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rsm import FAR, LEAST_COSINE
from .virtual_lights import WIDE, Array

Nodes = NDArray[Any]
MOST_TILT = 0.5
CANCELS = 1e-6
"""Length that a mean of unit normals has no direction below."""


def morton(resolution: int) -> NDArray[np.int64]:
    """Column and row of each number, (resolution², 2): bit after bit, columns have the even ones."""
    number, at = np.arange(resolution**2), np.zeros((resolution**2, 2), np.int64)
    for bit in range(resolution.bit_length() - 1):
        at[:, 0] += (number >> 2 * bit & 1) << bit
        at[:, 1] += (number >> 2 * bit + 1 & 1) << bit
    return at


def _leaves(texels: Array, tiles: int) -> tuple[Nodes, Array]:
    """Nodes and ranges of the texels (maps, row, column, 3, 4), in order."""
    maps, resolution = texels.shape[:2]
    at = morton(resolution)
    t = texels[:, at[:, 1], at[:, 0]]
    nodes, ranges = np.zeros(t.shape[:2], WIDE), np.zeros((*t.shape[:2], 2, 4))
    lit = t[..., 2, :3].sum(-1) > 0
    nodes["solid_angle"] = t[..., 1, 3]
    nodes["block"] = at[:, 0] | at[:, 1] << 16
    nodes["extent"] = 1 | np.arange(maps)[:, None] << 16
    nodes["normal"] = np.where(lit[..., None], t[..., 1, :3], (0, 0, 1))
    nodes["position"], nodes["flux"] = t[..., 0, :3] * lit[..., None], t[..., 2, :3]
    area = t[..., 2, 3] * lit
    nodes["area"] = area
    # s² = Ω d², and the patch is s by s / cos, s² / cos its area
    s2 = t[..., 1, 3] * tiles**2 * np.where(lit, t[..., 0, 3], 0) ** 2
    cosine = np.clip(s2 / np.maximum(area, 1e-30), LEAST_COSINE, 1)
    nodes["radius"] = 0.5 * np.sqrt(area * cosine + area / cosine)
    ranges[:, :, 0], ranges[:, :, 1] = FAR, -FAR
    ranges[(t[..., 1, 3] > 0) & (t[..., 0, 3] >= FAR), 1, 3] = FAR
    for k in (0, 1):
        ranges[lit, k, :3], ranges[lit, k, 3] = t[lit, 1, :3], t[lit, 0, 3]
    return nodes, ranges


def _length(v: Array) -> Array:
    length: Array = np.linalg.norm(v, axis=-1)
    return length


def _unit(v: Array) -> Array:
    return v / _length(v)[..., None]


def _parents(nodes: Nodes, ranges: Array, single: bool) -> tuple[Nodes, Array]:
    """The level above (maps, n / 4): four children each, side by side; `single`: no cut splits it."""
    maps, count = nodes.shape
    c = nodes.reshape(maps, count // 4, 4)
    made = np.zeros(c.shape[:2], WIDE)
    for name in ("flux", "area", "solid_angle"):
        made[name] = c[name].sum(2)
    weight = c["flux"].sum(-1)
    whole = weight.sum(-1, keepdims=True)
    share = np.divide(weight, whole, out=np.zeros_like(weight), where=whole > 0)[..., None]
    made["position"], made["normal"] = (share * c["position"]).sum(2), (share * c["normal"]).sum(2)
    # where they cancel it has the direction of the child with most flux
    chosen = weight.argmax(-1)[..., None, None]
    brightest = np.take_along_axis(_unit(c["normal"]), chosen, 2)[:, :, 0]
    cancels = _length(made["normal"]) <= CANCELS
    made["normal"][cancels] = CANCELS * brightest[cancels]
    made["normal"][whole[..., 0] == 0] = 0, 0, 1
    if single:
        made["normal"] = _unit(made["normal"])
        tilt = ((_length(_unit(c["normal"]) - made["normal"][:, :, None]) + c["spread"]) * (weight > 0)).max(
            -1
        )
        alone = cancels | (tilt > MOST_TILT)
        alone[whole[..., 0] == 0] = False
        made["normal"][alone] = brightest[alone]
        made["position"][alone] = np.take_along_axis(c["position"], chosen, 2)[:, :, 0][alone]
    unit = _unit(made["normal"])[:, :, None]
    offset = c["position"] - made["position"][:, :, None]
    turned = _length(_unit(c["normal"]) - unit)
    off_plane = np.abs((offset * unit).sum(-1)) + c["thickness"] + c["radius"] * turned
    lit = weight > 0
    made["radius"] = ((_length(offset) + c["radius"]) * lit).max(-1)
    made["spread"] = np.minimum(((turned + c["spread"]) * lit).max(-1), 2)
    made["thickness"] = np.minimum((off_plane * lit).max(-1), made["radius"])
    made["block"] = c["block"][:, :, 0]
    made["extent"] = c["extent"][:, :, 0] + (c["extent"][:, :, 0] & 0xFFFF)
    r = ranges.reshape(maps, count // 4, 4, 2, 4)
    return made, np.stack([r[:, :, :, 0].min(2), r[:, :, :, 1].max(2)], 2)


def tree(texels: Array, tiles: int = 1, single: int = 99) -> list[tuple[Nodes, Array]]:
    """Nodes (maps, 4^level) and ranges (maps, 4^level, 2, 4) of each level from the root on.

    From level `single` on they are lights that no cut splits, above it clusters.
    """
    levels = [_leaves(texels, tiles)]
    while levels[0][0].shape[1] > 1:
        level = levels[0][0].shape[1].bit_length() // 2 - 1  # of what is made
        levels.insert(0, _parents(*levels[0], level >= single))
    return levels


def flat(levels: list[tuple[Nodes, Array]]) -> tuple[Nodes, Array]:
    """Both as shaders hold them: level by level, map by map."""
    nodes = np.concatenate([level.reshape(-1) for level, _ in levels])
    return nodes, np.concatenate([ranges.reshape(-1, 2, 4) for _, ranges in levels])
