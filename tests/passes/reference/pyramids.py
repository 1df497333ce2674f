"""Levels of an image in float64: what the metrics of refinement need to know of every texel."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer
from .structs import PYRAMID, SURFACE, record

Array = NDArray[np.float64]
FAR = 3.0e38
LEVELS = 17


def sizes(width: int, height: int) -> list[tuple[int, int, int, int]]:
    """Columns, rows, flat number of the first texel and texels of levels 0 to 16."""
    rows, first = [], 0
    for level in range(LEVELS):
        columns, lines = -(-width // 2**level), -(-height // 2**level)
        rows.append((columns, lines, first, columns * lines))
        first += columns * lines
    return rows


def pyramid_record(view: NDArray[Any], coarsest: int, finest: int = 0, level: int = 0) -> NDArray[Any]:
    """The uniform of every pass that works on levels."""
    levels = sizes(int(view["width"][0]), int(view["height"][0]))
    return record(
        PYRAMID,
        levels=levels,
        coarsest=coarsest,
        finest=finest,
        level=level,
        pixel_width=pixel_width(view),
    )


def pixel_width(view: NDArray[Any]) -> float:
    """Scene units that a pixel covers at depth 1."""
    return float(1 / min(view["fx"][0], view["fy"][0]))


def texels_of(view: NDArray[Any], coarsest: int) -> list[tuple[int, NDArray[np.int64]]]:
    """For every texel of levels 1 to `coarsest`, in order: its level and the numbers of its pixels."""
    width, height = int(view["width"][0]), int(view["height"][0])
    numbers = np.arange(width * height).reshape(height, width)
    found = []
    for level in range(1, coarsest + 1):
        side = 2**level
        for row in range(0, height, side):
            found += [
                (level, numbers[row : row + side, column : column + side].ravel())
                for column in range(0, width, side)
            ]
    return found


@dataclasses.dataclass
class Texels:
    """One row a texel from level 1 on; zeros (and an empty range) where no pixel sees a surface."""

    level: NDArray[np.int64]
    pixels: NDArray[np.int64]
    count: NDArray[np.int64]
    position: Array
    normal: Array
    geometric: Array
    slope: Array
    curvature: Array
    least: Array
    most: Array
    plane: Array
    cone: Array
    width: Array


def depths(view: NDArray[Any], positions: Array) -> Array:
    """Distance along the view axis."""
    eye, backward = view["eye"][0].astype(np.float64), view["backward"][0].astype(np.float64)
    depth: Array = (eye - positions) @ backward
    return depth


def steepness(view: NDArray[Any], g: GBuffer) -> tuple[Array, Array]:
    """Slope and curvature a pixel, from the neighbours to the right and below that see a surface."""
    width, height = int(view["width"][0]), int(view["height"][0])
    shape = (height, width)
    depth, seen = depths(view, g.position).reshape(shape), (g.kind == SURFACE).reshape(shape)
    position, normal = g.position.reshape(*shape, 3), g.normal.reshape(*shape, 3)
    slope2, curvature2 = np.zeros(shape), np.zeros(shape)
    for here, there in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :], np.s_[1:, :]),
    ):
        both = seen[here] & seen[there]
        far = np.linalg.norm(position[there] - position[here], axis=-1)
        bend = np.linalg.norm(normal[there] - normal[here], axis=-1) / np.maximum(far, 1e-30)
        slope2[here] += np.where(both, depth[there] - depth[here], 0) ** 2
        curvature2[here] += np.where(both, bend, 0) ** 2
    slope = np.sqrt(slope2) / (pixel_width(view) * np.maximum(depth, 1e-30))
    return np.where(seen, slope, 0).ravel(), np.where(seen, np.sqrt(curvature2), 0).ravel()


def _unit(v: Array) -> Array:
    unit: Array = v / max(float(np.linalg.norm(v)), 1e-30)
    return unit


def texels(view: NDArray[Any], g: GBuffer, coarsest: int) -> Texels:
    """Everything about levels 1 to `coarsest`, each texel from its own pixels."""
    slope, curvature = steepness(view, g)
    depth = depths(view, g.position)
    rows: dict[str, list[Any]] = {field.name: [] for field in dataclasses.fields(Texels)}

    def add(**values: Any) -> None:
        for name, value in values.items():
            rows[name].append(value)

    zero, far = np.zeros(3), np.full(4, FAR)
    for level, all_pixels in texels_of(view, coarsest):
        at = all_pixels[g.kind[all_pixels] == SURFACE]
        add(level=level, pixels=len(all_pixels), count=len(at))
        if len(at) == 0:
            add(position=zero, normal=zero, geometric=zero, slope=0, curvature=0, least=far, most=-far)
            add(plane=0, cone=0, width=0)
            continue
        middle, normal, across = g.position[at].mean(0), g.normal[at].mean(0), g.geometric[at].mean(0)
        width = 2**level * pixel_width(view) * max(float(depths(view, middle[None])[0]), 1e-30)
        values = np.column_stack([g.normal[at], depth[at]])
        add(position=middle, normal=normal, geometric=across, slope=slope[at].max())
        add(curvature=curvature[at].max(), least=values.min(0), most=values.max(0), width=width)
        add(plane=np.abs((g.position[at] - middle) @ _unit(across)).max() / width)
        add(cone=(1 - g.normal[at] @ _unit(normal)).max())
    return Texels(**{name: np.array(value) for name, value in rows.items()})
