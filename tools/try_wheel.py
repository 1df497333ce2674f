"""Try a wheel as a user would: in an environment of its own, with the README's first example.

    python tools/try_wheel.py dist/miplight-*.whl

Exit code 1 if the wheel is not what it should be: one for all Pythons from 3.10 on (abi3), on Linux also for
other machines than this one (manylinux), with what it needs inside.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import venv
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INSIDE = (
    "miplight/__init__.py",
    "miplight/_core.abi3.so",
    "miplight/_core.pyi",
    "miplight/py.typed",
    "miplight/data/spot/spot.glb",
    "miplight/live_view/static/live.js",
    "miplight/live_view/static/live.css",
)
CHECK = """
import pathlib, sys
import miplight as ml
where = pathlib.Path(ml.__file__).resolve()
assert pathlib.Path(sys.prefix).resolve() in where.parents, f"miplight is imported from {where}"
assert ml.adapters(), "no adapter"
assert frame.image.any() and pathlib.Path("ball.png").stat().st_size > 1000
print(f"miplight {ml.__version__}, {frame!r}")
"""


def first_example(readme: str) -> str:
    """Return the first Python block of the README, with less to render."""
    block = re.search(r"```python\n(.*?)```", readme, re.DOTALL)
    if block is None:
        raise SystemExit("README.md has no Python block")
    return block.group(1).replace("width=512, height=512", "width=128, height=128")


def problems(wheel: Path) -> list[str]:
    """What is wrong with a wheel, as far as its name and its list of files tell."""
    name = re.fullmatch(
        r"miplight-[^-]+-(?P<python>[^-]+)-(?P<abi>[^-]+)-(?P<platform>[^-]+)\.whl", wheel.name
    )
    if name is None:
        return [f"{wheel.name} is no name of a wheel of miplight"]
    found = []
    if (name["python"], name["abi"]) != ("cp310", "abi3"):
        found.append(f"it is for {name['python']}-{name['abi']}; allowed: cp310-abi3")
    if name["platform"].startswith("linux_"):
        found.append(f"it is for {name['platform']}: other machines would not take it; allowed: manylinux")
    with zipfile.ZipFile(wheel) as archive:
        files = set(archive.namelist())
    # on Windows an extension has another suffix
    wanted = [n.replace("abi3.so", "pyd") if name["platform"].startswith("win") else n for n in INSIDE]
    found += [f"it has no {file}" for file in wanted if file not in files]
    found += [
        f"it has {file}" for file in sorted(files) if "__pycache__" in file or file.startswith("tests/")
    ]
    return found


def run_inside(wheel: Path, example: str) -> None:
    """Install the wheel in an environment of its own, and run the example and the command there."""
    # what is set here must not help it
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME", "MIPLIGHT_SHADERS")}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        venv.create(place / "venv", with_pip=True)
        binaries = place / "venv" / ("Scripts" if os.name == "nt" else "bin")
        python = str(binaries / "python")

        def run(*command: str) -> None:
            subprocess.run(command, check=True, cwd=place, env=clean)

        run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(wheel.resolve()))
        (place / "example.py").write_text(example + CHECK)
        run(python, "example.py")
        run(str(binaries / "miplight"), "info")


def main(arguments: Sequence[str] | None = None) -> int:
    """Look at each wheel, then try it."""
    parser = argparse.ArgumentParser(description="Try wheels in clean environments.")
    parser.add_argument("wheels", type=Path, nargs="+")
    parser.add_argument("--look-only", action="store_true", help="install nothing")
    options = parser.parse_args(arguments)
    example = first_example((ROOT / "README.md").read_text())
    bad = 0
    for wheel in options.wheels:
        print(f"{wheel.name}, {wheel.stat().st_size / 2**20:.1f} MiB")
        found = problems(wheel)
        if not found and not options.look_only:
            try:
                run_inside(wheel, example)
            except subprocess.CalledProcessError as error:
                found.append(f"{' '.join(map(str, error.cmd))} ended with {error.returncode}")
        for problem in found:
            print(f"  {problem}", file=sys.stderr)
        bad += bool(found)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
