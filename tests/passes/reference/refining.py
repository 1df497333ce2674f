"""One-pass refinement in float64: which texels are rough or dark, and the fragments that follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer
from .lights import Area, Light
from .pyramids import Texels, sizes
from .structs import NOTHING, SURFACE

Array = NDArray[np.float64]
Maps = tuple[NDArray[np.int64], NDArray[np.int64], list[tuple[int, int, int]]]

LIT, FACES_AWAY, LIES_BEHIND, ROUGH_DEPTH, ROUGH_NORMAL = 1, 2, 4, 8, 16
FRAGMENT, CULLED = 256, 0xFFFFFFFF
DEPTH_METRICS = {"range": 1, "derivative": 2, "plane": 3}
NORMAL_METRICS = {"component": 1, "cone": 2, "curvature": 3}


def depth_change(t: Texels, metric: str) -> Array:
    """What the depth threshold is compared with."""
    found: dict[str, Array] = {
        "range": t.most[:, 3] - t.least[:, 3],
        "derivative": t.slope,
        "plane": t.plane,
    }
    return found[metric]


def normal_change(t: Texels, metric: str) -> Array:
    """What the normal threshold is compared with: a chord between unit normals."""
    found: dict[str, Array] = {
        "component": (t.most[:, :3] - t.least[:, :3]).max(1),
        "cone": np.sqrt(2 * np.clip(t.cone, 0, None)),
        "curvature": t.curvature * t.width,
    }
    return found[metric]


def pixel_bits(g: GBuffer, lights: Sequence[Light]) -> NDArray[np.int64]:
    """LIT where some light may shine, else FACES_AWAY if one shines its way, else LIES_BEHIND."""
    lit, away = (np.zeros(len(g.kind), bool) for _ in range(2))
    for light in lights:
        if isinstance(light, Area):
            corners = light.point(np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)]))
            above = np.einsum("nki,ni->nk", corners - g.position[:, None], g.geometric).max(1) > 0
            front = ((g.position - light.corner) @ light.normal > 0) | light.two_sided
        else:
            towards = g.position - light.position
            above = -(towards * g.geometric).sum(1) > 0
            front = light.lights(towards / np.linalg.norm(towards, axis=1, keepdims=True))
        lit |= above & front
        away |= front & ~above
    bits = np.where(lit, LIT, np.where(away, FACES_AWAY, LIES_BEHIND))
    return np.where(g.kind == SURFACE, bits, 0)


def texel_states(
    view: NDArray[Any], g: GBuffer, pixels: NDArray[np.int64], rough: NDArray[np.int64], coarsest: int
) -> list[NDArray[np.int64]]:
    """Bits of every texel, an image a level; `rough`: of the texels from level 1 on."""
    width, height = int(view["width"][0]), int(view["height"][0])
    levels = sizes(width, height)
    image = pixels.reshape(height, width)
    states = [image]
    for level in range(1, coarsest + 1):
        columns, rows, first, count = levels[level]
        side = 2**level
        lines = np.bitwise_or.reduceat(image, np.arange(0, height, side), axis=0)
        any_of = np.bitwise_or.reduceat(lines, np.arange(0, width, side), axis=1)
        start = first - levels[1][2]
        own = rough[start : start + count].reshape(rows, columns)
        states.append(any_of | np.where(any_of != 0, own, 0))
    return states


def listed_states(states: list[NDArray[np.int64]], coarsest: int, finest: int) -> list[NDArray[np.int64]]:
    """The same where only what is reached from the coarsest level by lit rough texels is tested."""
    reached = np.ones_like(states[coarsest], bool)
    found: dict[int, NDArray[np.int64]] = {}
    for level in range(coarsest, -1, -1):
        state = states[level]
        tested = reached & (level > finest) & ((state & LIT) != 0)
        rough = np.where(tested, state & (ROUGH_DEPTH | ROUGH_NORMAL), 0)
        found[level] = (state & ~(ROUGH_DEPTH | ROUGH_NORMAL)) | rough
        if level:
            rows, columns = states[level - 1].shape
            reached = np.repeat(np.repeat(rough != 0, 2, axis=0), 2, axis=1)[:rows, :columns]
    return [found[level] for level in range(coarsest + 1)]


def choose(g: GBuffer, states: list[NDArray[np.int64]], coarsest: int, finest: int) -> Maps:
    """Level map, reason map, and every unculled fragment as (level, row, column of its first pixel)."""
    height, width = states[0].shape
    level_map, reason_map = np.zeros((2, height, width), np.int64)
    fragments = set()
    kinds = g.kind.reshape(height, width)
    for row in range(height):
        for column in range(width):
            above = 0
            for level in range(coarsest, finest - 1, -1):
                state = int(states[level][row >> level, column >> level])
                if level == finest or not state & (ROUGH_DEPTH | ROUGH_NORMAL) or not state & LIT:
                    break
                above = state
            kind = kinds[row, column]
            reason = 1 if above & ROUGH_DEPTH else 2 if above & ROUGH_NORMAL else 0
            if kind != SURFACE:
                level, reason = (255, 255) if kind == NOTHING else (254, 6)
            elif not state & LIT:
                level, reason = 254, 7 if state & FACES_AWAY else 8
            else:
                fragments.add((level, row >> level << level, column >> level << level))
            level_map[row, column], reason_map[row, column] = level, reason
    return level_map, reason_map, sorted(fragments)
