"""Checks of frames against references, for tests of miplight and of what is built on it.

`assert_matches` compares and says all numbers when it fails. The pytest fixture ``match_reference``
(installed with the package, see `miplight.testing_plugin`) does the same and leaves the pictures behind.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import metrics
from .errors import SettingsError
from .validate import as_number

if TYPE_CHECKING:
    from ._pixels import AnyReference
    from .frame import Frame

__all__ = ["Comparison", "assert_matches", "compare", "write_pictures"]


@dataclasses.dataclass(frozen=True, eq=False)
class Comparison:
    """Numbers of one comparison; prints as one line.

    Attributes
    ----------
    relative_rmse : float
        Trimmed, and free of the reference's own noise where that is known.
    untrimmed : float
        The same with every pixel of the mask.
    median : float
        Median relative error.
    energy : float
        Mean of the picture over the mean of the reference, less one.
    noise : float
        Noise of the reference relative to its mean; NaN for a plain array.
    pixels : int
        Of the mask.
    trim : float
    worst : (row, column)
        The pixel with the largest error.
    image, reference : (H, W, 3) float32
    mask : (H, W) bool
    """

    relative_rmse: float
    untrimmed: float
    median: float
    energy: float
    noise: float
    pixels: int
    trim: float
    worst: tuple[int, int]
    image: NDArray[np.float32] = dataclasses.field(repr=False)
    reference: NDArray[np.float32] = dataclasses.field(repr=False)
    mask: NDArray[np.bool_] = dataclasses.field(repr=False)

    def __str__(self) -> str:
        row, column = self.worst
        shown = (np.array2string(a[row, column], precision=4) for a in (self.image, self.reference))
        noise = "unknown" if math.isnan(self.noise) else f"{self.noise:.3%}"
        return (
            f"relative RMSE {self.relative_rmse:.4%} (trim {self.trim:g}; untrimmed {self.untrimmed:.4%}), "
            f"median {self.median:.4%}, energy {self.energy:+.4%}, {self.pixels:,} pixels, "
            f"reference noise {noise}; worst at row {row}, column {column}: {' instead of '.join(shown)}"
        )


def compare(
    frame: Frame | ArrayLike,
    reference: AnyReference,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.001,
) -> Comparison:
    """Measure a frame against a reference, as `miplight.metrics` defines it.

    Parameters
    ----------
    frame : Frame or (H, W, 3) array_like
        Of a frame, the part that the reference is: ``.direct`` or ``.indirect`` if the `Reference` says so,
        else
        ``.image``.
    reference : Reference or (H, W, 3) array_like
    mask : (H, W) array_like of bool, optional
        By default the frame's ``surface_mask``: pixels that see a surface which is no light. All pixels of an
        array.
    trim : float, default 0.001
        Fraction of the pixels to leave out, the worst ones.

    Returns
    -------
    Comparison

    Raises
    ------
    SettingsError
        For shapes that do not fit, values that are not finite or an empty mask.
    """
    image = _picture_of(frame, reference)
    source: Any = reference
    truth = np.asarray(source.mean if hasattr(source, "halves") else source, dtype=np.float32)
    if mask is None:
        mask = getattr(frame, "surface_mask", None)
    chosen = np.ones(image.shape[:2], dtype=bool) if mask is None else np.asarray(mask)
    options: dict[str, Any] = {"mask": chosen}
    trimmed = metrics.relative_rmse(image, reference, trim=trim, **options)
    error = np.where(chosen, np.abs(image - truth).mean(axis=-1), -1.0)
    row, column = np.unravel_index(int(np.argmax(error)), error.shape)
    level = float(truth[chosen].mean(dtype=np.float64))
    variance = getattr(reference, "variance", None)
    deviation = math.nan if variance is None else float(np.sqrt(np.mean(variance[chosen], dtype=np.float64)))
    return Comparison(
        relative_rmse=trimmed,
        untrimmed=metrics.relative_rmse(image, reference, **options),
        median=metrics.median_relative_error(image, reference, **options),
        energy=float(image[chosen].mean(dtype=np.float64)) / level - 1.0 if level > 0 else math.nan,
        noise=deviation / level if level > 0 else math.nan,
        pixels=int(chosen.sum()),
        trim=trim,
        worst=(int(row), int(column)),
        image=image,
        reference=truth,
        mask=chosen,
    )


def assert_matches(
    frame: Frame | ArrayLike,
    reference: AnyReference,
    relative_rmse: float | None = None,
    median: float | None = None,
    energy: float | None = None,
    *,
    mask: ArrayLike | None = None,
    trim: float = 0.001,
) -> Comparison:
    """Assert that a frame matches its reference within bounds.

    Parameters
    ----------
    frame, reference, mask, trim
        As for `compare`.
    relative_rmse : float, optional
        Largest trimmed relative RMSE allowed (0.02 is 2 %).
    median : float, optional
        Largest median relative error allowed.
    energy : float, optional
        Largest relative difference of the mean radiance allowed.

    Returns
    -------
    Comparison
        All numbers, when it holds.

    Raises
    ------
    AssertionError
        With all numbers, and which bound is broken.
    SettingsError
        If no bound is given or one is not positive; and as for `compare`.

    Examples
    --------
    >>> import numpy as np
    >>> from miplight.testing import assert_matches
    >>> truth = np.ones((4, 4, 3), np.float32)
    >>> assert_matches(truth * 1.01, truth, relative_rmse=0.011).pixels
    16
    """
    bounds = {"relative RMSE": relative_rmse, "median": median, "energy": energy}
    given = {
        name: as_number(bound, name, above=0.0, error=SettingsError)
        for name, bound in bounds.items()
        if bound is not None
    }
    if not given:
        raise SettingsError("no bound is given; allowed: at least one of relative_rmse, median, energy")
    result = compare(frame, reference, mask=mask, trim=trim)
    values = {"relative RMSE": result.relative_rmse, "median": result.median, "energy": abs(result.energy)}
    # written so that NaN breaks a bound
    broken = [
        f"{name} {values[name]:.4%} > {bound:.4%}"
        for name, bound in given.items()
        if not values[name] <= bound
    ]
    if broken:
        failure = AssertionError(f"{'; '.join(broken)}\n{result}")
        failure.comparison = result  # type: ignore[attr-defined]
        raise failure
    return result


def write_pictures(result: Comparison, folder: Path) -> list[Path]:
    """Write image, reference and error picture, each as PNG and EXR, and the numbers as text.

    Parameters
    ----------
    result : Comparison
    folder : Path
        Made if it does not exist.

    Returns
    -------
    list of Path
        What was written. The PNGs share the exposure of the reference; the error PNG shows |I − R| as a
        fraction of the mean radiance, from black (none) to white (a quarter and more), zero outside the mask.
    """
    from .frame_files import write_exr
    from .notebook import auto_exposure, png_bytes, to_srgb8

    folder.mkdir(parents=True, exist_ok=True)
    exposure = auto_exposure(result.reference, result.mask)
    error = np.where(result.mask[..., None], np.abs(result.image - result.reference), 0.0).astype(np.float32)
    level = float(result.reference[result.mask].mean()) or 1.0
    shown = {
        "image": to_srgb8(result.image, exposure),
        "reference": to_srgb8(result.reference, exposure),
        "error": (np.clip(4.0 * error / level, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8),
    }
    written = []
    for name, pixels in shown.items():
        path = folder / f"{name}.png"
        path.write_bytes(png_bytes(pixels))
        values = error if name == "error" else getattr(result, name)
        write_exr(path.with_suffix(".exr"), values, {}, {})
        written += [path, path.with_suffix(".exr")]
    numbers = folder / "numbers.txt"
    numbers.write_text(f"{result}\n", encoding="utf-8")
    return [*written, numbers]


def _picture_of(frame: Any, reference: Any) -> NDArray[np.float32]:
    """Return the part of a frame that a reference is a picture of, or the array itself."""
    if not hasattr(frame, "surface_mask"):
        image = np.asarray(frame)
        if image.dtype.kind != "f" or image.ndim != 3 or image.shape[-1] != 3:
            raise SettingsError(
                f"frame is an array of shape {image.shape}, {image.dtype}; "
                "allowed: a Frame or floats of shape (H, W, 3)"
            )
        return image.astype(np.float32)
    part = getattr(reference, "info", {}).get("part", "total")
    picture: NDArray[np.float32] = getattr(
        frame, {"direct": "direct", "indirect": "indirect"}.get(part, "image")
    )
    return picture
