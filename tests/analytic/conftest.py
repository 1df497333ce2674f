"""What the tests of closed forms share: settings, and modules of this folder by name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import miplight as ml

# shared modules are imported as tests.analytic.…
_ROOT = str(Path(__file__).parents[2])
if _ROOT not in sys.path:
    sys.path.insert(0, _ROOT)


@pytest.fixture
def grid() -> ml.Settings:
    """Every sample in the middle of its stratum: no noise, only the error of the midpoint rule."""
    return ml.Settings.preset("brute-force").replace(light_pattern="grid", light_samples=1024)


@pytest.fixture
def gather() -> ml.Settings:
    """One bounce of indirect light by hemisphere rays."""
    return ml.Settings.preset("brute-force").replace(
        indirect="final-gather", gather_rays=256, light_samples=64
    )
