"""Between display colours (sRGB) and the linear radiance that miplight computes with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from .validate import as_numbers, fail

__all__ = ["linear_to_srgb", "srgb_to_linear"]

# IEC 61966-2-1: a linear toe below these thresholds, a power of 2.4 above.
_TOE_ENCODED, _TOE_LINEAR, _TOE_SLOPE = 0.04045, 0.0031308, 12.92


def srgb_to_linear(image: ArrayLike) -> NDArray[np.float32]:
    """Decode sRGB display colours to linear values.

    Parameters
    ----------
    image : array_like, any shape
        ``uint8`` or ``uint16`` (whole range), or floats in [0, 1]. An image with an alpha channel is refused:
        alpha is not sRGB-encoded, so slice it off first (``image[..., :3]``).

    Returns
    -------
    ndarray of float32, the same shape
        Linear values in [0, 1].

    Raises
    ------
    SceneError
        For other dtypes, floats outside [0, 1] or not finite, and images with alpha.

    Examples
    --------
    >>> import miplight as ml, numpy as np
    >>> ml.srgb_to_linear(np.array([0, 188, 255], dtype=np.uint8)).astype(float).round(3).tolist()
    [0.0, 0.503, 1.0]
    """
    allowed = "uint8, uint16, or floats in [0, 1], without an alpha channel (image[..., :3])"
    array = as_numbers(image, "image", allowed)
    _refuse_alpha(array, allowed)
    if array.dtype in (np.dtype(np.uint8), np.dtype(np.uint16)):
        # Every code decodes once: a table is faster than a power per texel.
        codes = np.arange(np.iinfo(array.dtype).max + 1, dtype=np.float64)
        table = _decode(codes / codes[-1]).astype(np.float32)
        linear: NDArray[np.float32] = table[array]
        return linear
    if array.dtype.kind != "f" or not (np.isfinite(array).all() and ((array >= 0) & (array <= 1)).all()):
        fail("image", array, allowed)
    return _decode(array.astype(np.float64)).astype(np.float32)


def linear_to_srgb(image: ArrayLike, dtype: DTypeLike = np.float32) -> NDArray[Any]:
    """Encode linear values as sRGB display colours; what lies outside [0, 1] is clipped.

    Parameters
    ----------
    image : array_like of float, any shape
        Linear values. Scale by the exposure first.
    dtype : float or unsigned integer dtype, default float32
        ``np.uint8`` and ``np.uint16`` are rounded to the nearest code.

    Returns
    -------
    ndarray of `dtype`, the same shape

    Raises
    ------
    SceneError
        For integer input, an unsuitable `dtype`, or a NaN where `dtype` cannot hold one.

    Examples
    --------
    >>> import miplight as ml, numpy as np
    >>> ml.linear_to_srgb([0.0, 0.2159, 4.0], dtype=np.uint8).tolist()
    [0, 128, 255]
    """
    allowed = "linear floats"
    array = as_numbers(image, "image", allowed)
    if array.dtype.kind != "f":
        fail("image", array, allowed)
    target = np.dtype(dtype)
    if target.kind not in "fu":
        fail("dtype", target, "a float or an unsigned integer dtype")
    encoded = _encode(np.clip(array.astype(np.float64), 0.0, 1.0))
    if target.kind == "f":
        return encoded.astype(target)
    if np.isnan(encoded).any():
        fail("image", array, f"no NaN when encoding to {target}")
    return np.rint(encoded * float(np.iinfo(target).max)).astype(target)


def _decode(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(encoded <= _TOE_ENCODED, encoded / _TOE_SLOPE, ((encoded + 0.055) / 1.055) ** 2.4)


def _encode(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(linear <= _TOE_LINEAR, linear * _TOE_SLOPE, 1.055 * linear ** (1 / 2.4) - 0.055)


def _refuse_alpha(array: NDArray[Any], allowed: str) -> None:
    if array.ndim == 3 and array.shape[2] in (2, 4):
        fail("image", array, allowed)
