"""Pytest plugin, found through the entry point ``pytest11``: the fixture ``match_reference``.

>>> def test_room(match_reference):  # doctest: +SKIP
...     match_reference(frame, reference, relative_rmse=0.015, median=0.006)

It is `miplight.testing.assert_matches`; when it fails, image, reference and error picture (PNG and EXR) and
all numbers are written to a folder named after the test, below ``--miplight-failures`` (``tests/failures`` if
there is a folder ``tests``, else ``miplight-failures``).
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .testing import Comparison

__all__ = ["match_reference", "pytest_addoption"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that says where failures go."""
    parser.getgroup("miplight").addoption(
        "--miplight-failures",
        default=None,
        metavar="DIR",
        help="where match_reference writes pictures of failed comparisons",
    )


@pytest.fixture
def match_reference(request: pytest.FixtureRequest) -> Callable[..., Comparison]:
    """``assert_matches`` that writes image, reference and error picture when it fails."""
    from . import testing

    folder = _failure_folder(request)
    shutil.rmtree(folder, ignore_errors=True)  # pictures of an earlier run would mislead
    failures = 0

    def match(frame: Any, reference: Any, **bounds: Any) -> Comparison:
        nonlocal failures
        __tracebackhide__ = True
        try:
            return testing.assert_matches(frame, reference, **bounds)
        except AssertionError as error:
            result = getattr(error, "comparison", None)
            if result is None:
                raise
            failures += 1
            place = folder if failures == 1 else folder / str(failures)
            testing.write_pictures(result, place)
            raise AssertionError(f"{error}\npictures: {place}") from None

    return match


def _failure_folder(request: pytest.FixtureRequest) -> Path:
    root = Path(request.config.rootpath)
    chosen = request.config.getoption("--miplight-failures")
    fallback = "tests/failures" if (root / "tests").is_dir() else "miplight-failures"
    return root / str(chosen or fallback) / re.sub(r"[^0-9A-Za-z_.-]+", "_", request.node.nodeid).strip("_")
