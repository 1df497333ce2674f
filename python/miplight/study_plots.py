"""What a sweep says: the rows that nothing beats, error against time, and pictures beside their reference."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .notebook import auto_exposure, checked_exposure, to_srgb8
from .study_rows import STAGE
from .testing import compare as compared
from .validate import fail, nearest_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ._pixels import AnyReference
    from .frame import Frame

__all__ = ["compare", "medians", "pareto", "plot"]

_TIMES = ("ms", "total_ms", "readback_ms")


def medians(df: Any) -> Any:
    """Join the repeats of each point: one row a point, with the median of each time.

    Parameters
    ----------
    df : pandas.DataFrame
        Of `miplight.study.sweep`.

    Returns
    -------
    pandas.DataFrame
        In the order of the first repeats, whose other values are kept. Repeats that failed do not count,
        unless all did.

    Raises
    ------
    SettingsError
        If the table has no column ``point``.
    """
    _columns(df, "point")
    times = [name for name in df.columns if name in _TIMES or str(name).startswith(STAGE)]
    rows = df
    if "error" in df.columns:
        # with a stable sort a repeat that succeeded comes first
        rows = df.iloc[np.argsort(df["error"].notna().to_numpy(), kind="stable")]
    joined = rows.drop_duplicates("point").set_index("point")
    middle = rows.groupby("point", sort=False)[times].median()
    joined[times] = middle.loc[joined.index]
    order = df["point"].drop_duplicates()
    return joined.loc[order].reset_index()[list(df.columns)]


def pareto(df: Any, time: str = "ms", error: str = "relative_rmse") -> Any:
    """Keep the rows that no other row beats in both time and error.

    A row beats another if it is no worse in either and better in one; rows that are equal in both do not beat
    each other. With repeats the luckiest ones win: take `medians` first.

    Parameters
    ----------
    df : pandas.DataFrame
        One row a render; those without a time or an error are left out.
    time, error
        Columns, less is better.

    Returns
    -------
    pandas.DataFrame
        Rows of `df` with their index, by rising time and falling error.

    Raises
    ------
    SettingsError
        If there is no such column.
    """
    _columns(df, time, error)
    values = df[[time, error]].to_numpy(dtype=np.float64, na_value=np.nan)
    there = np.flatnonzero(~np.isnan(values).any(axis=1))
    # by time, among equal times by error; lexsort is stable, so equal rows keep their order
    order = there[np.lexsort((values[there, 1], values[there, 0]))]
    return df.iloc[order[_unbeaten(values[order])]]


def _unbeaten(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Of sorted (N, 2) times and errors: a lower error than all before, or equal to the last one kept."""
    kept = np.zeros(len(values), np.bool_)
    best: NDArray[np.float64] | None = None
    for index, row in enumerate(values):
        kept[index] = best is None or row[1] < best[1] or bool((row == best).all())
        if kept[index]:
            best = row
    return kept


def plot(df: Any, ax: Axes | None = None, *, time: str = "ms", error: str = "relative_rmse") -> Axes:
    """Draw error against time, both logarithmic: a curve for each preset, and the Pareto front.

    Repeats are joined by `medians`. Each camera and each set of lights has curves of its own. An error of
    exactly zero has no place on a logarithmic axis and is not drawn.

    Parameters
    ----------
    df : pandas.DataFrame
        Of `miplight.study.sweep`.
    ax
        Where to draw; a new figure by default.
    time, error
        Columns; milliseconds, and a relative error.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SettingsError
        If there is no such column, or no row that can be drawn.
    """
    _columns(df, time, error, "preset")
    rows = medians(df) if "point" in df.columns else df
    drawn = rows[(rows[time] > 0) & (rows[error] > 0) & np.isfinite(rows[error].astype("float64"))]
    if not len(drawn):
        raise SettingsError(
            f"df has no row with {time} and {error} above zero; allowed: a sweep with a reference"
        )
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.figure(layout="constrained").add_subplot()
    places = [name for name in ("camera", "lights") if name in drawn.columns and drawn[name].nunique() > 1]
    for name, part in drawn.groupby(["preset", *places], sort=False):
        ordered = part.sort_values(time, kind="stable")
        label = ", ".join(str(word) or "settings" for word in np.atleast_1d(np.array(name, dtype=object)))
        ax.plot(ordered[time], ordered[error], marker="o", alpha=0.8, label=label)
    front = pareto(drawn, time, error)
    # what no point reaches lies below the steps
    ax.plot(
        front[time], front[error], "k--", drawstyle="steps-post", linewidth=1, label="Pareto front", zorder=1
    )
    ax.set(xscale="log", yscale="log", xlabel=f"{time}, ms" if time != "ms" else "time, ms")
    ax.set_ylabel(error.replace("_", " ").replace("rmse", "RMSE"))
    ax.legend()
    return ax


def compare(frame: Frame, reference: AnyReference, exposure: float | None = None) -> Figure:
    """Draw a frame, its reference, the error and the fragments side by side.

    Parameters
    ----------
    frame
        Rendered by miplight. The part of it that the reference is: ``.direct`` or ``.indirect`` if the
        `Reference` says so, else ``.image``.
    reference
        (H, W, 3) linear radiance, or a `miplight.mitsuba.Reference`.
    exposure
        Stops, for both pictures; by default one that suits the reference.

    Returns
    -------
    matplotlib.figure.Figure
        Four axes and a colour bar. The error is the mean over RGB of |I − R|, relative to the mean radiance
        of the reference, over the pixels that see a surface which is no light.

    Raises
    ------
    SettingsError
        For shapes that do not fit, values that are not finite or an exposure that is no number.
    """
    from matplotlib import pyplot as plt

    found = compared(frame, reference)
    stops = checked_exposure(exposure)
    if stops is None:
        stops = auto_exposure(found.reference, found.mask)
    level = float(found.reference[found.mask].mean(dtype=np.float64)) or 1.0
    error = np.ma.masked_array(np.abs(found.image - found.reference).mean(axis=-1) / level, ~found.mask)
    height, width = found.mask.shape
    size = (3.4 * 4 + 3.0, 3.4 * height / width + 0.9)
    figure, axes = plt.subplots(1, 4, layout="constrained", figsize=size)
    axes[0].imshow(to_srgb8(found.image, stops))
    axes[0].set_title(f"miplight, {frame.stats.total_ms:,.1f} ms")
    axes[1].imshow(to_srgb8(found.reference, stops))
    axes[1].set_title("reference")
    # a few pixels on edges may err by far more than all others
    top = max(float(np.percentile(error.compressed(), 99.5)), 1e-6)
    shown = axes[2].imshow(error, cmap="magma", vmin=0.0, vmax=top, interpolation="nearest")
    axes[2].set_title(f"error, relative RMSE {found.relative_rmse:.2%}")
    figure.colorbar(shown, ax=axes[2], shrink=0.8)
    frame.fragments.plot(axes[3])
    for ax in axes:
        ax.set_axis_off()
    return figure


def _columns(df: Any, *names: str) -> None:
    """Check that a table has these columns."""
    if not hasattr(df, "columns"):
        fail("df", df, "a table of miplight.study.sweep", SettingsError)
    for name in names:
        if name not in df.columns:
            hint = nearest_name(str(name), map(str, df.columns))
            raise SettingsError(f"df has no column {name!r}{hint}; allowed: a table of miplight.study.sweep")
