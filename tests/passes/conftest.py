"""One device that runs single shaders, and the generator that makes their input."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from miplight import _core

# the references are imported as tests.passes.reference.…
_ROOT = str(Path(__file__).parents[2])
if _ROOT not in sys.path:
    sys.path.insert(0, _ROOT)

from tests.passes.reference.run import Runner  # noqa: E402 (needs the path above)


@pytest.fixture(scope="session")
def runner(adapter: str) -> Runner:
    """Runs one shader on given arrays; shared by all tests of passes."""
    return Runner(_core.KernelRunner(adapter))


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20100629)
