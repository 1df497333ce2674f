"""Render the references that the tests compare with, and store them beside this script.

    python tests/mitsuba/make_references.py [name …]

Needs Mitsuba 3.9 with LLVM, and MIPLIGHT_SCENES for the scans; a few minutes on two cores. Run it again
after a change of `reference_scenes.py` or of `tests/claim_scenes.py`.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.mitsuba.reference_scenes import FOLDER, STORED, path_of


def main(names: list[str]) -> int:
    unknown = sorted(set(names) - set(STORED))
    if unknown:
        print(f"unknown: {', '.join(unknown)}; allowed: {', '.join(STORED)}", file=sys.stderr)
        return 2
    FOLDER.mkdir(exist_ok=True)
    for name in names or STORED:
        start = time.perf_counter()
        result = STORED[name].render(cached=False)
        result.save(path_of(name), half=True)
        size = path_of(name).stat().st_size / 1000
        print(f"{name}: {result!r}, {size:.0f} kB, {time.perf_counter() - start:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
