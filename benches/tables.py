"""Measurements as Markdown."""

from __future__ import annotations

from typing import Any


def line(row: dict[str, Any]) -> str:
    """One workload in one line, for the terminal."""
    error = row.get("error", {}).get("relative_rmse")
    shown = "" if error is None else f", relative RMSE {error:.4f}"
    return (
        f"{row['workload']:<20} {row['wall_ms']:9.1f} ms, {row['rays'] / 1e6:7.2f} M rays, "
        f"{row['rays_per_second'] / 1e6:6.1f} M rays/s{shown}"
    )


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|---" + "|--:" * (len(head) - 1) + "|"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def _number(value: float | None, digits: int = 1) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _frames(rows: list[dict[str, Any]]) -> str:
    head = ["workload", "pixels", "triangles", "lights", "samples", "frame ms", "still ms", "light-only ms"]
    head += ["M rays", "M rays/s", "relative RMSE", "untrimmed", "median"]
    body = []
    for row in rows:
        error = row.get("error", {})
        width, height = row["size"]
        cells = [row["workload"], f"{width} × {height}", f"{row['triangles']:,}", str(row["lights"])]
        cells += [str(row["settings"]["light_samples"]), _number(row["wall_ms"])]
        cells += [_number(row.get("still_ms")), _number(row.get("light_only_ms"))]
        cells += [_number(row["rays"] / 1e6, 2), _number(row["rays_per_second"] / 1e6)]
        names = ("relative_rmse", "relative_rmse_untrimmed", "median_relative_error")
        body.append(cells + [_number(error.get(name), 4) for name in names])
    return _table(head, body)


def _passes(rows: list[dict[str, Any]]) -> str:
    names = list(dict.fromkeys(name for row in rows for name in row["stages"]))
    body = [[f"`{name}`", *[_number(row["stages"].get(name)) for row in rows]] for name in names]
    body.append(["total", *[_number(row["total_ms"]) for row in rows]])
    return _table(["pass, ms", *[row["workload"] for row in rows]], body)


def _mitsuba(rows: list[dict[str, Any]]) -> str:
    head = ["workload", "sampler", "samples", "ms", "relative RMSE", "median"]
    body = []
    for row in rows:
        for entry in row.get("mitsuba", []):
            cells = [row["workload"], entry["sampler"], str(entry["spp"]), _number(entry["ms"])]
            cells += [_number(entry["relative_rmse"], 4), _number(entry["median_relative_error"], 4)]
            body.append(cells)
    if not body:
        return ""
    equal = [
        [
            row["workload"],
            _number(row["wall_ms"]),
            _number(row.get("mitsuba_to_our_error_ms")) or "not between",
        ]
        for row in rows
    ]
    note = "Times to the same error, Mitsuba's between 16 and 1,024 multijittered samples:"
    return "\n\n".join([_table(head, body), note, _table(["workload", "ours, ms", "Mitsuba, ms"], equal)])


def _rates(rates: list[dict[str, Any]]) -> str:
    head = ["rays", "triangles", "form", "M rays/s"]
    body = [
        [rate["kind"], f"{rate['triangles']:,}", rate["form"], _number(rate["rays_per_second"] / 1e6)]
        for rate in rates
    ]
    return _table(head, body) if body else ""


def markdown(result: dict[str, Any]) -> str:
    """All tables of one run."""
    rows = result["rows"]
    parts = [
        f"# {result['adapter']}",
        f"{result['driver']}, {result['backend']}, {result['trace']} rays; {result['machine']}; "
        f"version {result['version']}, commit {result['commit']}, {result['date']}.",
        "Wall time of a render with outputs image and fragments, the median of five after two (one, if "
        "a frame takes more than five seconds); the camera and every light change a little before each. A "
        "still frame changes nothing, a light-only frame the radiance.",
        "## Frames",
        _frames(rows),
        "## Passes",
        _passes(rows),
    ]
    mitsuba, rates = _mitsuba(rows), _rates(result["trace_rates"])
    if mitsuba:
        parts += ["## Mitsuba in the same run", mitsuba]
    if rates:
        parts += ["## The trace by itself", rates]
    return "\n\n".join(parts) + "\n"
