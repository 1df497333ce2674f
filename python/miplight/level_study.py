"""Studies of incremental refinement: what each level costs along a camera path, and sweeps over its dials.

The tables are pandas DataFrames (the extra ``study``); the plots redraw Figs. 7, 9, 10 and 11 of [NPW10].
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import metrics
from .errors import SettingsError
from .fragments import Reason
from .renderer import Renderer
from .settings import Settings
from .study_rows import pandas_module

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .camera import Camera
    from .frame import Frame
    from .mitsuba import Reference
    from .scene import Scene

CAUSE_COLORS = {
    "none": (0.16, 0.27, 0.62),
    "fragment": (0.55, 0.55, 0.55),
    "geometry": (1, 1, 1),
    "light": (0.8, 0.1, 0.1),
}
"""Colours of the masks: not looked at, a fragment, split by geometry, split by illumination or visibility."""


def _incremental(settings: Settings | str) -> Settings:
    made = Settings.preset(settings) if isinstance(settings, str) else settings
    if made.refine != "incremental":
        raise SettingsError(
            f"settings has refine={made.refine!r}; allowed: 'incremental', as in the preset area-2010"
        )
    return made


def _renderer(renderer: Renderer | None) -> Any:
    return nullcontext(renderer) if renderer is not None else Renderer()


def level_names(settings: Settings | str = "area-2010") -> tuple[str, ...]:
    """Names for ``keep=`` that `plot_maps` needs: causes and image of each level, coarse to fine.

    Raises
    ------
    SettingsError
        If nothing is refined level by level.
    """
    made = _incremental(settings)
    levels = range(made.coarsest_level, made.finest_level - 1, -1)
    return tuple(f"level_{what}_{level}" for level in levels for what in ("causes", "image"))


def levels_along(
    scene: Scene,
    cameras: Iterable[Camera],
    settings: Settings | str = "area-2010",
    renderer: Renderer | None = None,
) -> Any:
    """Count and time what each level does along a camera path.

    Parameters
    ----------
    scene, cameras
        What is rendered; every camera once, after one frame to warm up.
    settings
        With ``refine="incremental"``.
    renderer
        A new one by default.

    Returns
    -------
    pandas.DataFrame
        One row a frame and level: frame, level, texels (of the level), nodes (looked at), share
        (nodes / texels), fragments (that stayed), ms (of the level), total_ms (of the frame).

    Raises
    ------
    SettingsError
        If nothing is refined level by level, or pandas is not installed.
    """
    pandas, made, path = pandas_module(), _incremental(settings), list(cameras)
    rows: list[dict[str, float]] = []
    with _renderer(renderer) as used:
        if path:
            used.render(scene, path[0], made)
        for number, camera in enumerate(path):
            frame = used.render(scene, camera, made)
            counts, stats = frame.fragments.counts, frame.stats
            height, width = frame.fragments.level_map.shape
            for level, found in stats.levels.items():
                texels = -(-width // 2**level) * -(-height // 2**level)
                rows.append(
                    {
                        "frame": number,
                        "level": level,
                        "texels": texels,
                        "nodes": int(found["nodes"]),
                        "share": found["nodes"] / texels,
                        "fragments": counts[level] if level < len(counts) else 0,
                        "ms": found["ms"],
                        "total_ms": stats.total_ms,
                    }
                )
    columns = ["frame", "level", "texels", "nodes", "share", "fragments", "ms", "total_ms"]
    return pandas.DataFrame(rows, columns=columns)


def plot_levels(df: Any) -> Figure:
    """Draw a table of `levels_along`: share of each level that is looked at, and its time, frame by frame."""
    from matplotlib import pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained", figsize=(7, 6))
    order = sorted(df["level"].unique(), reverse=True)
    for level in order:
        part = df[df["level"] == level]
        above.plot(part["frame"], 100 * part["share"], label=f"level {level}")
    frames = df["frame"].unique()
    stacked = [
        df[df["level"] == level].set_index("frame")["ms"].reindex(frames, fill_value=0) for level in order
    ]
    below.stackplot(frames, stacked, labels=[f"level {level}" for level in order])
    above.set_ylabel("nodes, % of the level")
    below.set_ylabel("time, ms")
    below.set_xlabel("frame")
    above.legend()
    return figure


def mask_colors(causes: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Colours (H, W, 3) of a kept map ``level_causes_L``, see `CAUSE_COLORS`."""
    colors = np.empty((*causes.shape, 3))
    colors[:] = CAUSE_COLORS["fragment"]
    colors[causes == Reason.NOTHING] = CAUSE_COLORS["none"]
    colors[(causes == Reason.DEPTH) | (causes == Reason.NORMAL)] = CAUSE_COLORS["geometry"]
    colors[(causes == Reason.ILLUMINATION) | (causes == Reason.VISIBILITY)] = CAUSE_COLORS["light"]
    return colors


def plot_maps(frame: Frame) -> Figure:
    """Draw what each level split and why, above the image after it.

    Blue was not looked at, grey stayed a fragment, white was split by geometry, red by illumination or
    visibility.

    Parameters
    ----------
    frame
        Rendered with ``keep=level_names(settings)``.

    Raises
    ------
    SettingsError
        If the frame has not kept them.
    """
    from matplotlib import pyplot as plt

    names = level_names(frame.settings)
    levels = [int(name.rpartition("_")[2]) for name in names[::2]]
    figure, axes = plt.subplots(
        2, len(levels), layout="constrained", figsize=(2.6 * len(levels), 5.4), squeeze=False
    )
    lit = frame.direct[frame.surface_mask]
    scale = 2.5 * float(lit.mean()) if lit.size and lit.any() else 1.0
    for column, level in enumerate(levels):
        above, below = axes[:, column]
        above.imshow(mask_colors(frame[f"level_causes_{level}"]), interpolation="nearest")
        below.imshow(np.clip(frame[f"level_image_{level}"] / scale, 0, 1) ** (1 / 2.2))
        above.set_title(f"level {level}")
        above.set_axis_off()
        below.set_axis_off()
    return figure


def _timed(
    renderer: Renderer, scene: Scene, camera: Camera, settings: Settings, repeats: int
) -> tuple[Frame, float]:
    """A frame, and the median time of `repeats` after one to warm up, milliseconds."""
    outputs = ("image", "direct", "fragments", "surface_mask")
    renderer.render(scene, camera, settings, outputs=outputs)
    frames = [renderer.render(scene, camera, settings, outputs=outputs) for _ in range(max(repeats, 1))]
    return frames[-1], float(np.median([frame.stats.total_ms for frame in frames]))


def _sweep(
    scene: Scene,
    camera: Camera,
    settings: Settings,
    changes: Sequence[dict[str, Any]],
    reference: Reference | NDArray[np.float32] | None,
    repeats: int,
    renderer: Renderer | None,
) -> Any:
    pandas = pandas_module()
    rows = []
    with _renderer(renderer) as used:
        if reference is None:
            brute = Settings.preset("brute-force").replace(light_samples=settings.light_samples)
            wanted = used.render(scene, camera, brute, outputs=("direct",)).direct
        else:
            wanted = reference if isinstance(reference, np.ndarray) else reference.mean
        for change in changes:
            frame, ms = _timed(used, scene, camera, settings.replace(**change), repeats)
            mask = frame.surface_mask
            rows.append(
                {
                    **change,
                    "ms": ms,
                    "fps": 1000 / ms,
                    "fragments": frame.fragments.total,
                    "rays": frame.stats.rays,
                    "relative_rmse": metrics.relative_rmse(frame.direct, wanted, mask=mask, trim=0.001),
                }
            )
    return pandas.DataFrame(rows)


def threshold_sweep(
    scene: Scene,
    camera: Camera,
    illumination: Sequence[float] = (0.02, 0.05, 0.1, 0.2, 0.4),
    normal: Sequence[float] = (0.1, 0.25, 0.5, 1.0),
    settings: Settings | str = "area-2010",
    reference: Reference | NDArray[np.float32] | None = None,
    repeats: int = 3,
    renderer: Renderer | None = None,
) -> Any:
    """Measure time and error by illumination and normal threshold [NPW10 Fig. 10].

    Parameters
    ----------
    illumination, normal
        Values of `illumination_threshold` and `normal_threshold`; every pair is rendered.
    reference
        What the error is measured against: a `Reference` or (H, W, 3) direct radiance; by default brute
        force with as many light samples.
    repeats
        Frames whose median time is taken.

    Returns
    -------
    pandas.DataFrame
        One row a pair: the two thresholds, ms, fps, fragments, rays, relative_rmse (of direct light, worst
        0.1 % of pixels left out).

    Raises
    ------
    SettingsError
        If nothing is refined level by level, a threshold is out of range, or pandas is not installed.
    """
    pairs = itertools.product(illumination, normal)
    changes = [{"illumination_threshold": i, "normal_threshold": n} for i, n in pairs]
    return _sweep(scene, camera, _incremental(settings), changes, reference, repeats, renderer)


def voxel_sweep(
    scene: Scene,
    camera: Camera,
    resolutions: Sequence[int] = (64, 128, 256, 512, 1024),
    slices: Sequence[int] = (32, 64, 128, 256),
    settings: Settings | str = "area-2010",
    reference: Reference | NDArray[np.float32] | None = None,
    repeats: int = 1,
    renderer: Renderer | None = None,
) -> Any:
    """Measure time and error by the resolution of the voxels [NPW10 Fig. 11]; see `threshold_sweep`.

    Returns
    -------
    pandas.DataFrame
        One row a pair: voxel_resolution, voxel_slices, ms, fps, fragments, rays, relative_rmse.
    """
    made = _incremental(settings).replace(visibility="voxel")
    pairs = itertools.product(resolutions, slices)
    changes = [{"voxel_resolution": r, "voxel_slices": s} for r, s in pairs]
    return _sweep(scene, camera, made, changes, reference, repeats, renderer)


def _plot(df: Any, along: str, by: str, value: str, ax: Axes | None) -> Axes:
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.figure(layout="constrained").add_subplot()
    for key, part in df.groupby(by):
        ax.plot(part[along], part[value], marker="o", label=f"{by} {key:g}")
    ax.set_xscale("log")
    ax.set_xlabel(along)
    ax.set_ylabel(value)
    ax.legend()
    return ax


def plot_thresholds(df: Any, ax: Axes | None = None) -> Axes:
    """Draw a table of `threshold_sweep`: frames a second, a line a normal threshold."""
    return _plot(df, "illumination_threshold", "normal_threshold", "fps", ax)


def plot_voxels(df: Any, ax: Axes | None = None) -> Axes:
    """Draw a table of `voxel_sweep`: error by resolution, a line a number of slices."""
    return _plot(df, "voxel_resolution", "voxel_slices", "relative_rmse", ax)
