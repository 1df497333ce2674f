"""The formulas of the metrics, on pictures whose errors are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
from miplight import metrics
from miplight.mitsuba import Reference

WITH_TRIM: list[Callable[..., float]] = [
    metrics.rmse,
    metrics.relative_rmse,
    metrics.relmse,
    metrics.psnr,
    metrics.median_relative_error,
]
ALL: list[Callable[..., float]] = [*WITH_TRIM, metrics.ssim, metrics.flip]


@pytest.fixture
def pair(rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[Any]]:
    """An image and its reference, with errors of either sign in every channel."""
    reference = rng.uniform(0.2, 2.0, (20, 30, 3)).astype(np.float32)
    return (reference + rng.normal(0, 0.05, reference.shape)).astype(np.float32), reference


def noisy_reference(truth: NDArray[Any], rng: np.random.Generator, sigma: float) -> Reference:
    halves = (truth + rng.normal(0, sigma * np.sqrt(2), (2, *truth.shape))).astype(np.float32)
    return Reference(halves.mean(axis=0), halves, np.full(truth.shape, sigma**2, np.float32), 2)


def test_by_hand() -> None:
    reference = np.array([[(1.0, 2.0, 3.0), (4.0, 4.0, 4.0)]])
    image = np.array([[(1.3, 1.7, 3.0), (4.0, 4.0, 4.6)]])
    # e is 0.2 and 0.2; r is 2 and 4
    assert metrics.rmse(image, reference) == pytest.approx(0.2)
    assert metrics.relative_rmse(image, reference) == pytest.approx(0.2 / 3)
    assert metrics.median_relative_error(image, reference) == pytest.approx((0.1 + 0.05) / 2)
    assert metrics.psnr(image, reference) == pytest.approx(20 * np.log10(4 / 0.2))
    floor = 0.01 * 9.0
    terms = [0.09 / (1 + floor), 0.09 / (4 + floor), 0, 0, 0, 0.36 / (16 + floor)]
    assert metrics.relmse(image, reference) == pytest.approx(np.mean(terms))


def test_relative_rmse_is_the_formula_of_acceptance(pair: tuple[NDArray[Any], NDArray[Any]]) -> None:
    image, reference = (a.astype(np.float64) for a in pair)
    e, r = np.abs(image - reference).mean(-1), reference.mean(-1)
    assert metrics.relative_rmse(*pair) == pytest.approx(np.sqrt(np.mean(e**2)) / r.mean())
    kept = np.sort(e.ravel())[: 600 - 6]
    assert metrics.relative_rmse(*pair, trim=0.01) == pytest.approx(np.sqrt(np.mean(kept**2)) / r.mean())
    bright = r > 0.02 * r.mean()
    assert metrics.median_relative_error(*pair) == pytest.approx(np.median((e / r)[bright]))


@pytest.mark.parametrize("metric", ALL)
def test_equal_pictures_and_growing_errors(
    metric: Callable[..., float], pair: tuple[NDArray[Any], NDArray[Any]]
) -> None:
    image, reference = pair
    best = metric(reference, reference)
    assert best == {metrics.psnr: np.inf, metrics.ssim: pytest.approx(1.0)}.get(metric, 0.0)
    near, far = (metric(reference + s * (image - reference), reference) for s in (1.0, 3.0))
    better_is_more = metric in (metrics.psnr, metrics.ssim)
    assert (far < near < best) if better_is_more else (far > near > best)


@pytest.mark.parametrize("metric", ALL)
def test_mask(metric: Callable[..., float], pair: tuple[NDArray[Any], NDArray[Any]]) -> None:
    image, reference = pair
    mask = np.zeros(image.shape[:2], dtype=bool)
    mask[:12, :14] = True
    broken = image.copy()
    broken[~mask] = 1e4
    assert metric(broken, reference, mask=mask) == pytest.approx(
        metric(image, reference, mask=mask), rel=1e-6
    )
    assert metric(broken, reference) != pytest.approx(metric(image, reference), rel=1e-3)  # negative control


@pytest.mark.parametrize("metric", WITH_TRIM)
def test_trim_leaves_out_the_worst(
    metric: Callable[..., float], pair: tuple[NDArray[Any], NDArray[Any]]
) -> None:
    image, reference = pair
    broken = image.copy()
    broken[3, 4] = broken[7, 8] = 1e4
    trimmed, clean = metric(broken, reference, trim=2.5 / 600), metric(image, reference)
    assert trimmed == pytest.approx(clean, rel=0.02)
    if metric is not metrics.median_relative_error:
        assert metric(broken, reference) != pytest.approx(clean, rel=0.5)  # negative control
        assert metric(broken, reference, trim=1.5 / 600) != pytest.approx(clean, rel=0.5)


@pytest.mark.parametrize("metric", [metrics.relative_rmse, metrics.relmse, metrics.median_relative_error])
def test_no_unit(metric: Callable[..., float], pair: tuple[NDArray[Any], NDArray[Any]]) -> None:
    image, reference = (a.astype(np.float64) for a in pair)
    assert metric(1e-3 * image, 1e-3 * reference) == pytest.approx(metric(image, reference))


def test_halves_cancel_the_references_noise(rng: np.random.Generator) -> None:
    truth = np.broadcast_to(rng.uniform(0.5, 1.5, (100, 100, 1)), (100, 100, 3)).astype(np.float32)
    noisy = noisy_reference(truth, rng, 0.05)
    image = truth * 1.01
    true_error = metrics.relative_rmse(image, truth)
    assert metrics.relative_rmse(image, noisy) == pytest.approx(true_error, rel=0.15)
    quiet = noisy_reference(truth, rng, 0.02)  # relmse keeps the noise of its denominator
    assert metrics.relmse(image, quiet) == pytest.approx(metrics.relmse(image, truth), rel=0.5)
    assert metrics.relmse(image, quiet.mean) > 3 * metrics.relmse(image, truth)
    assert metrics.rmse(truth, noisy) < 0.006
    # negative controls: without the halves the noise counts, and an array has none
    assert metrics.relative_rmse(image, noisy, noise_free=False) > 2.5 * true_error
    assert metrics.relative_rmse(image, noisy.mean) > 2.5 * true_error


def test_halves_without_noise_change_nothing(pair: tuple[NDArray[Any], NDArray[Any]]) -> None:
    image, reference = pair
    grey = np.repeat(reference[..., :1], 3, axis=-1)
    off = grey + (image - reference)[..., :1]
    exact = Reference(grey, np.stack([grey, grey]), np.zeros_like(grey), 2)
    for metric in (
        metrics.rmse,
        metrics.relative_rmse,
        metrics.relmse,
        metrics.psnr,
        metrics.ssim,
        metrics.flip,
    ):
        assert metric(off, exact) == pytest.approx(metric(off, grey), rel=1e-6)


def test_a_black_reference() -> None:
    black, grey = np.zeros((12, 12, 3)), np.full((12, 12, 3), 0.5)
    assert metrics.relative_rmse(black, black) == 0.0
    assert metrics.relative_rmse(grey, black) == np.inf
    assert metrics.relmse(black, black) == 0.0
    assert np.isnan(metrics.median_relative_error(grey, black))
    assert metrics.flip(black, black) == 0.0
    assert metrics.flip(grey, black) == 1.0


def test_ssim_sees_structure_and_exposure(pair: tuple[NDArray[Any], NDArray[Any]]) -> None:
    _, reference = pair
    shuffled = reference[::-1, ::-1]
    assert metrics.ssim(shuffled, reference) < 0.3
    assert metrics.ssim(reference * 1e3, reference * 1e3 * 1.02, exposure=1e-3) > 0.95


# -- flicker


def test_flicker_by_hand() -> None:
    frames = np.ones((3, 4, 5, 3))
    frames[1] += 0.1
    # two changes of 0.1 at every pixel; the mean radiance is 1 + 0.1 / 3
    assert metrics.flicker(frames) == pytest.approx(0.1 / (1 + 0.1 / 3))
    assert metrics.flicker([frames[0], frames[0]]) == 0.0
    one = np.zeros((4, 5), dtype=bool)
    one[0, 0] = True
    frames[1] = 1.0
    frames[1, 3, 3] = 9.0
    assert metrics.flicker(frames, mask=one) == 0.0
    assert metrics.flicker(frames, trim=0.05) == 0.0
    assert metrics.flicker(frames) > 0.5  # negative control


def test_flicker_takes_off_the_true_change(rng: np.random.Generator) -> None:
    truth = rng.uniform(0.5, 1.5, (5, 8, 8, 3))
    assert metrics.flicker(1.0 + truth, truth) == pytest.approx(0.0, abs=1e-12)
    assert metrics.flicker(truth + rng.normal(0, 0.01, truth.shape), truth) == pytest.approx(0.012, rel=0.3)
    assert metrics.flicker(truth) > 0.2  # negative control: without the reference every change counts


def test_flicker_masks_of_moving_frames() -> None:
    frames = np.ones((3, 2, 2, 3))
    frames[2, 0, 0] = 5.0
    seen = np.ones((3, 2, 2), dtype=bool)
    assert metrics.flicker(frames, mask=seen) > 0.1
    seen[2, 0, 0] = False
    assert metrics.flicker(frames, mask=seen) == 0.0


# -- refusals


@pytest.mark.parametrize("metric", ALL)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image": np.ones((3, 4, 3))}, r"image is .*allowed: finite floats of shape \(20, 30, 3\)"),
        ({"image": np.ones((20, 30, 3), np.uint8)}, r"image is .*uint8.*allowed: finite floats"),
        ({"reference": np.ones((20, 30))}, r"reference is .*allowed: finite floats of shape \(H, W, 3\)"),
        ({"mask": np.ones((20, 30))}, r"mask is .*allowed: booleans of shape \(20, 30\)"),
        ({"mask": np.zeros((20, 30), bool)}, r"allowed: at least one pixel that counts"),
    ],
)
def test_bad_input(
    metric: Callable[..., float],
    pair: tuple[NDArray[Any], NDArray[Any]],
    change: dict[str, Any],
    message: str,
) -> None:
    values = {"image": pair[0], "reference": pair[1], "mask": None, **change}
    with pytest.raises(ml.SettingsError, match=message):
        metric(values["image"], values["reference"], mask=values["mask"])


@pytest.mark.parametrize("metric", ALL)
def test_nan_is_named_with_its_place(
    metric: Callable[..., float], pair: tuple[NDArray[Any], NDArray[Any]]
) -> None:
    image = pair[0].copy()
    image[2, 3, 1] = np.nan
    with pytest.raises(ml.SettingsError, match=r"image\[2, 3, 1\] is nan; allowed: finite"):
        metric(image, pair[1])


@pytest.mark.parametrize("metric", WITH_TRIM)
@pytest.mark.parametrize("trim", [-0.1, 1.0, np.nan])
def test_bad_trim(metric: Callable[..., float], pair: tuple[NDArray[Any], NDArray[Any]], trim: float) -> None:
    with pytest.raises(ml.SettingsError, match=r"trim is .*at least 0 and below 1"):
        metric(*pair, trim=trim)


def test_bad_sequences() -> None:
    frame = np.ones((2, 2, 3))
    with pytest.raises(ml.SettingsError, match=r"two or more pictures of one shape"):
        metrics.flicker([frame])
    with pytest.raises(ml.SettingsError, match=r"two or more pictures of one shape"):
        metrics.flicker([frame, np.ones((3, 2, 3))])
    with pytest.raises(ml.SettingsError, match="reference_frames is .*allowed: the shape of frames"):
        metrics.flicker([frame, frame], [frame, frame, frame])


@pytest.mark.parametrize(
    ("metric", "module", "package"),
    [(metrics.ssim, "skimage.metrics", "scikit-image"), (metrics.flip, "flip_evaluator", "flip-evaluator")],
)
def test_missing_packages_are_named(
    metric: Callable[..., float],
    module: str,
    package: str,
    pair: tuple[NDArray[Any], NDArray[Any]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ml.MiplightError, match=f"pip install {package}"):
        metric(*pair)


def test_a_reference_with_wrong_shapes() -> None:
    with pytest.raises(ml.SceneError, match=r"mean, halves and variance have the shapes"):
        Reference(np.ones((2, 2, 3)), np.ones((2, 3, 2, 3)), np.ones((2, 2, 3)), 1)  # type: ignore[arg-type]
