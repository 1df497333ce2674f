"""What got slower or less accurate between two results of `make bench`; exit code 1 if anything did.

    python benches/compare.py OLD.json NEW.json

A time is flagged where it grew by more than a band of noise. Where both runs timed Mitsuba on the same work,
the middle ratio of its times says how much slower or faster the machine was, and ours are taken relative to
that. Times of different machines are not compared, errors are: they have a band of their own.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TIMES = ("wall_ms", "still_ms", "light_only_ms")
ERRORS = ("relative_rmse", "relative_rmse_untrimmed", "median_relative_error")
MACHINE = ("adapter", "backend", "trace", "machine")
ENOUGH = 3  # times of Mitsuba below which their middle says little
PASSES = 3  # of a row that got slower, those that grew most


class NoResultError(Exception):
    """A file that is no result of benches/run.py, or two that have nothing in common."""


@dataclass(frozen=True)
class Change:
    """One number in both runs.

    Parameters
    ----------
    row, what
        Workload and size, or rays and triangles; the name of the number.
    old, new
        Its values; less is better.
    ratio
        New over old, without the drift of the machine: 1 is as before.
    worse, better
        Outside of the band of noise.
    why
        Passes that grew most, where it is a time that got worse.
    """

    row: str
    what: str
    old: float
    new: float
    ratio: float
    worse: bool
    better: bool
    why: str = ""


def load(path: Path) -> dict[str, Any]:
    """A result of benches/run.py.

    Raises
    ------
    NoResultError
        If it is something else.
    """
    try:
        result = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise NoResultError(f"{path} cannot be read: {error}") from error
    rows = result.get("rows") if isinstance(result, dict) else None
    if not isinstance(rows, list) or not all(
        isinstance(r, dict) and {"workload", "wall_ms"} <= r.keys() for r in rows
    ):
        raise NoResultError(
            f"{path} is no result of benches/run.py: it has no rows with workload and wall_ms"
        )
    return dict(result)


def _key(row: dict[str, Any]) -> str:
    width, height = row["size"]
    return f"{row['workload']}, {width} × {height}"


def pairs(old: dict[str, Any], new: dict[str, Any]) -> tuple[list[tuple[str, Any, Any]], list[str]]:
    """Rows of the same work in both runs, and notes on those that have no partner or other settings."""
    before, after = ({_key(row): row for row in result["rows"]} for result in (old, new))
    found, notes = [], []
    for key in dict.fromkeys([*before, *after]):
        if key not in before or key not in after:
            notes.append(f"left out: {key}: only in the {'new' if key in after else 'old'} run")
            continue
        a, b = before[key], after[key]
        parts = [
            f"{name} {a[name]:,} → {b[name]:,}" for name in ("triangles", "lights") if a[name] != b[name]
        ]
        if parts:
            notes.append(f"left out: {key}: not the same scene, {', '.join(parts)}")
            continue
        # a preset that was changed is what is looked for; a setting that only one version has says nothing
        shared = [name for name in a["settings"] if name in b["settings"]]
        told = [(name, a["settings"][name], b["settings"][name]) for name in shared]
        listed = [f"{name} {was!r} → {now!r}" for name, was, now in told if was != now]
        if listed:
            notes.append(f"settings: {key}: {', '.join(listed)}")
        found.append((key, a, b))
    return found, notes


def _by_mitsuba(row: dict[str, Any]) -> dict[tuple[str, int], float]:
    return {(entry["sampler"], entry["spp"]): entry["ms"] for entry in row.get("mitsuba", [])}


def drift(rows: Sequence[tuple[str, Any, Any]]) -> float | None:
    """How much longer the same work took Mitsuba in the new run, the middle of all ratios.

    None if too little of it is in both runs.
    """
    ratios = []
    for _, a, b in rows:
        before, after = _by_mitsuba(a), _by_mitsuba(b)
        ratios += [after[key] / before[key] for key in before.keys() & after.keys() if before[key] > 0]
    return statistics.median(ratios) if len(ratios) >= ENOUGH else None


def _change(
    row: str, what: str, old: float, new: float, scale: float, band: float, least: float, why: str = ""
) -> Change:
    value = new / scale
    ratio = value / old if old > 0 else (1.0 if value <= 0 else math.inf)
    far = abs(value - old) > least
    # what is no number compares as false with everything: it is worse than any
    worse = not math.isfinite(value) or (far and ratio > 1.0 + band)
    better = far and ratio < 1.0 / (1.0 + band)
    return Change(row, what, old, new, ratio, worse, better, why if worse else "")


def _grown(a: dict[str, Any], b: dict[str, Any], scale: float) -> str:
    """The passes of a row that grew most."""
    before, after = a.get("stages", {}), b.get("stages", {})
    growth = {name: ms / scale - before.get(name, 0.0) for name, ms in after.items()}
    most = sorted((name for name in growth if growth[name] > 0), key=lambda name: -growth[name])[:PASSES]
    return ", ".join(f"{name} {before.get(name, 0.0):.2f} → {after[name]:.2f}" for name in most)


def changes(
    rows: Sequence[tuple[str, Any, Any]], scale: float | None, options: argparse.Namespace
) -> Iterator[Change]:
    """Every time and error that both runs have; no times where `scale` is None."""
    for key, a, b in rows:
        for name in TIMES if scale is not None else ():
            if a.get(name) is not None and b.get(name) is not None:
                why = _grown(a, b, scale or 1.0) if name == "wall_ms" else ""
                yield _change(key, name, a[name], b[name], scale or 1.0, options.noise, options.least_ms, why)
        before, after = a.get("error", {}), b.get("error", {})
        for name in ERRORS:
            if name in before and name in after:
                yield _change(
                    key, name, before[name], after[name], 1.0, options.error_noise, options.least_error
                )


def rates(
    old: dict[str, Any], new: dict[str, Any], scale: float, options: argparse.Namespace
) -> Iterator[Change]:
    """Nanoseconds a ray of the trace by itself."""
    before, after = (
        {
            f"{rate['kind']} rays, {rate['triangles']:,} triangles, {rate['form']}": rate["rays_per_second"]
            for rate in result.get("trace_rates") or []
        }
        for result in (old, new)
    )
    for key in before:
        if key in after and "mitsuba" not in key.lower():
            yield _change(key, "ns a ray", 1e9 / before[key], 1e9 / after[key], scale, options.noise, 0.0)


def _line(change: Change) -> str:
    mark = "WORSE " if change.worse else "better" if change.better else "      "
    why = f"  ({change.why})" if change.why else ""
    values = f"{change.old:>11.5g} → {change.new:<11.5g} × {change.ratio:.3f}"
    return f"{mark} {change.row:<44} {change.what:<24} {values}{why}"


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--noise", type=float, default=0.15, help="band of times, relative (0.15)")
    parser.add_argument("--error-noise", type=float, default=0.05, help="band of errors, relative (0.05)")
    parser.add_argument(
        "--least-ms", type=float, default=0.2, help="differences of times that never count (0.2)"
    )
    parser.add_argument("--least-error", type=float, default=1e-5, help="and of errors (1e-5)")
    parser.add_argument("--all", action="store_true", help="print what is as before, too")
    options = parser.parse_args(arguments)
    if min(options.noise, options.error_noise, options.least_ms, options.least_error) < 0:
        parser.error("a band is negative; allowed: a number from 0")
    return options


def report(old: dict[str, Any], new: dict[str, Any], options: argparse.Namespace) -> bool:
    """Print the comparison; True if anything is worse.

    Raises
    ------
    NoResultError
        If the two have no work in common.
    """
    rows, notes = pairs(old, new)
    print(f"old: {old.get('adapter')}, commit {old.get('commit')}, {old.get('date')}")
    print(f"new: {new.get('adapter')}, commit {new.get('commit')}, {new.get('date')}")
    for note in notes:
        print(note)
    if not rows:
        raise NoResultError("the two have no work in common")
    other = [name for name in MACHINE if old.get(name) != new.get(name)]
    scale: float | None = None
    found: list[Change] = []
    if other:
        print(f"times are not compared, the runs differ in {', '.join(other)}")
    else:
        measured = drift(rows)
        scale = 1.0 if measured is None else measured
        print(
            "no drift is known, Mitsuba was not timed"
            if measured is None
            else f"drift of the machine: × {scale:.3f}"
        )
        found += rates(old, new, scale, options)
    found = [*changes(rows, scale, options), *found]
    for change in found:
        if options.all or change.worse or change.better:
            print(_line(change))
    worse = sum(change.worse for change in found)
    print(f"{len(found)} numbers: {worse} worse, {sum(c.better for c in found)} better")
    return worse > 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare two files; 0: nothing is worse, 1: something is, 2: they cannot be compared."""
    options = _arguments(arguments)
    try:
        return int(report(load(options.old), load(options.new), options))
    except NoResultError as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
