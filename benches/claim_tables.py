"""Rows of `claims.py` as text and Markdown, and fragment maps as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import miplight as ml

_COLUMNS = {
    "relative_rmse": ("RMSE", 7, ".4f"),
    "untrimmed": ("untrim", 7, ".4f"),
    "median": ("median", 7, ".4f"),
    "rays_a_pixel": ("rays/px", 8, ".2f"),
    "fragments_a_pixel": ("frag/px", 8, ".3f"),
    "wall_ms": ("ms", 8, ".1f"),
}
HEAD = (
    f"{'scene':<18}{'size':>5}"
    + "".join(f"{title:>{width + 1}}" for title, width, _ in _COLUMNS.values())
    + f"{'peer ms':>10}{'faster':>8}  verdict"
)


def _cells(row: dict[str, Any]) -> list[str]:
    cells = [format(row[name], form) if name in row else "" for name, (_, _, form) in _COLUMNS.items()]
    peer = row.get("peer")
    cells.append(f"{peer['bound'].replace('=', '')}{peer['ms']:.1f}" if peer else "")
    cells.append(f"{row['faster']:.2f}" if "faster" in row else "")
    return cells


def line(row: dict[str, Any]) -> str:
    """One row for the terminal."""
    widths = [width + 1 for _, width, _ in _COLUMNS.values()] + [10, 8]
    text = "".join(f"{cell:>{width}}" for cell, width in zip(_cells(row), widths, strict=True))
    verdict = f"FAIL {'; '.join(row['broken'])}" if row["broken"] else "pass"
    name = f"  {row['change']}" if row["change"] else row["scene"]
    return f"{name:<18}{row['size']:>5}{text}  {verdict}"


def stages(row: dict[str, Any]) -> str:
    """The passes of a row's frame, longest first."""
    parts = sorted(row["stages"].items(), key=lambda item: -item[1])
    counts = ", ".join(f"{level}: {count:,}" for level, count in enumerate(row["counts"]))
    shown = "".join(f"    {name:<32}{ms:8.2f} ms\n" for name, ms in parts if ms >= 0.05)
    return f"{shown}    levels {counts}; {row['shadow_rays']:,} shadow rays"


def markdown(rows: list[dict[str, Any]]) -> str:
    """All rows as one table."""
    head = [
        "scene",
        "size",
        *[title for title, _, _ in _COLUMNS.values()],
        "peer ms",
        "times faster",
        "broken",
    ]
    lines = ["| " + " | ".join(head) + " |", "|---" + "|--:" * (len(head) - 2) + "|---|"]
    for row in rows:
        name = f"{row['scene']}, {row['change']}" if row["change"] else row["scene"]
        cells = [name, str(row["size"]), *_cells(row), "; ".join(row["broken"]) or "–"]
        lines.append("| " + " | ".join(cells) + " |")
    note = (
        "Errors against Mitsuba (pixel centres, direct light), the worst 0.1 % left out, and all of them; "
        "rays of all kinds and fragments a pixel that sees a surface. The peer at 256 and 512 is Mitsuba at "
        "its best, at our error (<: its 16 samples are better already, >: its 1,024 are not good enough); "
        "at 1024 it is `brute-force` with 256 samples."
    )
    return f"# Claims about direct light\n\n{note}\n\n" + "\n".join(lines) + "\n"


def write_maps(frame: ml.Frame, folder: Path) -> None:
    """Level and reason maps of a frame as a picture."""
    from matplotlib import pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    figure = plt.figure(figsize=(15, 6), layout="constrained")
    for column, by in enumerate(("level", "reason"), 1):
        frame.fragments.plot(figure.add_subplot(1, 2, column), by)
    figure.savefig(folder / "fragments.png", dpi=110)
    plt.close(figure)
