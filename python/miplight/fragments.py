"""The fragments of a frame: which level shades each pixel, and why."""

from __future__ import annotations

import enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .validate import as_choice

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

    def plot(self, ax: Axes | None = None, by: str = "level") -> Axes:
        """Draw the level map with one colour a level, or the reasons with one colour a reason.

        What is culled is hatched: it belongs to no fragment.

        Parameters
        ----------
        ax
            Where to draw; a new figure by default.
        by
            ``"level"``, or ``"reason"``: why each fragment is as small as it is, or why it was culled.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        SettingsError
            If `by` is neither.
        """
        from matplotlib import pyplot as plt

        as_choice(by, "by", ("level", "reason"), SettingsError)
        if ax is None:
            ax = plt.figure(layout="constrained").add_subplot()
        culled = self.level_map == CULLED
        values = self.level_map if by == "level" else self.reason_map
        _draw(ax, values, culled, by)
        count = f"{self.total:,} fragments for {np.count_nonzero(self.level_map < CULLED):,} pixels"
        ax.set_title(f"{count}, {np.count_nonzero(culled):,} culled" if culled.any() else count)
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


def _draw(ax: Axes, values: NDArray[np.uint8], culled: NDArray[np.bool_], by: str) -> None:
    """Draw a map of levels or reasons, what is culled hatched, and say beside it what the colours mean."""
    from matplotlib.patches import Patch

    from .notebook import LEVEL_NAMES, level_colors, reason_colors

    def label(value: int) -> str:
        if by == "level":
            return LEVEL_NAMES.get(value, f"level {value}")
        return "nothing seen" if value == NOTHING else Reason(value).name.lower().replace("_", "-")

    colors = level_colors if by == "level" else reason_colors
    ax.imshow(colors(values), interpolation="nearest")
    height, width = values.shape
    if culled.any():
        # a frame of zeros around it: a contour needs two rows, and one that ends at the edge
        framed = np.pad(culled, 1).astype(np.float64)
        places = np.arange(-1, width + 1), np.arange(-1, height + 1)
        ax.contourf(*places, framed, levels=[0.5, 1.5], colors="none", hatches=["////"])
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    ax.set_axis_off()
    handles = []
    for value in np.unique(values):
        hatched = bool(culled[values == value].any())
        color = colors(np.array([[value]], np.uint8))[0, 0] / 255.0
        handles.append(Patch(facecolor=color, label=label(int(value)), hatch="////" if hatched else None))
    ax.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def _any_of_block(pixels: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    # the last row and column of blocks may hang over the image
    rows, columns = (range(0, length, size) for length in pixels.shape)
    along = np.logical_or.reduceat(pixels, list(rows), axis=0)
    return np.asarray(np.logical_or.reduceat(along, list(columns), axis=1), np.bool_)
