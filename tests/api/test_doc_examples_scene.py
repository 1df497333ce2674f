"""The examples in the docstrings of scenes, materials, lights, cameras, colours and shapes run as written."""

from __future__ import annotations

import doctest
import importlib

import pytest

MODULES = ("camera", "color", "light", "material", "scene", "shapes", "spot")


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name: str) -> None:
    module = importlib.import_module(f"miplight.{name}")
    result = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 0
    assert result.failed == 0
