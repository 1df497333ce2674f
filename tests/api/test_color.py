"""sRGB to linear and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import miplight as ml


def test_known_values_of_the_standard() -> None:
    # IEC 61966-2-1: the toe's end, and code 188, which is close to half the light
    codes = np.array([0, 10, 11, 188, 255], dtype=np.uint8)
    expected = [0.0, 10 / 255 / 12.92, ((11 / 255 + 0.055) / 1.055) ** 2.4, 0.5028865, 1.0]
    linear = ml.srgb_to_linear(codes)
    assert linear.dtype == np.float32
    np.testing.assert_allclose(linear, expected, rtol=1e-6)
    # negative control: a plain power of 2.2 is not the curve
    assert not np.allclose(linear, (codes / 255.0) ** 2.2, rtol=1e-3)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_code_survives_the_round_trip(dtype: Any) -> None:
    codes = np.arange(np.iinfo(dtype).max + 1, dtype=dtype)
    back = ml.linear_to_srgb(ml.srgb_to_linear(codes), dtype=dtype)
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, codes)


def test_shape_order_and_stride_do_not_matter() -> None:
    image = np.arange(2 * 5 * 7 * 3, dtype=np.uint8).reshape(2, 5, 7, 3)[0]
    expected = ml.srgb_to_linear(image)
    np.testing.assert_array_equal(ml.srgb_to_linear(np.asfortranarray(image)), expected)
    np.testing.assert_array_equal(ml.srgb_to_linear(image[::-1, ::2])[::-1], expected[:, ::2])
    np.testing.assert_allclose(ml.srgb_to_linear(image / 255.0), expected, rtol=1e-6, atol=1e-9)


def test_encoding_clips() -> None:
    assert ml.linear_to_srgb([-1.0, 0.0, 7.0]).tolist() == [0.0, 0.0, 1.0]
    assert ml.linear_to_srgb(0.5, dtype=np.float64).dtype == np.float64


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((4, 4, 2), np.uint8),
        np.zeros(3, np.int32),
        np.array([0.0, 1.5]),
        np.array([0.5, np.nan]),
        np.array([True]),
        "red",
    ],
)
def test_what_is_not_srgb_is_refused(image: Any) -> None:
    with pytest.raises(ml.SceneError, match="image is .*allowed"):
        ml.srgb_to_linear(image)


def test_what_is_not_linear_is_refused() -> None:
    with pytest.raises(ml.SceneError, match="linear floats"):
        ml.linear_to_srgb(np.zeros(3, np.uint8))
    with pytest.raises(ml.SceneError, match="dtype"):
        ml.linear_to_srgb(0.5, dtype=np.int8)
    with pytest.raises(ml.SceneError, match="NaN"):
        ml.linear_to_srgb([np.nan], dtype=np.uint8)
