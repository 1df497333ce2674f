"""Errors of pictures, in linear radiance.

With e the mean over RGB of |I − R| at a pixel and r the mean over RGB of R:

- `relative_rmse` = √mean(e²) / mean(r), where ``trim=0.001`` leaves out the worst 0.1 % of the pixels of the
  mask
  (a pixel whose centre lies on an edge may fall either way),
- `median_relative_error` = median of e / r over the pixels with r above 2 % of the mean.

A reference may be an array or a `miplight.mitsuba.Reference`. The latter keeps two independent halves R₁ and
R₂, and e² is then replaced by the mean over RGB of (I − R₁)·(I − R₂), whose expected value is free of the
reference's own noise (``noise_free=False`` keeps e²). Where the channels err alike the two are the same; else
the product is the larger by a little, as a mean of squares is. A mean of products may come out slightly
negative when there is nothing left but noise; it counts as zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._pixels import Pair, as_sequence, kept_pixels, ratio_to, root_mean, whole_pictures
from .errors import MiplightError, SettingsError
from .validate import as_number, fail

if TYPE_CHECKING:
    from ._pixels import AnyReference

__all__ = [
    "flicker",
    "flip",
    "median_relative_error",
    "psnr",
    "relative_rmse",
    "relmse",
    "rmse",
    "ssim",
]

# Pixels darker than this fraction of the mean say nothing in relative terms.
_DARK = 0.02
# Regularisation of relmse, relative to the squared mean of the reference.
_RELMSE_FLOOR = 1e-2
# Exposure of what is compared as a display picture: this quantile of the reference becomes white.
_WHITE_QUANTILE = 0.99


def rmse(
    image: ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.0,
    noise_free: bool = True,
) -> float:
    """Root mean square of e, the mean over RGB of |I − R|.

    Parameters
    ----------
    image : (H, W, 3) array_like of float
        Linear radiance, W·sr⁻¹·m⁻².
    reference : (H, W, 3) array_like, or Reference
    mask : (H, W) array_like of bool, optional
        Pixels that count; all by default.
    trim : float, default 0
        Fraction of the pixels to leave out, the worst ones, in [0, 1).
    noise_free : bool, default True
        Use the two halves of a `Reference`; without meaning for an array.

    Returns
    -------
    float
        In the unit of the image.

    Raises
    ------
    SettingsError
        For shapes that do not fit, values that are not finite, an empty mask or a `trim` outside [0, 1).
    """
    pair = Pair.of(image, reference, mask)
    return root_mean(pair.squared_errors(trim, noise_free))


def relative_rmse(
    image: ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.0,
    noise_free: bool = True,
) -> float:
    """√mean(e²) / mean(r): `rmse` relative to the mean radiance of the reference.

    Parameters
    ----------
    image, reference, mask, trim, noise_free
        As for `rmse`. The mean of r is over all pixels of the mask, trimmed or not.

    Returns
    -------
    float
        0.01 is 1 %. Infinite if the reference is black and the image is not.

    Raises
    ------
    SettingsError
        As for `rmse`.
    """
    pair = Pair.of(image, reference, mask)
    return ratio_to(root_mean(pair.squared_errors(trim, noise_free)), pair.level)


def relmse(
    image: ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.0,
    noise_free: bool = True,
) -> float:
    """Mean of (I − R)² / (R² + 0.01·mean(R)²) over pixels and channels.

    Parameters
    ----------
    image, reference, mask, trim, noise_free
        As for `rmse`; the pixels with the largest terms are trimmed. The noise of the denominator stays.

    Returns
    -------
    float
        Without unit; it does not change when both pictures are scaled alike.

    Raises
    ------
    SettingsError
        As for `rmse`.
    """
    pair = Pair.of(image, reference, mask)
    floor = _RELMSE_FLOOR * pair.level**2
    weight = pair.mean**2 + floor
    plain = np.divide((pair.image - pair.mean) ** 2, weight, out=np.zeros_like(weight), where=weight > 0)
    terms = plain.mean(axis=-1)
    kept = kept_pixels(terms, trim)
    if noise_free and pair.halves is not None:
        product = (pair.image - pair.halves[0]) * (pair.image - pair.halves[1])
        terms = np.divide(product, weight, out=np.zeros_like(weight), where=weight > 0).mean(axis=-1)
    return max(0.0, float(terms[kept].mean()))


def median_relative_error(
    image: ArrayLike, reference: AnyReference, *, mask: ArrayLike | None = None, trim: float = 0.0
) -> float:
    """Median of e / r over the pixels with r above 2 % of the mean.

    Parameters
    ----------
    image, reference, mask
        As for `rmse`. The median has no noise-free form: the noise of a `Reference` adds to it.
    trim : float, default 0
        Fraction of the largest ratios to leave out; a median hardly changes by it.

    Returns
    -------
    float
        NaN if no pixel is bright enough.

    Raises
    ------
    SettingsError
        As for `rmse`.
    """
    pair = Pair.of(image, reference, mask)
    ratio = pair.errors()
    brightness = pair.mean.mean(axis=-1)
    bright = brightness > _DARK * pair.level
    if not bright.any():
        return float("nan")
    ratios = ratio[bright] / brightness[bright]
    return float(np.median(ratios[kept_pixels(ratios, trim)]))


def psnr(
    image: ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.0,
    peak: float | None = None,
    noise_free: bool = True,
) -> float:
    """Peak signal-to-noise ratio, 20·log₁₀(peak / rmse).

    Parameters
    ----------
    image, reference, mask, trim, noise_free
        As for `rmse`.
    peak : float, optional
        Radiance that counts as the peak; the largest r of the mask by default.

    Returns
    -------
    float
        Decibels; infinite for equal pictures.

    Raises
    ------
    SettingsError
        As for `rmse`, and for a `peak` that is not above 0.
    """
    pair = Pair.of(image, reference, mask)
    top = float(pair.mean.mean(axis=-1).max()) if peak is None else _positive(peak, "peak")
    error = root_mean(pair.squared_errors(trim, noise_free))
    if error == 0.0:
        return float("inf")
    return float(20.0 * np.log10(top / error)) if top > 0 else float("-inf")


def ssim(
    image: ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    exposure: float | None = None,
) -> float:
    """Structural similarity of the two as display pictures, by scikit-image.

    Both are multiplied by the exposure, clipped to [0, 1] and sRGB-encoded; Gaussian windows as in the
    original (σ = 1.5).

    Parameters
    ----------
    image, reference
        As for `rmse`, at least 11 pixels wide and high.
    mask : (H, W) array_like of bool, optional
        Pixels over which the local values are averaged. Outside it both count as the reference.
    exposure : float, optional
        Linear factor; by default the one that makes the reference's 99th percentile white.

    Returns
    -------
    float
        1 for equal pictures.

    Raises
    ------
    MiplightError
        If scikit-image is not installed.
    SettingsError
        As for `rmse`.
    """
    from .color import linear_to_srgb

    metrics = _optional("skimage.metrics", "scikit-image")
    test, truth, chosen = whole_pictures(image, reference, mask)
    if min(chosen.shape) < 11:
        fail("image", test, "at least 11 pixels wide and high", SettingsError)
    factor = _exposure(truth, chosen) if exposure is None else _positive(exposure, "exposure")
    shown = [linear_to_srgb(np.clip(picture * factor, 0.0, 1.0)) for picture in (test, truth)]
    _, local = metrics.structural_similarity(
        *shown,
        channel_axis=-1,
        data_range=1.0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )
    return float(local.mean(axis=-1)[chosen].mean())


def flip(
    image: ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    pixels_per_degree: float = 67.0,
) -> float:
    """HDR-ꟻLIP: the mean perceived difference over all sensible exposures, by flip-evaluator.

    Parameters
    ----------
    image, reference
        As for `rmse`.
    mask : (H, W) array_like of bool, optional
        Pixels over which the error map is averaged. Outside it both count as the reference.
    pixels_per_degree : float, default 67
        Of the viewer: 0.7 m from a 0.7 m wide 4K display.

    Returns
    -------
    float
        In [0, 1], 0 for equal pictures.

    Raises
    ------
    MiplightError
        If flip-evaluator is not installed.
    SettingsError
        As for `rmse`.
    """
    evaluator = _optional("flip_evaluator", "flip-evaluator")
    test, truth, chosen = whole_pictures(image, reference, mask)
    if not truth.any():  # no exposure can be found for a black reference
        return float(np.any(test[chosen] > 0))
    pictures = [np.ascontiguousarray(p, dtype=np.float32) for p in (truth, test)]
    error, _, _ = evaluator.evaluate(
        *pictures,
        "HDR",
        applyMagma=False,
        parameters={"ppd": _positive(pixels_per_degree, "pixels_per_degree")},
    )
    return float(np.asarray(error).reshape(chosen.shape)[chosen].mean())


def flicker(
    frames: Sequence[ArrayLike] | ArrayLike,
    reference_frames: Sequence[ArrayLike] | ArrayLike | None = None,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.0,
) -> float:
    """How much a sequence of frames changes beyond what it should, from each frame to the next.

    With d the mean over RGB of |ΔI − ΔR| at a pixel, where Δ is the change to the next frame: √mean(d²) /
    mean(r).

    Parameters
    ----------
    frames : sequence of (H, W, 3), or (N, H, W, 3), N ≥ 2
        Linear radiance.
    reference_frames : the same shape, optional
        What it should look like; by default a still picture, so that every change is flicker, and r is then
        taken from the frames themselves.
    mask : (H, W) or (N, H, W) array_like of bool, optional
        Pixels that count; in a sequence, those that count in both frames.
    trim : float, default 0
        Fraction of the changes to leave out, the worst ones.

    Returns
    -------
    float
        0 for a steady sequence.

    Raises
    ------
    SettingsError
        For shapes that do not fit, fewer than two frames, values that are not finite or an empty mask.
    """
    moving = as_sequence(frames, "frames")
    still = (
        np.zeros_like(moving)
        if reference_frames is None
        else as_sequence(reference_frames, "reference_frames")
    )
    if still.shape != moving.shape:
        fail("reference_frames", still, f"the shape of frames, {moving.shape}", SettingsError)
    chosen = np.ones(moving.shape[:3], dtype=bool)
    if mask is not None:
        given = np.asarray(mask)
        if given.dtype != bool or given.shape not in (moving.shape[1:3], moving.shape[:3]):
            fail("mask", given, f"booleans of shape {moving.shape[1:3]} or {moving.shape[:3]}", SettingsError)
        chosen = np.broadcast_to(given, moving.shape[:3])
    both = chosen[1:] & chosen[:-1]
    if not both.any():
        fail("mask", chosen, "at least one pixel that counts in two frames", SettingsError)
    change = np.abs(np.diff(moving - still, axis=0)).mean(axis=-1)[both]
    level = (moving if reference_frames is None else still).mean(axis=-1)[chosen].mean()
    return ratio_to(root_mean(change[kept_pixels(change, trim)] ** 2), float(level))


def _positive(value: float, name: str) -> float:
    return as_number(value, name, above=0.0, error=SettingsError)


def _exposure(truth: NDArray[np.float64], chosen: NDArray[np.bool_]) -> float:
    white = float(np.quantile(truth.max(axis=-1)[chosen], _WHITE_QUANTILE))
    return 1.0 / white if white > 0 else 1.0


def _optional(module: str, package: str) -> Any:
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MiplightError(f"this metric needs {package}: pip install {package} ({error})") from error
