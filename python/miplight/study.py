"""Studies: sweeps over any settings, with what they cost and how far they are off, and what each level does.

`sweep` renders every combination of settings, one row a render; `pareto`, `plot` and `compare` look at what
came of it; `settings_of` makes settings of a row again. `levels_along`, `threshold_sweep` and `voxel_sweep`
look into incremental refinement.
"""

from __future__ import annotations

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
from .study_journal import load
from .study_plots import compare, medians, pareto, plot
from .study_sweep import sweep
from .study_tuning import settings_of

__all__ = [
    "compare",
    "level_names",
    "levels_along",
    "load",
    "mask_colors",
    "medians",
    "pareto",
    "plot",
    "plot_levels",
    "plot_maps",
    "plot_thresholds",
    "plot_voxels",
    "settings_of",
    "sweep",
    "threshold_sweep",
    "voxel_sweep",
]
