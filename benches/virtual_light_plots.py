"""The figures of papers A and B, redrawn from the rows of a bench."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from bounds import Row

Curves = dict[str, list[tuple[float, float]]]


def _curves(rows: list[Row], pattern: str, x: str, y: str = "value") -> Curves:
    """Curves by the first group of the pattern that a row's `what` matches; x and y by the row's names."""
    found: Curves = defaultdict(list)
    for row in rows:
        match = re.fullmatch(pattern, row["what"])
        if match:
            values = row | {
                name: float(value) for name, value in match.groupdict().items() if name != "curve"
            }
            found[match["curve"]].append((float(values[x]), float(values[y])))
    return {name: sorted(points) for name, points in found.items()}


def _draw(axes: Axes, curves: Curves, title: str, x: str, y: str, log: str = "") -> None:
    for name, points in curves.items():
        axes.plot(*zip(*points, strict=True), marker="o", markersize=3, linewidth=1.2, label=name)
    axes.set(title=title, xlabel=x, ylabel=y)
    if "x" in log:
        axes.set_xscale("log", base=2)
    if "y" in log:
        axes.set_yscale("log")
    axes.grid(alpha=0.3)
    if curves:
        axes.legend(fontsize=7)


def draw(rows: list[Row], path: Path) -> None:
    """Six figures into one PNG."""
    figure, axes = plt.subplots(2, 3, figsize=(13, 7), constrained_layout=True)
    _draw(
        axes[0, 0],
        _curves(rows, r"Fig. 9, (?P<curve>\w+) (?P<threshold>[\d.]+)", "share"),
        "error of fragments [NSW09 Fig. 9]",
        "fragments a pixel",
        "relative RMSE",
    )
    _draw(
        axes[0, 1],
        _curves(rows, r"Fig. 13, threshold (?P<x>[\d.]+), (?P<curve>at most \d+)", "x"),
        "error of cuts [NSW09 Fig. 13]",
        "threshold",
        "relative RMSE",
        "x",
    )
    _draw(
        axes[0, 2],
        _curves(rows, r"Fig. 10, (?P<curve>.+), step (?P<x>\d+), ms", "x"),
        "while the light moves [NSW09 Fig. 10]",
        "place of the light",
        "frame, ms",
    )
    _draw(
        axes[1, 0],
        _curves(rows, r"A Fig. 8, (?P<curve>\w+), (?P<x>\d+) lights, ms", "x"),
        "by virtual lights [NW09 Fig. 8]",
        "virtual lights",
        "frame, ms",
        "xy",
    )
    _draw(
        axes[1, 1],
        _curves(rows, r"A Table 1, (?P<curve>.+), ms", "size"),
        "by resolution [NW09 Table 1]",
        "width of the image",
        "frame, ms",
        "xy",
    )
    _draw(
        axes[1, 2],
        _curves(rows, r"Fig. 12, (?P<curve>down to .+), threshold (?P<x>[\d.]+), ms", "x"),
        "by depth of the tree [NSW09 Fig. 12]",
        "threshold",
        "frame, ms",
        "x",
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)
