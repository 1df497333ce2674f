"""What a render would do, before it does it."""

from __future__ import annotations

import html
from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """The passes of a frame.

    Parameters
    ----------
    passes
        Names of the passes that would run, in order; the same names as in `Stats.stages`.
    skipped
        Names of the passes that would not, each with its reason.
    """

    passes: tuple[str, ...]
    skipped: dict[str, str]

    def _rows(self) -> list[tuple[str, str]]:
        runs = [(name, "runs") for name in self.passes]
        return runs + [(name, f"left out: {reason}") for name, reason in self.skipped.items()]

    def __repr__(self) -> str:
        rows = self._rows()
        width = max((len(name) for name, _ in rows), default=0)
        return "\n".join(f"{name:<{width}}  {what}" for name, what in rows) or "no passes"

    def _repr_html_(self) -> str:
        body = "".join(
            f"<tr><td><code>{html.escape(name)}</code></td><td>{html.escape(what)}</td></tr>"
            for name, what in self._rows()
        )
        return f"<table><tr><th>pass</th><th></th></tr>{body}</table>"
