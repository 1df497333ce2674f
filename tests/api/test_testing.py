"""`assert_matches`, its messages, and the fixture that leaves pictures behind."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
from miplight.mitsuba import Reference
from miplight.testing import assert_matches, compare, write_pictures

pytest_plugins = ["pytester"]


@pytest.fixture
def truth(rng: np.random.Generator) -> NDArray[np.float32]:
    return rng.uniform(0.5, 1.5, (20, 50, 3)).astype(np.float32)


def test_it_holds_and_returns_the_numbers(truth: NDArray[np.float32]) -> None:
    result = assert_matches(
        truth * np.float32(1.01), truth, relative_rmse=0.0105, median=0.0101, energy=0.0101
    )
    assert result.relative_rmse == pytest.approx(
        ml.metrics.relative_rmse(truth * 1.01, truth, trim=0.001), rel=1e-5
    )
    assert result.energy == pytest.approx(0.01, rel=1e-4)
    assert result.pixels == 1000


@pytest.mark.parametrize(
    ("bounds", "broken"),
    [
        ({"relative_rmse": 0.009}, "relative RMSE 1.0"),
        ({"median": 0.009}, "median 1.0"),
        ({"energy": 0.009}, "energy 1.0"),
    ],
)
def test_each_bound_can_fail(truth: NDArray[np.float32], bounds: dict[str, float], broken: str) -> None:
    with pytest.raises(AssertionError) as caught:
        assert_matches(truth * np.float32(1.01), truth, **bounds)
    message = str(caught.value)
    assert message.startswith(broken)
    for word in (
        "trim 0.001",
        "untrimmed",
        "median",
        "energy",
        "1,000 pixels",
        "noise unknown",
        "worst at row",
    ):
        assert word in message


def test_trimmed_and_untrimmed_are_both_said(truth: NDArray[np.float32]) -> None:
    image = truth.copy()
    image[7, 9] += 100.0
    result = assert_matches(image, truth, relative_rmse=1e-6)
    assert result.untrimmed > 1.0
    assert result.worst == (7, 9)
    with pytest.raises(AssertionError, match="worst at row 7, column 9"):
        assert_matches(image, truth, relative_rmse=1e-6, trim=0.0)


def test_a_frame_is_compared_where_it_sees_a_surface(truth: NDArray[np.float32]) -> None:
    mask = np.zeros(truth.shape[:2], dtype=bool)
    mask[:10] = True
    image = np.where(mask[..., None], truth, np.float32(9.0))
    frame = SimpleNamespace(image=image, direct=image * 2, indirect=image * 3, surface_mask=mask)
    assert assert_matches(frame, truth, relative_rmse=1e-6).pixels == 500  # type: ignore[arg-type]
    with pytest.raises(AssertionError):
        assert_matches(frame, truth, relative_rmse=1e-6, mask=np.ones_like(mask))  # type: ignore[arg-type]
    for part, factor in (("total", 1), ("direct", 2), ("indirect", 3)):
        scaled = truth * np.float32(factor)
        reference = Reference(scaled, np.stack([scaled] * 2), np.full_like(truth, 1e-4), 2, {"part": part})
        result = assert_matches(frame, reference, relative_rmse=1e-6)  # type: ignore[arg-type]
        assert result.noise == pytest.approx(0.01 / scaled[mask].mean(), rel=1e-3)
        wrong = Reference(scaled * 1.1, np.stack([scaled * 1.1] * 2), np.zeros_like(truth), 2, {"part": part})
        with pytest.raises(AssertionError):
            assert_matches(frame, wrong, relative_rmse=0.05)  # type: ignore[arg-type]


def test_nan_never_matches(truth: NDArray[np.float32]) -> None:
    black = np.zeros_like(truth)
    with pytest.raises(AssertionError, match="median nan"):
        assert_matches(black, black, median=0.5)
    broken = truth.copy()
    broken[0, 0, 0] = np.nan
    with pytest.raises(ml.SettingsError, match=r"image\[0, 0, 0\] is nan"):
        assert_matches(broken, truth, relative_rmse=0.5)


def test_bad_arguments(truth: NDArray[np.float32]) -> None:
    with pytest.raises(ml.SettingsError, match="no bound is given; allowed: at least one of relative_rmse"):
        assert_matches(truth, truth)
    with pytest.raises(ml.SettingsError, match="median is 0"):
        assert_matches(truth, truth, median=0.0)
    with pytest.raises(ml.SettingsError, match=r"frame is an array of shape \(20, 50\)"):
        compare(truth[..., 0], truth)


def test_pictures_are_written(truth: NDArray[np.float32], tmp_path: Path) -> None:
    import OpenEXR
    from PIL import Image

    mask = np.ones(truth.shape[:2], dtype=bool)
    mask[:, :5] = False
    result = compare(truth + np.float32(0.25), truth, mask=mask)
    written = write_pictures(result, tmp_path / "a")
    assert sorted(path.name for path in written) == [
        "error.exr", "error.png", "image.exr", "image.png", "numbers.txt", "reference.exr", "reference.png",
    ]  # fmt: skip
    error = np.asarray(Image.open(tmp_path / "a" / "error.png"))
    assert error[:, :5].max() == 0
    assert error[:, 5:].min() > 200
    with OpenEXR.File(str(tmp_path / "a" / "reference.exr")) as file:
        np.testing.assert_array_equal(file.channels()["RGB"].pixels, truth)
    assert "relative RMSE" in (tmp_path / "a" / "numbers.txt").read_text()


def test_the_fixture_leaves_pictures_behind(pytester: pytest.Pytester, monkeypatch: Any) -> None:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    pytester.makepyfile(
        """
        import numpy as np

        truth = np.ones((12, 12, 3), np.float32)

        def test_good(match_reference):
            match_reference(truth, truth, relative_rmse=0.01)

        def test_bad(match_reference):
            match_reference(truth * 1.1, truth, relative_rmse=0.01)
        """
    )
    arguments = ("-p", "miplight.testing_plugin", "--miplight-failures=left")
    pytester.runpytest_subprocess(*arguments).assert_outcomes(passed=1, failed=1)
    (folder,) = (pytester.path / "left").iterdir()
    assert "test_bad" in folder.name
    assert {path.suffix for path in folder.iterdir()} == {".png", ".exr", ".txt"}
    # pictures of an earlier run do not stay
    pytester.makepyfile("def test_bad(match_reference): pass")
    (folder / "stale.png").write_bytes(b"")
    assert pytester.runpytest_subprocess(*arguments).ret == 0
    assert not folder.exists()
