"""Mitsuba under one variant, a cache of its own, and the scenes that references are stored for."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import miplight as ml

ml.mitsuba.pick_variant()  # before any test imports Mitsuba, which fixes the LLVM that it uses

# the scripts and tests of this folder share modules: they are imported as tests.mitsuba.…
sys.path.insert(0, str(Path(__file__).parents[2]))


@pytest.fixture(scope="session", autouse=True)
def reference_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache that no earlier run has filled, unless MIPLIGHT_CACHE names one."""
    before = os.environ.get("MIPLIGHT_CACHE")
    folder = Path(before) if before else tmp_path_factory.mktemp("cache")
    os.environ["MIPLIGHT_CACHE"] = str(folder)
    yield folder
    if before is None:
        del os.environ["MIPLIGHT_CACHE"]


@pytest.fixture
def mi() -> Iterator[Any]:
    """Mitsuba, with the variant active that references use."""
    with ml.mitsuba.activate() as module:
        yield module
