"""The fragments of a frame: which level shades each pixel, and why."""

from __future__ import annotations

import enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CULLED = 254
"""Level of a pixel that belongs to no fragment because nothing needs shading there."""
NOTHING = 255
"""Level and reason of a pixel that sees nothing."""


class Reason(enum.IntEnum):
    """Why a fragment is as small as it is, or why it is culled; the values in `Fragments.reason_map`.

    The first six say why the parent was refined (`COARSEST`: it has none), the next four why a fragment was
    culled, `NOTHING` that nothing is seen.
    """

    COARSEST = 0
    DEPTH = 1
    NORMAL = 2
    ILLUMINATION = 3
    VISIBILITY = 4
    LOBE = 5
    EMITTER = 6
    FACING_AWAY = 7
    BEHIND_LIGHT = 8
    OUTSIDE_LOBE = 9
    NOTHING = NOTHING


class Fragments:
    """The partition of an image into fragments of 2^l × 2^l pixels.

    Every pixel that is seen and not culled belongs to exactly one fragment.

    Parameters
    ----------
    level_map
        (H, W) uint8: the level of the fragment that shades each pixel, 254 where culled (an emitter, or
        provably unlit), 255 where nothing is seen.
    reason_map
        (H, W) uint8 of `Reason`; 255 where nothing is seen.
    extra
        Samples beyond the partition.
    coarsest_level
        The coarsest level that the render allowed; `masks` and `counts` reach at least to it.
    """

    def __init__(
        self,
        level_map: NDArray[np.uint8],
        reason_map: NDArray[np.uint8],
        extra: int = 0,
        coarsest_level: int = 0,
    ) -> None:
        self.level_map = level_map
        self.reason_map = reason_map
        self.extra = extra
        self.coarsest_level = coarsest_level

    @cached_property
    def masks(self) -> tuple[NDArray[np.bool_], ...]:
        """For each level l, (ceil(H/2^l), ceil(W/2^l)) bool: where a fragment of that level lies."""
        used = self.level_map[self.level_map < CULLED]
        coarsest = max(self.coarsest_level, int(used.max()) if used.size else 0)
        return tuple(_any_of_block(self.level_map == level, 2**level) for level in range(coarsest + 1))

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """Number of fragments of each level."""
        return tuple(int(np.count_nonzero(mask)) for mask in self.masks)

    @property
    def total(self) -> int:
        """Number of fragments of all levels together."""
        return sum(self.counts)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the level map with one colour a level.

        Parameters
        ----------
        ax
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from matplotlib import pyplot as plt
        from matplotlib.patches import Patch

        from .notebook import LEVEL_NAMES, level_colors

        if ax is None:
            ax = plt.figure().add_subplot()
        ax.imshow(level_colors(self.level_map), interpolation="nearest")
        ax.set_axis_off()
        ax.set_title(f"{self.total:,} fragments")
        levels = np.unique(self.level_map)
        colors = level_colors(levels[None])[0] / 255.0
        labels = [LEVEL_NAMES.get(int(level), f"level {level}") for level in levels]
        handles = [Patch(color=color, label=label) for color, label in zip(colors, labels, strict=True)]
        ax.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        return ax

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Fragments):
            return NotImplemented
        return (
            np.array_equal(self.level_map, other.level_map)
            and np.array_equal(self.reason_map, other.reason_map)
            and self.extra == other.extra
        )

    __hash__ = None  # type: ignore[assignment]  # arrays can be changed

    def __repr__(self) -> str:
        height, width = self.level_map.shape
        counts = ", ".join(f"level {level}: {count:,}" for level, count in enumerate(self.counts))
        return f"<Fragments {width} × {height} pixels, {self.total:,} in all ({counts})>"

    def _repr_png_(self) -> bytes:
        from .notebook import level_colors, png_bytes

        return png_bytes(level_colors(self.level_map))


def _any_of_block(pixels: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    # the last row and column of blocks may hang over the image
    height, width = pixels.shape
    rows = np.logical_or.reduceat(pixels, np.arange(0, height, size), axis=0)
    return np.asarray(np.logical_or.reduceat(rows, np.arange(0, width, size), axis=1))
