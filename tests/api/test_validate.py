"""The border checks: each error names the argument, shows the value and says what is allowed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from miplight import validate
from miplight.errors import SceneError, SettingsError


@pytest.mark.parametrize(
    ("check", "value", "shown"),
    [
        (validate.as_vector, (1, 2), "(1, 2)"),
        (validate.as_vector, (1, 2, np.nan), "nan"),
        (validate.as_vector, "abc", "'abc'"),
        (validate.as_vector, [[1, 2], [3]], "[[1, 2], [3]]"),
        (validate.as_vector, (1, 2, None), "None"),
        (validate.as_vector, (1j, 2, 3), "1j"),
        (validate.as_vector, (True, False, True), "True"),
        (validate.as_matrix, np.eye(3), "1., 0., 0."),
        (validate.as_matrix, np.diag([1.0, 1.0, 0.0, 1.0]), "0."),
        (validate.as_matrix, np.diag([1.0, 1.0, 1.0, 2.0]), "2."),
        (validate.as_matrix, np.full((4, 4), np.inf), "inf"),
        (validate.as_color, (0.5, 0.5), "(0.5, 0.5)"),
        (validate.as_color, (-0.1, 0.5, 0.5), "-0.1"),
        (validate.as_color, np.array([255, 128, 0], np.uint8), "255"),
        (validate.as_color, tuple(np.array([255, 128, 0], np.uint8)), "255"),
        (validate.as_color, (1e39, 0.0, 0.0), "1e+39"),
        (validate.as_color_or_image, np.zeros((0, 4, 3)), "(0, 4, 3)"),
        (validate.as_color_or_image, np.zeros((4, 4)), "0."),
        (validate.as_color_or_image, [[[1, 2, 3]]], "[[[1, 2, 3]]]"),
        (validate.as_positions, np.zeros((0, 3)), "(0, 3)"),
        (validate.as_positions, np.zeros((5, 2)), "0."),
        (validate.as_name, "", "''"),
        (validate.as_name, 3, "3"),
        (validate.as_bool, 1, "1"),
    ],
)
def test_errors_name_show_and_allow(check: Callable[..., Any], value: Any, shown: str) -> None:
    with pytest.raises(SceneError) as caught:
        check(value, "argument")
    text = str(caught.value)
    assert text.startswith("argument is ")
    assert shown in text
    assert "allowed: " in text


def test_the_offending_element_is_named() -> None:
    image = np.ones((40, 30, 3))
    image[12, 7, 2] = -0.25
    with pytest.raises(SceneError, match=r"radiance\[12, 7, 2\] is -0\.25"):
        validate.as_color_or_image(image, "radiance")
    triangles = np.zeros((50, 3), int)
    triangles[31, 1] = 9
    with pytest.raises(SceneError, match=r"faces\[31, 1\] is 9 .*0 to 8"):
        validate.as_triangles(triangles, "faces", 9)


def test_integer_colours_hint_at_the_conversion() -> None:
    with pytest.raises(SceneError, match=r"ml\.srgb_to_linear\(uint8_image\)"):
        validate.as_color_or_image(np.full((2, 2, 3), 255, np.uint8), "radiance")
    # three plain numbers are no display code
    assert validate.as_color((12, 12, 12), "radiance").tolist() == [12.0, 12.0, 12.0]
    assert validate.as_color(np.array([1.0, 2.0, 3.0]), "radiance").tolist() == [1.0, 2.0, 3.0]


def test_alpha_hint() -> None:
    with pytest.raises(SceneError, match=r"\[\.\.\., :3\]"):
        validate.as_color_or_image(np.zeros((5, 5, 4)), "albedo")


@pytest.mark.parametrize("value", [True, "3", None, [1.0], np.nan, np.inf, 0.0, 81.0])
def test_numbers(value: Any) -> None:
    with pytest.raises(SceneError, match=r"cutoff is .*above 0 and at most 80 degrees"):
        validate.as_number(value, "cutoff", above=0.0, at_most=80.0, unit="degrees")


def test_numbers_in_other_clothes() -> None:
    for value in (30, np.float32(30), np.int16(30), np.array(30.0)):
        assert validate.as_number(value, "cutoff", above=0.0, at_most=80.0) == 30.0
    assert validate.as_count(np.int64(4), "width") == 4
    assert validate.as_count(4.0, "width") == 4
    for bad in (0, -1, 2.5, "4"):
        with pytest.raises(SceneError, match="width is"):
            validate.as_count(bad, "width")


def test_choices_suggest_and_other_errors_may_be_asked_for() -> None:
    with pytest.raises(SettingsError, match="did you mean 'nearest'"):
        validate.as_choice("neares", "filter", ("nearest", "linear"), SettingsError)


@given(
    hnp.arrays(
        st.sampled_from([np.dtype(code) for code in ("f8", "f4", "f2", "i8", "i2", "u1", ">f8", ">i4")]),
        st.tuples(st.integers(1, 9), st.just(3)),
        elements={"min_value": 0, "max_value": 100},
    ),
    st.booleans(),
)
def test_arrays_of_any_dtype_order_and_stride(values: np.ndarray[Any, Any], backwards: bool) -> None:
    given_array = values[::-1] if backwards else np.asfortranarray(values)
    positions = validate.as_positions(given_array, "positions")
    assert positions.dtype == np.float64
    assert positions.flags.c_contiguous
    assert not positions.flags.writeable
    np.testing.assert_array_equal(positions, given_array)
    assert not np.shares_memory(positions, values)


def test_what_was_checked_cannot_be_changed_behind_our_back() -> None:
    image = np.ones((2, 2, 3), np.float32)
    checked = validate.as_color_or_image(image, "radiance")
    image[:] = -1.0
    assert (checked == 1.0).all()
    with pytest.raises(ValueError, match="read-only"):
        checked[0, 0, 0] = 2.0
