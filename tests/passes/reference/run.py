"""Runs one shader on arrays, and says how far two arrays may be apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, DTypeLike, NDArray

from miplight import _core

ULP = 2.0**-24
"""Largest relative error of one float32 rounding."""

UNIFORMS = {"params", "view", "wave", "top_level", "frame", "texture", "pyramid", "voxels", "map", "source"}
UNIFORMS |= {"volume"}
"""Bindings that are one struct, not a list."""

_HEAD = """
import package::common::grid::{{Grid, item_index}};
{imports}
@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> given: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> answer: array<vec4f>;
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {{
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {{
        return;
    }}
    _ = given[i];
{body}
}}
"""


class Runner:
    """Runs shaders of the crate, or texts that import them, on arrays."""

    def __init__(self, core: _core.KernelRunner) -> None:
        self._core = core

    def __call__(
        self,
        stem: str,
        threads: int,
        *,
        entry: str = "main",
        groups: bool = False,
        text: str | None = None,
        constants: dict[str, float] | None = None,
        **arrays: NDArray[Any],
    ) -> dict[str, NDArray[np.uint8]]:
        """Run `entry` of shaders/<stem>.wgsl; returns the bytes of every binding that it may write.

        Every list is given longer than it is by 64 items of ones, which nothing may look at or write.
        """
        given = {name: as_bytes(array) for name, array in arrays.items()}
        spare = {name: _spare(array) for name, array in arrays.items() if name not in UNIFORMS}
        longer = {name: np.concatenate([whole, spare.get(name, whole[:0])]) for name, whole in given.items()}
        out = self._core.run(stem, entry, longer, threads, groups, text, constants)
        for name, whole in out.items():
            assert (whole[len(given[name]) :] == spare[name]).all(), f"{stem} wrote beyond the end of {name}"
        return {name: whole[: len(given[name])] for name, whole in out.items()}

    def function(
        self,
        imports: str,
        body: str,
        given: NDArray[Any],
        rows: int = 1,
        **arrays: NDArray[Any],
    ) -> NDArray[np.uint32]:
        """Run `body` for each row of `given` (n, 4); it writes `rows` vec4f an item into `answer`.

        `body` sees `i` and may use `given`, `answer` and what it imports. Returns (n, rows, 4) words.
        """
        count = len(given)
        text = _HEAD.format(imports=imports, body=body)
        answer = np.zeros((count, rows, 4), np.float32)
        out = self("tests/function", count, text=text, given=given, answer=answer, **arrays)
        return out["answer"].view(np.uint32).reshape(count, rows, 4)


def as_bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    """The bytes of an array; float64 and int64 are refused, because no shader has them."""
    assert array.dtype not in (np.float64, np.int64), f"{array.dtype} is nothing that a shader reads"
    return np.frombuffer(np.ascontiguousarray(array).tobytes(), np.uint8)


def _spare(array: NDArray[Any]) -> NDArray[np.uint8]:
    """The bytes of 64 more items: floats of 1, or words of 1, which say a surface or a valid index."""
    item = array.dtype.itemsize * (array.shape[-1] if array.ndim > 1 and array.dtype.names is None else 1)
    word = np.float32 if array.dtype == np.float32 else np.uint32
    return np.ones(64 * item // 4, word).view(np.uint8)


def read(out: dict[str, NDArray[np.uint8]], name: str, dtype: DTypeLike, *shape: int) -> NDArray[Any]:
    """An output as an array of `dtype`, of `shape` where one is given."""
    array: NDArray[Any] = out[name].view(dtype)
    return array.reshape(*shape) if shape else array


def assert_within(actual: ArrayLike, expected: ArrayLike, bound: ArrayLike, what: str = "values") -> None:
    """|actual − expected| ≤ bound everywhere; NaN is never within."""
    a, e = np.asarray(actual, np.float64), np.asarray(expected, np.float64)
    assert a.shape == e.shape, f"{what}: shape {a.shape} instead of {e.shape}"
    limit = np.broadcast_to(np.asarray(bound, np.float64), a.shape)
    error = np.abs(a - e)
    bad = ~(error <= limit)
    if not bad.any():
        return
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(bad, np.nan_to_num(error / limit, nan=np.inf, posinf=np.inf), 0.0)
    worst = np.unravel_index(int(ratio.argmax()), ratio.shape)
    raise AssertionError(
        f"{what}: {bad.sum()} of {bad.size} are off; the worst, at {tuple(map(int, worst))}, "
        f"is {a[worst]!r} instead of {e[worst]!r} (allowed ± {limit[worst]:.3g})"
    )


def assert_not_within(actual: ArrayLike, expected: ArrayLike, bound: ArrayLike) -> None:
    """Negative control: the same comparison must see a difference."""
    with pytest.raises(AssertionError, match="are off"):
        assert_within(actual, expected, bound)
