"""Materials: ranges, images, equality, pickling."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import miplight as ml


def test_values_come_back_as_read_only_float32() -> None:
    material = ml.Material((0.8, 0.7, 0.6))
    assert material.albedo.dtype == np.float32
    np.testing.assert_array_equal(material.albedo, np.array([0.8, 0.7, 0.6], np.float32))
    assert material.specular.tolist() == [0.0, 0.0, 0.0]
    assert material.shininess == 32.0
    assert not material.is_textured
    with pytest.raises(ValueError, match="read-only"):
        material.albedo[0] = 2.0
    with pytest.raises(AttributeError):
        material.albedo = (0.1, 0.1, 0.1)  # type: ignore[misc, assignment]


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.longdouble, ">f4"])
def test_images_of_any_float_dtype(dtype: Any, rng: np.random.Generator) -> None:
    image = rng.uniform(0, 1, (5, 4, 3)).astype(dtype)
    for view in (image, np.asfortranarray(image), image[::-1, ::-1]):
        material = ml.Material(view)
        assert material.is_textured
        np.testing.assert_array_equal(material.albedo, view.astype(np.float32))
    assert repr(material) == "Material(albedo=<5x4 image>)"


@pytest.mark.parametrize(
    "albedo",
    [
        (1.1, 0.5, 0.5),
        (-0.1, 0.5, 0.5),
        (np.nan, 0.5, 0.5),
        (0.5, 0.5),
        0.5,
        np.full((2, 2, 3), 128, np.uint8),
        np.array([1, 0, 1]),
        np.full((2, 2, 4), 0.5),
        np.full((2, 2, 3), 1.5),
        None,
        "white",
    ],
)
def test_bad_albedo(albedo: Any) -> None:
    with pytest.raises(ml.SceneError, match=r"albedo.* is .*allowed"):
        ml.Material(albedo)


def test_specular_is_checked() -> None:
    glossy = ml.Material((0.5, 0.5, 0.5), specular=(0.2, 0.3, 0.25), shininess=50)
    assert repr(glossy) == "Material(albedo=(0.5, 0.5, 0.5), specular=(0.2, 0.3, 0.25), shininess=50)"
    assert glossy._core_lobe() == pytest.approx((0.2, 0.3, 0.25, 50))
    assert pickle.loads(pickle.dumps(glossy)) == glossy != ml.Material((0.5, 0.5, 0.5))
    with pytest.raises(ml.SceneError, match=r"albedo \+ specular.*at most 1"):
        ml.Material((0.9, 0.9, 0.9), specular=(0.2, 0.0, 0.0))
    with pytest.raises(ml.SceneError, match="specular is"):
        ml.Material((0.5, 0.5, 0.5), specular=(0.1, -0.1, 0.0))
    with pytest.raises(ml.SceneError, match="shininess is"):
        ml.Material(shininess=-1.0)


def test_equality_replace_copies_and_pickles() -> None:
    plain, image = ml.Material((0.2, 0.3, 0.4)), ml.Material(np.full((2, 3, 3), 0.25))
    assert plain == ml.Material([0.2, 0.3, 0.4])
    assert plain != image
    assert plain != "plain"
    assert plain.replace(albedo=(0.1, 0.1, 0.1)) == ml.Material((0.1, 0.1, 0.1))
    assert image.replace(shininess=8.0).shininess == 8.0
    with pytest.raises(ml.SceneError, match="colour"):
        plain.replace(colour=(1.0, 1.0, 1.0))
    for material in (plain, image):
        image._core_texture()  # handles do not pickle; they are made again
        again = pickle.loads(pickle.dumps(material))
        assert again == material
        assert hash(again) == hash(material)
        assert not again.albedo.flags.writeable
        assert copy.deepcopy(material) is material


def test_one_texture_however_often_it_is_used() -> None:
    material = ml.Material(np.full((2, 2, 3), 0.5))
    first, second = material._core_texture(), material._core_texture()
    assert first is second
    assert first is not None
    assert tuple(first.shape) == (2, 2)
    assert ml.Material((0.5, 0.5, 0.5))._core_texture() is None
