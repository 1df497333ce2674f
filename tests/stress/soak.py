"""Renders many frames in a process of its own and prints by how many bytes it grew for each, by kind of film.

``python -m tests.stress.soak FRAMES KIND …``
"""

from __future__ import annotations

import gc
import json
import os
import sys
import warnings
from pathlib import Path

import miplight as ml
from tests.stress.common import quick
from tests.stress.films import HOW, Film

SMALL = {"light_samples": 16}
SOAKS: dict[str, tuple[ml.Settings, bool]] = {
    "brute-force": (quick("brute-force", **SMALL), True),
    "final-gather": (quick("brute-force", indirect="final-gather", gather_rays=4, **SMALL), True),
    "default": (quick("default"), False),
    "default, pictures": (quick("default"), True),
    "area-2010": (HOW[2], False),
    "area-2016": (quick("area-2016", **SMALL), False),
    "radiosity-2009": (HOW[3], False),
}
"""Settings, and whether the light shows pictures."""


def resident() -> int:
    """Resident memory of this process, bytes."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def growth(renderer: ml.Renderer, kind: str, frames: int, keep: list[ml.Frame] | None = None) -> float:
    """Bytes a frame, after half as many frames to warm up."""
    how, pictures = SOAKS[kind]
    film = Film(99, pictures=pictures)
    for step in range(frames // 2):
        film.frame(renderer, step, how)
    before = resident()
    for step in range(frames):
        frame = film.frame(renderer, step, how)
        if keep is not None:
            keep.append(frame)
    return (resident() - before) / frames


def renderers(adapter: str, count: int) -> float:
    """Bytes a renderer that rendered one frame and was closed, or forgotten; after as many to warm up."""

    def make() -> None:
        for number in range(count):
            own = ml.Renderer(adapter)
            Film(number).frame(own, 0)
            if number % 2:
                own.close()

    make()
    before = resident()
    make()
    return (resident() - before) / count


def main(frames: int, kinds: list[str]) -> None:
    """Print one JSON object; films whose frames are kept come last, for comparison."""
    warnings.simplefilter("ignore")
    adapter = os.environ.get("MIPLIGHT_ADAPTER", "auto")
    with ml.Renderer(adapter) as renderer:
        found = {kind: growth(renderer, kind, frames) for kind in kinds}
        kept: list[ml.Frame] = []
        found["frames that are kept"] = growth(renderer, "brute-force", frames, kept)
        found["renderers"] = renderers(adapter, max(frames // 20, 3))
    print(json.dumps(found))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
