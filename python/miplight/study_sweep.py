"""Sweeps: every combination of settings rendered and measured, one row a render."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from .errors import SettingsError
from .study_journal import Journal
from .study_points import Point, Study, make_study
from .study_rows import Row, pandas_module, rows_of, table
from .study_workers import spread
from .validate import as_count, fail

if TYPE_CHECKING:
    from .camera import Camera
    from .renderer import Renderer
    from .scene import Scene

__all__ = ["sweep"]


def sweep(
    scene: Scene,
    camera: Camera | Mapping[str, Camera] | None,
    grid: Any,
    reference: Any = None,
    repeats: int = 1,
    client: Any = None,
    *,
    path: str | os.PathLike[str] | None = None,
    retry: bool = False,
    adapter: str = "auto",
    renderer: Renderer | None = None,
    progress: bool | None = None,
) -> Any:
    """Render every combination of settings and measure it, one row a render.

    Parameters
    ----------
    scene
        What to render, as it is now.
    camera
        From where; a dict of named cameras is rendered from each. None if the grid has cameras.
    grid
        A dict from names to values, of which every combination is rendered: names of settings, ``"preset"``
        (by default ``["default"]``), ``"camera"`` (a dict of named cameras) and ``"lights"`` (a dict of named
        lights, each anything that `miplight.render` takes; they replace those of the scene). A value that is
        no list is one of one. Or `Settings`, or the name of a preset; or a list of all these.
    reference
        What errors are measured against: (H, W, 3) linear radiance or a `miplight.mitsuba.Reference`; or a
        dict of them by camera, by lights or by (camera, lights). None for no errors.
    repeats
        Measured renders of each point. With 2 or more a first one is thrown away; the time of a lone one may
        have pipelines in it that were built.
    client
        A `dask.distributed.Client`: the points are spread over its workers, each with a renderer of its own.
        Workers that share a machine slow each other down: compare their times with care.
    path
        A ``.parquet`` or ``.csv`` file, or a name without suffix (Parquet if pyarrow is installed). Rows are
        on disk as soon as they are there, and a sweep that is started again with the same path renders what
        is missing. See `miplight.study.load`.
    retry
        Render again what failed before, instead of keeping its row.
    adapter
        As for `miplight.Renderer`.
    renderer
        One to use and leave open; by default one is made with `adapter`.
    progress
        A line on the standard error with the time left; by default where that is a terminal.

    Returns
    -------
    pandas.DataFrame
        A row a render, in the order of the grid: ``point`` (a hash of what the picture depends on),
        ``preset``,
        ``camera``, ``lights``, ``repeat``, every setting by its name, and

        - ``error``: None, or why there is no picture or no error of it; the other points go on,
        - ``relative_rmse`` (the worst 0.1 % of the pixels left out), ``untrimmed``, ``median``, ``energy``:
          as in `miplight.testing.Comparison`,
        - ``ms``: wall time with readback of image and fragments; ``total_ms``: without; ``readback_ms``;
          ``ms:<pass>``: of each pass,
        - ``fragments``, ``indirect_fragments``, ``rays``, ``light_evaluations``, ``rebuilt``, ``image_hash``,
          ``width``, ``height``, ``adapter``, ``driver``, ``version``.

    Raises
    ------
    SceneError
        For a scene, camera or lights that are none.
    SettingsError
        For a setting or value that does not exist, before anything is rendered; for a reference of another
        size; if pandas, or what `path` or `client` needs, is not installed.
    DeviceError
        If no adapter fits.
    KeyboardInterrupt
        If Ctrl-C is pressed; with a path, the rows so far are kept.

    Notes
    -----
    Before each measured render the view is moved aside and back, so that nothing of the frame before is used
    again but what a moving camera would use, too. Points are rendered in the order of the grid, the last
    setting varying fastest, lights and cameras slowest.

    Examples
    --------
    >>> import miplight as ml
    >>> grid = {"preset": ["default", "area-2010"], "light_samples": [16, 64, 256]}
    >>> table = ml.study.sweep(scene, camera, grid, reference, repeats=5, path="sweep")  # doctest: +SKIP
    >>> ml.study.plot(table)  # doctest: +SKIP
    """
    pandas_module()
    number = as_count(repeats, "repeats", error=SettingsError)
    if client is not None and renderer is not None:
        fail("renderer", renderer, "None with a client: each worker makes its own", SettingsError)
    study, points = make_study(scene, camera, grid, reference, number, adapter)
    keys = [(point.key, repeat) for point in points for repeat in range(number)]
    with Journal(path) as journal:
        todo = _missing(journal, points, number, retry)
        with _Progress(len(keys), sum(len(left) for _, left in todo), progress) as bar:
            for row in _rendered(study, todo, client, renderer):
                journal.add(row)
                bar.step()
        rows = journal.chosen(keys)
    return table(rows)


def _missing(
    journal: Journal, points: Sequence[Point], repeats: int, retry: bool
) -> list[tuple[Point, list[int]]]:
    """Points with the numbers of the repeats that the journal does not have."""

    def wanted(key: tuple[str, int]) -> bool:
        return key not in journal or (retry and journal[key].get("error") is not None)

    left = ((point, [r for r in range(repeats) if wanted((point.key, r))]) for point in points)
    return [(point, numbers) for point, numbers in left if numbers]


def _rendered(
    study: Study, todo: list[tuple[Point, list[int]]], client: Any, renderer: Renderer | None
) -> Iterator[Row]:
    if client is None:
        yield from rows_of(study, todo, renderer)
    else:
        for rows in spread(client, study, todo):
            yield from rows


class _Progress:
    """One line that is written over and over: how much is done, and how long the rest will take."""

    def __init__(self, total: int, left: int, shown: bool | None, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._shown = self._stream.isatty() if shown is None else shown
        self._total, self._left, self._done = total, left, 0
        self._start = time.monotonic()
        self._write()

    def step(self) -> None:
        """One more row is there."""
        self._done += 1
        self._left -= 1
        self._write()

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            self._stream.write("\n")

    def _write(self) -> None:
        if not self._shown:
            return
        done = self._total - self._left
        share = done / self._total if self._total else 1.0
        text = f"{done:,} of {self._total:,} renders, {share:.0%}"
        if self._done and self._left:
            seconds = (time.monotonic() - self._start) / self._done * self._left
            text += f", {_clock(seconds)} left"
        self._stream.write(f"\r{text:<60}")
        self._stream.flush()


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
