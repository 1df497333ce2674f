"""What the docs say can be run: the README's example, and the examples in docstrings."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt

import miplight as ml

ROOT = Path(__file__).resolve().parent.parent
# importing these does more than define things
NOT_IMPORTED = {"miplight.testing_plugin", "miplight.__main__"}


def _modules() -> list[str]:
    found = pkgutil.walk_packages(ml.__path__, "miplight.")
    return sorted(module.name for module in found if module.name not in NOT_IMPORTED)


@pytest.mark.parametrize("name", _modules())
def test_examples_in_docstrings(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0


def _small(block: str) -> str:
    """A block of the README with less to render."""
    sizes = {"width=512, height=512": "width=64, height=64", "spp=1024": "spp=16", "repeats=5": "repeats=2"}
    for large, small in sizes.items():
        block = block.replace(large, small)
    return block


@pytest.mark.mitsuba
def test_the_readme_s_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "README.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 2
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(_small(blocks[0]), names)
    frame = names["frame"]
    assert isinstance(frame, ml.Frame)
    assert np.isfinite(frame.image).all()
    assert frame.image.any()
    assert (tmp_path / "ball.png").is_file()
    exec(_small(blocks[1]), names)
    assert len(ml.study.load(tmp_path / "sweep.parquet")) == 12
    plt.close("all")
