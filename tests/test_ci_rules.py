"""The rule that no skip is silent, tried on tests that skip."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ALLOWED_SKIP

ROOT = Path(__file__).resolve().parent.parent
SUITE = {
    "test_mark.py": "import pytest\n@pytest.mark.skip(reason='no time')\ndef test_it(): pass\n",
    "test_call.py": "import pytest\ndef test_it(): pytest.skip('no time')\n",
    "test_module.py": "import pytest\npytest.importorskip('no_such_module_at_all')\ndef test_it(): pass\n",
    "test_xfail.py": "import pytest\n@pytest.mark.xfail\ndef test_it(): assert False\n",
    "test_scenes.py": "def test_it(scenes_folder): pass\n",
    "test_passes.py": "def test_it(): pass\n",
}


@pytest.mark.parametrize(
    ("in_ci", "expected"),
    [(True, {"test_mark", "test_call", "test_module"}), (False, set())],
    ids=["in CI", "at home"],
)
def test_skips(tmp_path: Path, in_ci: bool, expected: set[str]) -> None:
    for name, text in SUITE.items():
        (tmp_path / name).write_text(text)
    kept = {name: value for name, value in os.environ.items() if name not in ("CI", "MIPLIGHT_SCENES")}
    environment = kept | ({"CI": "true"} if in_ci else {}) | {"PYTHONPATH": str(ROOT)}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "tests.conftest",
        "-q",
        "-rA",
        "--continue-on-collection-errors",
    ]
    done = subprocess.run(
        [*command, "-c", os.devnull, "--rootdir", str(tmp_path), str(tmp_path)],
        capture_output=True,
        text=True,
        env=environment,
        cwd=tmp_path,
        timeout=120,
        check=False,
    )
    lines = done.stdout.splitlines()
    failed = {
        Path(line.split()[1].split("::")[0]).stem for line in lines if line.startswith(("FAILED", "ERROR "))
    }
    assert failed == expected, done.stdout
    assert ALLOWED_SKIP in done.stdout
    assert (
        any(line.startswith("PASSED") and "test_passes" in line for line in lines) or "test_module" in failed
    )
