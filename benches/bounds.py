"""Tables of what a preset must show: each row with its bound, pass or FAIL."""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import miplight as ml
from run import RESULTS, about

Row = dict[str, Any]
Parts = dict[str, Callable[[ml.Renderer, argparse.Namespace], Iterator[Row]]]


def row(
    what: str,
    scene: str,
    size: int | str,
    value: float,
    bound: float | None,
    least: bool = False,
    **more: Any,
) -> Row:
    """One row: what was found in which scene, and the largest (or, `least`, smallest) value that passes.

    Without a bound it is only reported.
    """
    found = {"what": what, "scene": scene, "size": size, "value": value}
    if bound is None:
        return found | {"bound": "", "good": True} | more
    good = value >= bound if least else value <= bound
    sign = "≥" if least else "≤"
    return found | {"bound": f"{sign} {bound:g}", "good": bool(good)} | more


def _verdict(found: Row) -> str:
    return ("pass" if found["good"] else "FAIL") if found["bound"] else ""


def _markdown(rows: list[Row], facts: dict[str, Any]) -> str:
    lines = [f"{facts['adapter']}, {facts['machine']}, {facts['date']}, commit {facts['commit']}", ""]
    lines += [facts["note"], ""] if facts.get("note") else []
    lines += ["| what | scene | size | found | bound | |", "|---|---|--:|--:|--:|---|"]
    for found in rows:
        verdict = _verdict(found).replace("FAIL", "**FAIL**")
        value = f"{found['size']} | {found['value']:.4g} | {found['bound']}"
        lines.append(f"| {found['what']} | {found['scene']} | {value} | {verdict} |")
    return "\n".join(lines) + "\n"


def _line(found: Row) -> str:
    verdict = _verdict(found)
    where = f"{found['what']:<52}{found['scene']:<22}{found['size']:>10}"
    return f"{where}{found['value']:>10.4f}  {found['bound']:<8}{verdict}"


def main(
    parts: Parts,
    stem: str,
    description: str | None,
    more: Callable[[list[Row]], str] | None = None,
) -> int:
    """Run the parts, print a line a row; unless it is quick, write the table and what `more` adds to it."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=parts, default=list(parts))
    parser.add_argument("--quick", action="store_true", help="small and rough; nothing is written")
    parser.add_argument("--adapter", default="auto")
    parser.add_argument("--note", default="", help="what a reader must know of this run, above the table")
    options = parser.parse_args()
    warnings.simplefilter("ignore", ml.SoftwareAdapterWarning)
    rows: list[Row] = []
    with ml.Renderer(options.adapter) as renderer:
        for part in options.only:
            for found in parts[part](renderer, options):
                rows.append(found)
                print(_line(found), flush=True)
        facts = about(renderer) | ({"note": options.note} if options.note else {})
    if not options.quick:
        (RESULTS / f"{stem}.json").write_text(
            json.dumps({"about": facts, "rows": rows}, indent=1, default=float) + "\n"
        )
        (RESULTS / f"{stem}.md").write_text(_markdown(rows, facts) + (more(rows) if more else ""))
    return int(not all(found["good"] for found in rows) and not options.quick)
