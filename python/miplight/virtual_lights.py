"""What indirect light came from in a frame: reflective shadow maps, and virtual lights over them."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .validate import as_count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FAR = np.float32(3e38)
"""Distance of a texel that sees no surface, as the device has it."""
LIGHT = np.dtype(
    [
        ("position", "<f4", 3),
        ("area", "<f4"),
        ("normal", "<f4", 3),
        ("radius", "<f4"),
        ("flux", "<f4", 3),
        ("solid_angle", "<f4"),
        ("spread", "<f4"),
        ("thickness", "<f4"),
        ("column", "<u2"),
        ("row", "<u2"),
        ("texels", "<u2"),
        ("map", "<u2"),
    ]
)
"""A virtual light; see `VirtualLights.lights`."""


@dataclasses.dataclass(frozen=True, eq=False)
class VirtualLights:
    """Reflective shadow maps of a frame [DS05] and what lies over them; of M maps of R × R texels.

    A spot has one map, an area light one for each lit side: hemispheres of some of its points side by side.
    Maps of area lights come first, in the order of the lights.
    """

    distance: NDArray[np.float32]
    """(M, R, R) from the light, scene units; inf where nothing is seen."""
    position: NDArray[np.float32]
    """(M, R, R, 3) world position; zeros where nothing is seen."""
    normal: NDArray[np.float32]
    """(M, R, R, 3) unit, towards the light; zeros where nothing is seen."""
    flux: NDArray[np.float32]
    """(M, R, R, 3) reflected, W."""
    solid_angle: NDArray[np.float32]
    """(M, R, R) inside of a spot's cone, sr; of an area light projected, over the number of its points."""
    lights: NDArray[np.void] | None
    """
    (N,) structured array of the virtual lights that light every fragment; None with `indirect` hierarchical,
    where each fragment has a cut of its own. Fields: position (scene units), normal (mean by flux, shorter
    than 1 where surfaces differ), flux (W), area (square scene units), solid_angle (sr), radius of a ball
    that holds the surfaces, spread and thickness about the mean normal and plane; column, row and texels of
    the square of texels that it stands for (texels 0: no square), and map.
    """

    @classmethod
    def of(cls, texels: NDArray[np.uint32], lights: NDArray[np.uint32] | None) -> VirtualLights:
        """From a frame's arrays ``rsm`` and ``virtual_lights``."""
        resolution = texels.shape[1]
        rows = texels.view(np.float32).reshape(-1, resolution, resolution, 3, 4)
        seen = rows[..., 0, 3] < FAR
        listed = None if lights is None else np.ascontiguousarray(lights).view(LIGHT).reshape(-1)
        return cls(
            distance=np.where(seen, rows[..., 0, 3], np.float32(np.inf)),
            position=rows[..., 0, :3] * seen[..., None],
            normal=rows[..., 1, :3] * seen[..., None],
            flux=rows[..., 2, :3].copy(),
            solid_angle=rows[..., 1, 3].copy(),
            lights=listed,
        )

    @cached_property
    def cluster_map(self) -> NDArray[np.int32]:
        """(M, R, R) number of the virtual light that stands for each texel; -1 where none does.

        Raises
        ------
        SettingsError
            Where there is no list, with `indirect` hierarchical.
        """
        if self.lights is None:
            raise SettingsError(
                "cluster_map needs a list of virtual lights; allowed: indirect splat, gather, clustered"
            )
        numbers = np.full(self.distance.shape, -1, np.int32)
        for number, light in enumerate(self.lights):
            row, column, side = int(light["row"]), int(light["column"]), int(light["texels"])
            numbers[light["map"], row : row + side, column : column + side] = number
        return numbers

    @cached_property
    def borders(self) -> NDArray[np.bool_]:
        """(M, R, R): texels at the upper or left border of what a virtual light stands for."""
        numbers, border = self.cluster_map, np.zeros(self.distance.shape, bool)
        border[:, 1:] |= numbers[:, 1:] != numbers[:, :-1]
        border[:, :, 1:] |= numbers[:, :, 1:] != numbers[:, :, :-1]
        return border

    def plot(self, ax: Axes | None = None, *, map: int = 0, borders: bool = True) -> Axes:  # noqa: A002
        """Draw the flux of a map, as bright as its texels are, and the borders of the virtual lights over it.

        Parameters
        ----------
        ax
            Where to; a new figure's, if None.
        map
            Number of the map.
        borders
            Whether to draw them; only where there is a list.

        Returns
        -------
        matplotlib.axes.Axes
        """
        import matplotlib.pyplot as plt

        from .color import linear_to_srgb

        number = as_count(map, "map", at_least=0)
        if number >= len(self.distance):
            raise SettingsError(f"map is {number}; allowed: 0 to {len(self.distance) - 1}")
        axes: Axes = plt.subplots()[1] if ax is None else ax
        # by solid angle: the same surface is as bright in the middle as at the rim
        light = self.flux[number] / np.maximum(self.solid_angle[number], 1e-30)[..., None]
        brightest = np.percentile(light[light > 0], 98) if (light > 0).any() else 1.0
        picture = linear_to_srgb(np.clip(light / (1.6 * brightest), 0, 1))
        if borders and self.lights is not None:
            yellow = np.array([1.0, 0.8, 0.1], np.float32)
            picture[self.borders[number]] = 0.35 * picture[self.borders[number]] + 0.65 * yellow
        axes.imshow(picture, interpolation="nearest")
        axes.set_axis_off()
        return axes
