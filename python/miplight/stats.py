"""What a frame cost: times of its passes, rays, evaluations, and what was left out or rebuilt."""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Stats:
    """Times and counts of one frame.

    Parameters
    ----------
    total_ms
        Wall time of the render without readback, milliseconds.
    stages
        Milliseconds of each pass that ran, by its name, in the order in which they ran: GPU timestamps where
        the adapter has them. They add up to `total_ms` within 10 %.
    readback_ms
        Milliseconds spent on bringing outputs to the host, so far.
    rays
        Rays traced.
    light_evaluations
        Pairs of a shading point and a light sample, or a virtual light, that were evaluated.
    skipped
        Passes that the plan left out, each with its reason.
    empty
        Passes that turned out to have nothing to work on.
    rebuilt
        What was built again or uploaded again since the renderer's last frame.
    adapter
        Name of the adapter.
    levels
        What incremental refinement did, coarse to fine: for each level ``{"nodes": texels that were looked
        at, "ms": milliseconds}``; the times are parts of `stages`. Empty with any other refinement.
    """

    total_ms: float
    stages: dict[str, float]
    readback_ms: float
    rays: int
    light_evaluations: int
    skipped: dict[str, str]
    empty: list[str]
    rebuilt: list[str]
    adapter: str
    levels: dict[int, dict[str, float]] = field(default_factory=dict)
    other: dict[str, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Stats:
        """Stats from what `to_dict` gives; names that this version does not know are kept in `other`."""
        known = {f.name for f in fields(cls)} - {"other"}
        other = {name: value for name, value in values.items() if name not in known}
        levels = {int(level): dict(row) for level, row in values.get("levels", {}).items()}
        fields_ = {name: values[name] for name in known - {"levels"}} | {"empty": list(values["empty"])}
        return cls(**fields_, levels=levels, other=other)

    def to_dict(self) -> dict[str, Any]:
        """Every time and count by name; plain values that JSON can hold."""
        values: dict[str, Any] = asdict(self)
        values.update(values.pop("other"))
        return values

    def __str__(self) -> str:
        width = max([len(name) for name in self.stages] + [len("readback")])
        rows = [f"{name:<{width}}  {ms:10.3f} ms" for name, ms in self.stages.items()]
        rows.append(f"{'total':<{width}}  {self.total_ms:10.3f} ms")
        rows.append(f"{'readback':<{width}}  {self.readback_ms:10.3f} ms")
        rows.append(f"{self.rays:,} rays, {self.light_evaluations:,} light evaluations, on {self.adapter}")
        rows += [f"left out: {name}: {reason}" for name, reason in self.skipped.items()]
        if self.empty:
            rows.append(f"empty: {', '.join(self.empty)}")
        if self.rebuilt:
            rows.append(f"rebuilt: {', '.join(self.rebuilt)}")
        return "\n".join(rows)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(name)}</td><td style='text-align:right'>{ms:.3f}</td></tr>"
            for name, ms in [*self.stages.items(), ("total", self.total_ms), ("readback", self.readback_ms)]
        )
        note = f"{self.rays:,} rays, {self.light_evaluations:,} light evaluations, on {self.adapter}"
        return f"<table><caption>{html.escape(note)}</caption><tr><th>pass</th><th>ms</th></tr>{rows}</table>"
