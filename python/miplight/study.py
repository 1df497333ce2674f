"""Studies: what each level of incremental refinement does, and sweeps over its dials.

`sweep`, `pareto` and `plot` over any settings are not available yet, and say so.
"""

from __future__ import annotations

from typing import Any, NoReturn

from .errors import SettingsError
from .level_study import (
    level_names,
    levels_along,
    mask_colors,
    plot_levels,
    plot_maps,
    plot_thresholds,
    plot_voxels,
    threshold_sweep,
    voxel_sweep,
)

__all__ = [
    "level_names",
    "levels_along",
    "mask_colors",
    "pareto",
    "plot",
    "plot_levels",
    "plot_maps",
    "plot_thresholds",
    "plot_voxels",
    "sweep",
    "threshold_sweep",
    "voxel_sweep",
]


def _later(name: str) -> NoReturn:
    raise SettingsError(f"miplight.study.{name} is not available yet; render in a loop over Settings.replace")


def sweep(
    scene: Any, camera: Any, grid: Any, reference: Any = None, repeats: int = 1, client: Any = None
) -> NoReturn:
    """Render once for each combination of settings, one row each. Not available yet.

    Parameters
    ----------
    scene, camera
        What to render.
    grid
        Settings by name, each with the values to try.
    reference
        What the error is measured against.
    repeats
        Renders of each combination.
    client
        A Dask client.

    Raises
    ------
    SettingsError
        Always, until it is available.
    """
    del scene, camera, grid, reference, repeats, client
    _later("sweep")


def pareto(df: Any) -> NoReturn:
    """Keep the rows of a sweep that no other row beats in both error and time. Not available yet.

    Raises
    ------
    SettingsError
        Always, until it is available.
    """
    del df
    _later("pareto")


def plot(df: Any) -> NoReturn:
    """Draw error against time for a sweep. Not available yet.

    Raises
    ------
    SettingsError
        Always, until it is available.
    """
    del df
    _later("plot")
