"""Checks at the border, shared by every class that takes user input.

Each check returns a clean value (float64 or float32 arrays of its own, C order, read-only) or raises an error
that names the argument, shows the value and says what is allowed. Nothing is changed in place.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .errors import MiplightError, SceneError

__all__ = [
    "as_bool",
    "as_choice",
    "as_color",
    "as_color_or_image",
    "as_colors",
    "as_count",
    "as_matrix",
    "as_name",
    "as_normals",
    "as_number",
    "as_positions",
    "as_triangles",
    "as_uvs",
    "as_vector",
    "fail",
    "freeze",
    "nearest_name",
    "show",
]

INTEGER_COLOUR_HINT = "colours are linear floats: pass ml.srgb_to_linear(uint8_image)"
# A matrix whose smallest singular value is below this fraction of its largest flattens what it transforms.
SINGULAR_RATIO = 1e-10


def show(value: object) -> str:
    """Shorten a value for an error message: small arrays in full, larger ones by shape and dtype."""
    if isinstance(value, np.ndarray):
        if 0 < value.size <= 16:
            digits = " ".join(np.array2string(value, separator=", ", threshold=16).split())  # on one line
            return f"{digits} ({value.dtype})"
        return f"an array of shape {value.shape}, {value.dtype}"
    text = " ".join(repr(value).split())
    return text if len(text) <= 120 else f"{text[:100]}… ({type(value).__name__})"


def fail(name: str, value: object, allowed: str, error: type[MiplightError] = SceneError) -> NoReturn:
    """Raise `error`: the argument's name, its value and what is allowed."""
    raise error(f"{name} is {value if isinstance(value, _Shown) else show(value)}; allowed: {allowed}")


class _Shown(str):
    """Text for `fail` that already describes the value."""

    __slots__ = ()


def freeze(array: NDArray[Any]) -> NDArray[Any]:
    """Make an array that we own read-only, so that what was checked stays as it was checked."""
    array.flags.writeable = False
    return array


def nearest_name(name: str, names: Iterable[str]) -> str:
    """Say which known name is nearest to a misspelt one: ``", did you mean 'bunny'?"`` or an empty string."""
    near = difflib.get_close_matches(name, list(names), n=1, cutoff=0.5)
    return f", did you mean {near[0]!r}?" if near else ""


def as_numbers(value: object, name: str, allowed: str) -> NDArray[Any]:
    """View anything array-like as a float or integer array; bool, complex, text and objects fail."""
    try:
        array = np.asarray(value)
    except Exception:  # ragged lists, tensors on another device, …: all the same to the caller
        fail(name, value, allowed)
    if array.dtype.kind not in "fiu":
        fail(name, value if array.dtype.kind != "O" else _Shown(f"{show(value)} (not numbers)"), allowed)
    return array


def _first_bad(name: str, array: NDArray[Any], bad: NDArray[np.bool_]) -> tuple[str, _Shown]:
    """Name and value of the first offending element, for arrays too large to print."""
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    where = f"{name}[{', '.join(map(str, index))}]"
    return where, _Shown(f"{array[index]!s} (in {'x'.join(map(str, array.shape))} {array.dtype})")


def require(good: NDArray[np.bool_] | np.bool_, name: str, array: NDArray[Any], allowed: str) -> None:
    """Fail with the first element for which `good` is false."""
    if not np.all(good):
        where, shown = _first_bad(name, array, ~np.asarray(good))
        fail(where, shown, allowed)


def as_vector(value: object, name: str) -> NDArray[np.float64]:
    """Check a point or a direction: (3,) finite numbers of any dtype, returned as float64."""
    allowed = "3 finite numbers"
    array = as_numbers(value, name, allowed)
    if array.shape != (3,):
        fail(name, value, allowed)
    vector = array.astype(np.float64)
    if not np.isfinite(vector).all():
        fail(name, value, allowed)
    return freeze(vector)


def as_matrix(value: object, name: str) -> NDArray[np.float64]:
    """Check an affine transform: (4, 4), finite, last row (0, 0, 0, 1), not singular; returned as float64."""
    allowed = "a finite (4, 4) affine matrix for column vectors, last row 0 0 0 1, that can be inverted"
    array = as_numbers(value, name, allowed)
    if array.shape != (4, 4):
        fail(name, value, allowed)
    matrix = array.astype(np.float64)
    if not np.isfinite(matrix).all() or not np.allclose(matrix[3], (0, 0, 0, 1), rtol=0, atol=1e-9):
        fail(name, value, allowed)
    scales = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not 1e-30 < scales[0] < 1e30 or scales[2] <= SINGULAR_RATIO * scales[0]:
        fail(name, value, allowed + f" (its scales are {scales[0]:.3g}, {scales[1]:.3g}, {scales[2]:.3g})")
    matrix[3] = (0, 0, 0, 1)
    return freeze(matrix)


def _is_array(value: object) -> bool:
    try:
        return np.ndim(value) != 0  # type: ignore[arg-type]
    except ValueError:  # a ragged list
        return True


def as_number(
    value: object,
    name: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    unit: str = "",
    error: type[MiplightError] = SceneError,
) -> float:
    """Check one finite real number within the given open (`above`, `below`) or closed bounds."""
    bounds = [
        f"{word} {bound:g}"
        for word, bound in (("above", above), ("at least", at_least), ("below", below), ("at most", at_most))
        if bound is not None
    ]
    allowed = " ".join(["a finite number", " and ".join(bounds), unit]).strip().replace("  ", " ")
    if isinstance(value, (bool, np.bool_, str, bytes)) or _is_array(value):
        fail(name, value, allowed, error)
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        fail(name, value, allowed, error)
    good = (
        math.isfinite(number)
        and (above is None or number > above)
        and (at_least is None or number >= at_least)
        and (below is None or number < below)
        and (at_most is None or number <= at_most)
    )
    if not good:
        fail(name, value, allowed, error)
    return number


def as_count(
    value: object,
    name: str,
    *,
    at_least: int = 1,
    at_most: int | None = None,
    error: type[MiplightError] = SceneError,
) -> int:
    """Check a whole number (Python or numpy; a float only if it is integral) within closed bounds."""
    allowed = (
        f"a whole number, {at_least} or more"
        if at_most is None
        else f"a whole number, {at_least} to {at_most}"
    )
    number = as_number(value, name, error=error)
    if number != int(number) or number < at_least or (at_most is not None and number > at_most):
        fail(name, value, allowed, error)
    return int(number)


def as_bool(value: object, name: str, error: type[MiplightError] = SceneError) -> bool:
    """Check a switch: True or False, not a number that may mean something else."""
    if not isinstance(value, (bool, np.bool_)):
        fail(name, value, "True or False", error)
    return bool(value)


def as_choice(
    value: object, name: str, choices: Iterable[str], error: type[MiplightError] = SceneError
) -> str:
    """Check that a text is one of `choices`; the nearest one is suggested."""
    names = list(choices)
    if not isinstance(value, str) or value not in names:
        hint = nearest_name(value, names) if isinstance(value, str) else ""
        fail(name, value, ", ".join(map(repr, names)) + hint, error)
    return value


def as_name(value: object, name: str = "name") -> str:
    """Check the name of a mesh or a light: a text that is not empty."""
    if not isinstance(value, str) or not value.strip():
        fail(name, value, "a text that is not empty")
    return value


def _float_colours(value: object, name: str, allowed: str) -> NDArray[Any]:
    """Refuse integer colours, which are display codes; three plain Python ints are exact numbers."""
    array = as_numbers(value, name, allowed)
    plain = isinstance(value, (tuple, list)) and all(type(v) in (int, float) for v in value)
    elements = isinstance(value, (tuple, list)) and any(isinstance(v, np.integer) for v in value)
    if elements or (array.dtype.kind != "f" and not plain):
        fail(name, value, f"{allowed}; {INTEGER_COLOUR_HINT}")
    return array


def _as_color_array(
    value: object, name: str, allowed: str, array: NDArray[Any], maximum: float
) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        color = np.array(array, dtype=np.float32, order="C", copy=True)
    # one cheap test for the common case (a video frame every render); the offender is looked up on failure
    if not (color.min() >= 0 and color.max() <= maximum and np.isfinite(color.max())):
        if array.shape == (3,):
            fail(name, value, allowed)
        require(np.isfinite(color) & (color >= 0) & (color <= maximum), name, array, allowed)
    color += 0.0  # -0.0 becomes 0.0
    return freeze(color)


def as_color(value: object, name: str, maximum: float = math.inf) -> NDArray[np.float32]:
    """Check a linear RGB colour: (3,) finite floats in [0, maximum], returned as float32."""
    allowed = f"3 finite floats {_range(maximum)} (linear RGB)"
    array = _float_colours(value, name, allowed)
    if array.shape != (3,):
        fail(name, value, allowed)
    return _as_color_array(value, name, allowed, array, maximum)


def as_color_or_image(value: object, name: str, maximum: float = math.inf) -> NDArray[np.float32]:
    """Check a linear RGB colour (3,) or image (h, w, 3) in [0, maximum], returned as float32."""
    allowed = f"floats of shape (3,) or (h, w, 3), linear RGB, finite and {_range(maximum)}"
    array = _float_colours(value, name, allowed)
    is_image = array.ndim == 3 and array.shape[2] == 3 and array.size > 0
    if array.shape != (3,) and not is_image:
        hint = "; drop the alpha channel with [..., :3]" if array.ndim == 3 and array.shape[-1] == 4 else ""
        fail(name, value if array.size <= 16 else _Shown(show(array)), allowed + hint)
    return _as_color_array(value, name, allowed, array, maximum)


def _range(maximum: float) -> str:
    return "not below 0" if math.isinf(maximum) else f"in [0, {maximum:g}]"


def as_positions(value: object, name: str, count: int | None = None) -> NDArray[np.float64]:
    """Check vertex positions: (V, 3) numbers, V > 0 (or `count`); NaN may pass; returned as float64."""
    allowed = f"numbers of shape ({'V' if count is None else count}, 3)" + (
        ", V > 0" if count is None else ""
    )
    array = as_numbers(value, name, allowed)
    if (
        array.ndim != 2
        or array.shape[1] != 3
        or len(array) == 0
        or (count is not None and len(array) != count)
    ):
        fail(name, _Shown(show(array)), allowed)
    return freeze(np.array(array, dtype=np.float64, order="C", copy=True))


def as_triangles(value: object, name: str, vertices: int) -> NDArray[np.uint32]:
    """Check triangle corners: (F, 3) whole numbers in [0, vertices), F > 0; returned as uint32."""
    allowed = (
        f"whole numbers of shape (F, 3), F > 0, from 0 to {vertices - 1} (the mesh has {vertices} vertices)"
    )
    array = as_numbers(value, name, allowed)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        fail(name, _Shown(show(array)), allowed)
    good = (array >= 0) & (array < vertices)
    if array.dtype.kind == "f":
        good &= array == np.floor(array)
    require(good, name, array, allowed)
    return freeze(np.array(array, dtype=np.uint32, order="C", copy=True))


def as_uvs(value: object, name: str, vertices: int) -> NDArray[np.float32]:
    """Check texture coordinates: (V, 2) finite numbers, one row a vertex; returned as float32."""
    allowed = f"finite numbers of shape ({vertices}, 2), one row a vertex"
    array = as_numbers(value, name, allowed)
    if array.shape != (vertices, 2):
        fail(name, _Shown(show(array)), allowed)
    with np.errstate(over="ignore"):
        uvs = np.array(array, dtype=np.float32, order="C", copy=True)
    require(np.isfinite(uvs), name, array, allowed)
    return freeze(uvs)


def as_colors(value: object, name: str, vertices: int) -> NDArray[np.float32]:
    """Check vertex colours: (V, 3) linear floats in [0, 1], one row a vertex; returned as float32."""
    allowed = f"floats in [0, 1] of shape ({vertices}, 3), linear RGB, one row a vertex"
    array = _float_colours(value, name, allowed)
    if array.shape != (vertices, 3):
        fail(name, _Shown(show(array)), allowed)
    return _as_color_array(value, name, allowed, array, 1.0)


def as_normals(value: object, name: str, vertices: int) -> NDArray[np.float64]:
    """Check vertex normals: (V, 3) numbers, one row a vertex; lengths and NaN are the caller's to mend."""
    allowed = f"numbers of shape ({vertices}, 3), one row a vertex"
    array = as_numbers(value, name, allowed)
    if array.shape != (vertices, 3):
        fail(name, _Shown(show(array)), allowed)
    return np.array(array, dtype=np.float64, order="C", copy=True)
