"""What went through a light propagation volume in a frame, cell by cell."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .validate import as_choice, as_number, fail

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = ("volume", "volume_open", "volume_bounds")
"""The arrays of a frame behind a `LightVolume`."""
AXES = ("x", "y", "z")
# across and up in a slice; from above, −z is up as it is for a camera that looks down
_DRAWN = ((2, 1), (0, 2), (0, 1))


@dataclasses.dataclass(frozen=True, eq=False)
class LightVolume:
    """A propagation volume of Z × Y × X cubic cells, after all steps [KD10].

    Faces are numbered −x, +x, −y, +y, −z, +z. With `lpv_cascades` it is the volume of the whole scene.
    """

    flux: NDArray[np.float32]
    """(6, 3, Z, Y, X) that left each cell through each face in all steps, W; it ends at closed faces."""
    open: NDArray[np.bool_]
    """(6, Z, Y, X): no surface lies between the cell's middle and that of the cell beyond the face."""
    bounds: NDArray[np.float64]
    """(2, 3) lowest and highest corner in the world, scene units."""

    @classmethod
    def of(
        cls, flux: NDArray[np.float32], mask: NDArray[np.uint8], bounds: NDArray[np.float64]
    ) -> LightVolume:
        """From a frame's arrays ``volume``, ``volume_open`` and ``volume_bounds``."""
        bits = np.arange(6, dtype=np.uint8)[:, None, None, None]
        return cls(flux, (mask >> bits & 1).astype(bool), bounds)

    @property
    def corner(self) -> NDArray[np.float64]:
        """(3,) lowest corner in the world, scene units."""
        corner: NDArray[np.float64] = self.bounds[0]
        return corner

    @property
    def size(self) -> tuple[int, int, int]:
        """Cells along x, y and z."""
        z, y, x = self.flux.shape[2:]
        return x, y, z

    @property
    def edge(self) -> float:
        """Of a cell, scene units."""
        return float((self.bounds[1, 0] - self.bounds[0, 0]) / self.size[0])

    @property
    def irradiance(self) -> NDArray[np.float32]:
        """(Z, Y, X, 3) mean over the six faces of each cell, W·m⁻²: π times the mean radiance."""
        mean = self.flux.mean(axis=0) / np.float32(self.edge**2)
        return np.ascontiguousarray(np.moveaxis(mean, 0, -1))

    @property
    def net_flow(self) -> NDArray[np.float32]:
        """(Z, Y, X, 3, 3) by axis and channel, W: through upper faces less that through lower ones."""
        apart = self.flux[1::2] - self.flux[::2]
        return np.ascontiguousarray(np.moveaxis(apart, (0, 1), (-2, -1)))

    def plot(
        self,
        ax: Axes | None = None,
        *,
        axis: str = "y",
        at: float | None = None,
        brightest: float | None = None,
        walls: bool = True,
    ) -> Axes:
        """Draw a slice: the `irradiance` of the cells, in world coordinates.

        Parameters
        ----------
        ax
            Where to; a new figure's, if None.
        axis
            ``"x"``, ``"y"`` or ``"z"``: what the slice is perpendicular to. One perpendicular to y is seen
            from above, with −z up.
        at
            Where along `axis`, scene units; the middle, if None.
        brightest
            Irradiance that is white, W·m⁻²; by default that of the brightest fiftieth of the slice.
        walls
            Whether to draw the faces that surfaces close.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        SettingsError
            For another axis, a place outside of the volume, or a brightness that is not positive.
        """
        from matplotlib import pyplot as plt
        from matplotlib.collections import LineCollection

        from .color import linear_to_srgb

        as_choice(axis, "axis", AXES, SettingsError)
        normal = AXES.index(axis)
        across, up = _DRAWN[normal]
        layer = self._layer(normal, at)
        light = np.take(self.irradiance.transpose(2, 1, 0, 3), layer, axis=normal)
        # the first of the two axes that are left is the columns'
        light = light.swapaxes(0, 1) if across < up else light
        white = _brightest(light)
        if brightest is not None:
            white = as_number(brightest, "brightest", above=0, error=SettingsError)
        axes: Axes = plt.subplots(layout="constrained")[1] if ax is None else ax
        low, high = self.bounds
        extent = (low[across], high[across], low[up], high[up])
        picture = linear_to_srgb(np.clip(light / white, 0, 1))
        axes.imshow(picture, interpolation="nearest", origin="lower", extent=extent)
        if walls:
            ends = np.concatenate([self._walls(normal, layer, along) for along in (across, up)])
            axes.add_collection(LineCollection(list(ends[..., [across, up]]), colors="0.6", linewidths=0.8))
        if axis == "y":
            axes.set_ylim(high[up], low[up])
        axes.set(xlabel=AXES[across], ylabel=AXES[up])
        return axes

    def _layer(self, normal: int, at: float | None) -> int:
        low, high = self.bounds[:, normal]
        place = 0.5 * (low + high) if at is None else as_number(at, "at", error=SettingsError)
        if not low <= place <= high:
            allowed = f"a place along {AXES[normal]} inside of the volume, {low:g} to {high:g}"
            fail("at", at, allowed, SettingsError)
        return min(int((place - low) / self.edge), self.size[normal] - 1)

    def _walls(self, normal: int, layer: int, along: int) -> NDArray[np.float64]:
        """(N, 2, 3) ends of the closed faces between cells of a layer, of those perpendicular to one axis."""
        closed = np.take(~self.open[2 * along].transpose(2, 1, 0), [layer], axis=normal)
        cells = np.argwhere(closed)
        cells = cells[cells[:, along] > 0]  # not the border of the volume
        ends = np.stack([cells, cells + (np.arange(3) == 3 - normal - along)], axis=1)
        return np.asarray(self.corner + self.edge * ends, np.float64)


def _brightest(light: NDArray[np.float32]) -> float:
    lit = light[light > 0]
    return float(np.percentile(lit, 98)) if lit.size else 1.0
