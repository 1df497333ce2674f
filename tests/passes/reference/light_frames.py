"""A light's own coordinates, which pixels face it, and what a tile of them looks like to it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer
from .hemisphere import frame
from .image import pixel_numbers
from .lights import Area, Light, Spot
from .structs import LIGHT_FRAME, NOTHING, SURFACE, record

FACING, ON_SURFACE, BACK, MIXED_SIDES, CLIPPED, NEAR, FAR, PARTLY, LIT, DARK = (1 << bit for bit in range(10))
FACED, FACING_AWAY, BEHIND_LIGHT = 1, 2, 4

Array = NDArray[np.float64]
Bits = NDArray[np.bool_]


def axes(light: Light) -> Array:
    """Rows that give a, b and h of a vector from the light's corner: the inverse of (u v n)."""
    if isinstance(light, Spot):
        return np.concatenate([frame(light.axis[None])[0], light.axis[None]])
    return np.linalg.inv(np.stack([light.u, light.v, light.normal], axis=-1))


def corner(light: Light) -> Array:
    """The place that a light's coordinates begin at."""
    return light.position if isinstance(light, Spot) else light.corner


def light_frame(light: Light) -> NDArray[Any]:
    """The struct of it."""
    dual_u, dual_v, normal = axes(light)
    area = isinstance(light, Area)
    return record(
        LIGHT_FRAME,
        corner=corner(light),
        extent_a=float(area),
        extent_b=float(area),
        dual_u=dual_u,
        dual_v=dual_v,
        normal=normal,
        two_sided=isinstance(light, Area) and light.two_sided,
        cos_cutoff=light.cos_cutoff if isinstance(light, Spot) else -2,
    )


@dataclasses.dataclass
class Seen:
    """How a light and the points of a G-buffer see each other, a row a pixel."""

    place: Array
    """a, b, h."""
    rounding: Array
    """How far float32 may put a, b, h off."""
    emits: Bits
    facing: Bits
    clipped: Bits
    near: Bits
    margin: Array
    """How near, relative to what is compared, any of the answers is to being another."""


def seen_by(light: Light, g: GBuffer) -> Seen:
    """Place and answers of all pixels.

    A point faces a light that emits towards it and rises above both of its horizons somewhere; it is clipped
    when the light also reaches below one; it is near within five times the longer edge of the middle.
    """
    u, v = (light.u, light.v) if isinstance(light, Area) else (np.zeros(3), np.zeros(3))
    start = corner(light)
    q = g.origin - start
    place = q @ axes(light).T
    scale = (np.abs(g.origin) + np.abs(start)) @ np.abs(axes(light)).T
    corners = start + np.array([0 * u, u, v, u + v]) - g.origin[:, None]
    reach = np.linalg.norm(corners, axis=2).max(axis=1)
    heights = np.stack([(corners * n[:, None]).sum(axis=2) for n in (g.geometric, g.normal)], axis=1)
    distance = np.linalg.norm(start + (u + v) / 2 - g.origin, axis=1)
    size = max(np.linalg.norm(u), np.linalg.norm(v))
    cosine = place[:, 2] / distance
    two_sided = isinstance(light, Area) and light.two_sided
    cutoff = light.cos_cutoff if isinstance(light, Spot) else -2.0
    emits = (two_sided | (cosine > 0)) & (cosine >= cutoff)
    above = heights.max(axis=2)
    tests = [
        np.abs(cosine),
        np.abs(cosine - cutoff),
        np.abs(heights.max(axis=2)).min(axis=1) / reach,
        np.abs(heights.min(axis=2)).min(axis=1) / reach,
        np.abs(distance - 5 * size) / distance,
    ]
    return Seen(
        place,
        2.0**-20 * scale,
        emits,
        emits & (above > 0).all(axis=1),
        (heights.min(axis=2) < 0).any(axis=1),
        distance <= 5 * size,
        np.min(tests, axis=0),
    )


def without_doubt(light: Light, g: GBuffer, margin: float = 1e-4) -> GBuffer:
    """The same G-buffer without surfaces of which rounding decides whether they face the light."""
    doubtful = (g.kind == SURFACE) & (seen_by(light, g).margin < margin)
    return dataclasses.replace(g, kind=np.where(doubtful, NOTHING, g.kind))


@dataclasses.dataclass
class Tiles:
    """Bounds (n, 3) of what faces a light in each tile, their rounding, how many pixels, and the flags."""

    lo: Array
    hi: Array
    rounding: Array
    facing: NDArray[np.int64]
    flags: NDArray[np.int64]


def tiles(light: Light, g: GBuffer, width: int, height: int) -> Tiles:
    """What is to be known of each tile."""
    s = seen_by(light, g)
    pixels = pixel_numbers(width, height).reshape(-1, 64)
    surface = (pixels >= 0) & (g.kind[pixels] == SURFACE)
    facing = surface & s.facing[pixels]
    front, behind = facing & (s.place[pixels, 2] > 0), facing & (s.place[pixels, 2] < 0)
    mixed = front.any(axis=1) & behind.any(axis=1)
    back = behind.any(axis=1) & ~mixed
    sign = np.where(back[:, None, None], [1, 1, -1], 1)
    place = s.place[pixels] * sign
    empty = ~facing[..., None]
    flags = (
        FACING * facing.any(axis=1)
        + ON_SURFACE * surface.any(axis=1)
        + BACK * back
        + MIXED_SIDES * mixed
        + CLIPPED * (facing & s.clipped[pixels]).any(axis=1)
        + NEAR * (facing & s.near[pixels]).any(axis=1)
        + FAR * (facing & ~s.near[pixels]).any(axis=1)
        + PARTLY * (facing.any(axis=1) & ~facing.all(axis=1))
    )
    return Tiles(
        np.where(empty, np.inf, place).min(axis=1),
        np.where(empty, -np.inf, place).max(axis=1),
        np.where(empty, 0, s.rounding[pixels]).max(axis=1),
        facing.sum(axis=1),
        flags,
    )
