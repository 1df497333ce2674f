"""Checked pixels that the metrics work on."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SettingsError
from .validate import as_bool, as_number, fail

if TYPE_CHECKING:
    from .mitsuba import Reference

    AnyReference: TypeAlias = ArrayLike | Reference

__all__ = ["Pair", "as_picture", "as_sequence", "kept_pixels", "ratio_to", "root_mean", "whole_pictures"]


@dataclasses.dataclass(frozen=True)
class Pair:
    """Pixels of the mask, (N, 3) float64, of an image and its reference."""

    image: NDArray[np.float64]
    mean: NDArray[np.float64]
    halves: NDArray[np.float64] | None

    @classmethod
    def of(cls, image: ArrayLike, reference: AnyReference, mask: ArrayLike | None) -> Pair:
        halves = getattr(reference, "halves", None)
        truth = as_picture(
            getattr(reference, "mean", reference) if halves is not None else reference, "reference"
        )
        test = as_picture(image, "image", truth.shape)
        chosen = as_mask(mask, truth.shape[:2])
        pair = (
            None
            if halves is None
            else np.stack([as_picture(h, "halves", truth.shape)[chosen] for h in halves])
        )
        return cls(test[chosen], truth[chosen], pair)

    @property
    def level(self) -> float:
        """Mean of r."""
        return float(self.mean.mean())

    def errors(self) -> NDArray[np.float64]:
        """Return e of every pixel."""
        result: NDArray[np.float64] = np.abs(self.image - self.mean).mean(axis=-1)
        return result

    def squared_errors(self, trim: float, noise_free: bool) -> NDArray[np.float64]:
        """Return e² of the pixels that are kept; with halves, the mean over RGB of (I − R₁)·(I − R₂)."""
        e = self.errors()
        chosen = kept_pixels(e, trim)
        if not as_bool(noise_free, "noise_free", SettingsError) or self.halves is None:
            squares: NDArray[np.float64] = e[chosen] ** 2
            return squares
        first, second = (self.image[chosen] - half[chosen] for half in self.halves)
        product: NDArray[np.float64] = (first * second).mean(axis=-1)
        return product


def kept_pixels(values: NDArray[np.float64], trim: float) -> NDArray[np.intp] | slice:
    """Indices of all but the largest `trim` of the values (rounded down to whole pixels)."""
    fraction = as_number(trim, "trim", at_least=0.0, below=1.0, error=SettingsError)
    drop = int(fraction * values.size + 1e-9)
    if drop == 0:
        return slice(None)
    return np.argpartition(values, values.size - drop)[: values.size - drop]


def root_mean(squares: NDArray[np.float64]) -> float:
    return float(np.sqrt(max(0.0, float(squares.mean()))))


def ratio_to(value: float, level: float) -> float:
    if level > 0.0:
        return value / level
    return 0.0 if value == 0.0 else float("inf")


def _mean_of(reference: Any) -> NDArray[np.float64]:
    """Return the picture itself, of an array or of a `Reference`."""
    is_reference = getattr(reference, "halves", None) is not None
    return as_picture(reference.mean if is_reference else reference, "reference")


def as_picture(value: Any, name: str, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    allowed = "finite floats of shape " + ("(H, W, 3)" if shape is None else str(shape))
    array = np.asarray(value)
    good = array.ndim == 3 and array.shape[-1] == 3 and array.size > 0 and array.dtype.kind == "f"
    if not good or (shape is not None and array.shape != shape):
        fail(name, value if array.dtype.kind == "O" else array, allowed, SettingsError)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        fail(f"{name}[{', '.join(map(str, where))}]", float(array[where]), allowed, SettingsError)
    return array.astype(np.float64)


def as_mask(mask: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    if mask is None:
        return np.ones(shape, dtype=bool)
    array = np.asarray(mask)
    if array.dtype != bool or array.shape != shape:
        fail("mask", array, f"booleans of shape {shape}", SettingsError)
    if not array.any():
        fail("mask", array, "at least one pixel that counts", SettingsError)
    return array


def whole_pictures(
    image: ArrayLike, reference: AnyReference, mask: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return whole pictures and the mask; outside it the image equals the reference."""
    truth = _mean_of(reference)
    test = as_picture(image, "image", truth.shape)
    chosen = as_mask(mask, truth.shape[:2])
    return np.where(chosen[..., None], test, truth), truth, chosen


def as_sequence(frames: Any, name: str) -> NDArray[np.float64]:
    pictures = [as_picture(frame, f"{name}[{index}]") for index, frame in enumerate(frames)]
    if len(pictures) < 2 or any(picture.shape != pictures[0].shape for picture in pictures):
        shapes = [picture.shape for picture in pictures]
        raise SettingsError(
            f"{name} have the shapes {shapes}; allowed: two or more pictures of one shape (H, W, 3)"
        )
    return np.stack(pictures)
