"""Rows of a sweep: one measured render each, and the table that they make."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ._table import KNOBS
from .errors import DeviceError, MiplightError, SettingsError
from .renderer import Renderer
from .settings import Settings
from .testing import compare

if TYPE_CHECKING:
    from .camera import Camera
    from .frame import Frame
    from .study_points import Point, Study

__all__ = ["Renders", "Row", "failed", "key_of", "pandas_module", "parsed", "rows_of", "table"]

Row: TypeAlias = dict[str, Any]
"""Values by column; what is missing has no value in the table."""

OUTPUTS = ("image", "fragments")
ERRORS = ("relative_rmse", "untrimmed", "median", "energy")
_NAMES = (
    "point",
    "preset",
    "camera",
    "lights",
    "error",
    "image_hash",
    "rebuilt",
    "adapter",
    "driver",
    "version",
)
_COUNTS = ("repeat", "width", "height")
_MAYBE_COUNTS = ("fragments", "indirect_fragments", "rays", "light_evaluations")
_TIMES = ("ms", "total_ms", "readback_ms")
STAGE = "ms:"
"""What the names of columns with the time of one pass begin with."""
COLUMNS = (
    *("point", "preset", "camera", "lights", "repeat"),
    *KNOBS,
    *("error", *ERRORS, *_TIMES, *_MAYBE_COUNTS),
    *("image_hash", "rebuilt", "width", "height", "adapter", "driver", "version"),
)
"""Columns that every table has, in order; the times of passes follow."""


def pandas_module() -> Any:
    """Import pandas.

    Raises
    ------
    SettingsError
        If it is not installed.
    """
    try:
        import pandas
    except ImportError as error:
        raise SettingsError(
            "tables need pandas; allowed: an installation with the extra study, pip install miplight[study]"
        ) from error
    return pandas


class Renders:
    """A renderer that goes from point to point; one of its own is made anew after its adapter was lost.

    Parameters
    ----------
    study
        What the points share.
    renderer
        Someone else's, which is left open; by default one of its own, made for the first point.
    """

    def __init__(self, study: Study, renderer: Renderer | None = None) -> None:
        self._study = study
        self._renderer = renderer
        self._own = renderer is None

    def rows(self, point: Point, repeats: Iterable[int]) -> Iterator[Row]:
        """Render a point once for each number of a repeat; what fails becomes the error of a row.

        With more than one repeat in the study a first frame, which may have to build pipelines, is thrown
        away.
        """
        error = ""
        warm = self._study.repeats == 1
        for repeat in repeats:
            if error:  # it would fail again
                yield failed(self._study, point, repeat, error)
                continue
            try:
                if not warm:
                    self._render(point)
                    warm = True
                row = self._measured(point, repeat)
            except Exception as found:
                error = f"{type(found).__name__}: {found}"
                if isinstance(found, DeviceError):
                    self.close()
                row = failed(self._study, point, repeat, error)
            yield row

    def close(self) -> None:
        """Close the renderer, if it is one of its own."""
        if self._own and self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def open(self) -> Renderer:
        """The renderer, made if there is none.

        Raises
        ------
        DeviceError
            If no adapter fits.
        """
        if self._renderer is None:
            self._renderer = Renderer(self._study.adapter)
        return self._renderer

    def _render(self, point: Point) -> Frame:
        study = self._study
        scene, camera = study.scenes[point.lights], study.cameras[point.camera]
        return self.open().render(scene, camera, point.settings, OUTPUTS)

    def _measured(self, point: Point, repeat: int) -> Row:
        """Render and measure with nothing left over: what pixels see is kept from a frame to a still one."""
        study, renderer = self._study, self.open()
        aside = Settings(direct="off", supersample=point.settings.supersample)
        renderer.render(study.scenes[point.lights], _aside(study.cameras[point.camera]), aside, ("image",))
        start = time.perf_counter()
        frame = self._render(point)
        wall = 1000.0 * (time.perf_counter() - start)
        row = _about(study, point, repeat) | {"ms": wall} | _costs(frame) | _adapter(renderer)
        reference = study.references[point.camera, point.lights]
        return row if reference is None else row | _errors(frame, reference)


def rows_of(
    study: Study, todo: Iterable[tuple[Point, Sequence[int]]], renderer: Renderer | None = None
) -> Iterator[Row]:
    """Render in this process, one row after the other."""
    renders = Renders(study, renderer)
    try:
        renders.open()
        for point, repeats in todo:
            yield from renders.rows(point, repeats)
    finally:
        renders.close()


def failed(study: Study, point: Point, repeat: int, error: str) -> Row:
    """A row of a render that failed."""
    return _about(study, point, repeat) | {"error": error}


def key_of(row: Mapping[str, Any]) -> tuple[str, int]:
    """What a row is known by: the hash of its point, and its repeat."""
    return str(row["point"]), int(row["repeat"])


def table(rows: Iterable[Row]) -> Any:
    """Make a DataFrame of rows, with the same columns and types however many there are."""
    pandas = pandas_module()
    listed = list(rows)
    stages = dict.fromkeys(name for row in listed for name in row if name.startswith(STAGE))
    frame = pandas.DataFrame(listed, columns=[*COLUMNS, *stages])
    return pandas.DataFrame({name: _typed(frame[name]) for name in frame.columns})


def _typed(column: Any) -> Any:
    """A column with its type: an error is text or None, any other text is text, whole numbers stay whole."""
    kind = _kind(column.name)
    if kind == "object":
        blank = None if column.name == "error" else ""
        return column.astype("object").where(column.notna(), blank)
    # a setting that an older version did not have is missing in its rows
    return column.astype("Int64" if kind == "int64" and column.isna().any() else kind)


def _kind(name: str) -> str:
    """The type of a column."""
    knob = KNOBS.get(name)
    if knob is not None:
        whole = knob.kind == "int" or (knob.choices and all(isinstance(c, int) for c in knob.choices))
        if whole:
            return "Int64" if knob.nullable or knob.default is None else "int64"
        return "float64" if knob.kind == "float" else "object"
    if name in _NAMES:
        return "object"
    if name in _COUNTS:
        return "int64"
    return "Int64" if name in _MAYBE_COUNTS else "float64"


def parsed(name: str, text: str) -> str | int | float | None:
    """The value of a column, of its text in a file; None if there is none.

    Raises
    ------
    ValueError
        If it is no number where one should be.
    """
    kind = _kind(name)
    if not text:
        return None
    return text if kind == "object" else float(text) if kind == "float64" else int(text)


def _aside(camera: Camera) -> Camera:
    """The camera, moved to its right by a thousandth of its distance from the origin, or so."""
    pose = np.array(camera.world_from_camera)
    pose[:3, 3] += pose[:3, 0] * 1e-3 * max(float(np.linalg.norm(pose[:3, 3])), 1.0)
    return camera.replace(world_from_camera=pose)


def _about(study: Study, point: Point, repeat: int) -> Row:
    from . import __version__

    camera = study.cameras[point.camera]
    return {
        "point": point.key,
        "preset": point.preset,
        "camera": point.camera,
        "lights": point.lights,
        "repeat": repeat,
        **point.settings.to_dict(),
        "width": camera.width,
        "height": camera.height,
        "version": __version__,
    }


def _costs(frame: Frame) -> Row:
    """Times and counts, and a hash of the image."""
    stats, more = frame.stats, frame.indirect_fragments
    return {
        **frame.settings.to_dict(),
        "total_ms": stats.total_ms,
        "readback_ms": stats.readback_ms,
        "fragments": frame.fragments.total,
        "indirect_fragments": None if more is None else more.total,
        "rays": stats.rays,
        "light_evaluations": stats.light_evaluations,
        "rebuilt": ", ".join(stats.rebuilt),
        "image_hash": hashlib.sha256(np.ascontiguousarray(frame.image).tobytes()).hexdigest()[:32],
        **{STAGE + name: ms for name, ms in stats.stages.items()},
    }


def _adapter(renderer: Renderer) -> Row:
    about = renderer.adapter
    return {"adapter": about["name"], "driver": about["driver"]}


def _errors(frame: Frame, reference: Any) -> Row:
    """Errors as `miplight.testing.compare` has them; where they cannot be had, why, and the times stay."""
    try:
        result = compare(frame, reference)
    except MiplightError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    return {name: float(getattr(result, name)) for name in ERRORS}
