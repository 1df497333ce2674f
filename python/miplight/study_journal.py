"""The file of a sweep: rows are appended as they come, and become a table when the sweep ends or is stopped.

A Parquet file has its directory at its end and a CSV file its columns at its start, so neither takes rows
whose passes are not known before. Until the end rows therefore go, a line of JSON each, to a file beside it,
``NAME.parquet.rows``. A process that dies leaves that file, of which at most the last line is cut short.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from .errors import SettingsError
from .study_rows import Row, key_of, pandas_module, parsed, table
from .validate import fail

if TYPE_CHECKING:
    from types import TracebackType

__all__ = ["Journal", "load"]

SUFFIXES = (".parquet", ".csv")


class Journal:
    """Rows by point and repeat, kept in a file if there is a path.

    Parameters
    ----------
    path
        A ``.parquet`` or ``.csv`` file, or one of them without its suffix; None for no file.

    Raises
    ------
    SettingsError
        If the suffix is another one, Parquet cannot be written, or another sweep is writing the file.
    OSError
        If the file cannot be read or written.
    """

    def __init__(self, path: str | os.PathLike[str] | None) -> None:
        self._path = None if path is None else _table_path(path)
        self._stream: BinaryIO | None = None
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = _opened(_rows_path(self._path))
        try:
            self._rows = {key_of(row): row for row in _read(self._path)}
            if self._stream is not None:
                _cut(self._stream)
        except BaseException:
            self._close()
            raise

    def __contains__(self, key: tuple[str, int]) -> bool:
        return key in self._rows

    def __getitem__(self, key: tuple[str, int]) -> Row:
        return self._rows[key]

    def add(self, row: Row) -> None:
        """Keep a row, on disk before this returns; one of the same point and repeat gives way to it."""
        self._rows[key_of(row)] = row
        if self._stream is not None:
            self._stream.write(json.dumps(row).encode() + b"\n")
            self._stream.flush()
            os.fsync(self._stream.fileno())

    def chosen(self, keys: Iterable[tuple[str, int]]) -> list[Row]:
        """The rows of these points and repeats, as far as they are there; from now on the first ones."""
        first = {key: self._rows[key] for key in keys if key in self._rows}
        self._rows = first | self._rows
        return list(first.values())

    def finish(self) -> None:
        """Write the table, whole or not at all, and remove the file of single rows."""
        if self._path is not None and self._stream is not None:
            if self._rows:
                part = self._path.with_name(f"{self._path.name}.part")
                _write(table(self._rows.values()), part, self._path.suffix)
                part.replace(self._path)
            _rows_path(self._path).unlink(missing_ok=True)
        self._close()

    def _close(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.finish()
        finally:
            self._close()


def load(path: str | os.PathLike[str]) -> Any:
    """Read the table of a sweep, also while it is being written or after it was cut short.

    Parameters
    ----------
    path
        As it was given to `miplight.study.sweep`.

    Returns
    -------
    pandas.DataFrame
        All rows that the file has.

    Raises
    ------
    SettingsError
        If there is no such file, or pandas is not installed.
    """
    pandas_module()
    found = _table_path(path)
    if not found.exists() and not _rows_path(found).exists():
        fail("path", str(path), "the file of a sweep", SettingsError)
    rows = {key_of(row): row for row in _read(found)}
    return table(rows.values())


def _table_path(path: str | os.PathLike[str]) -> Path:
    """The path with its suffix: that of a file that is there, or the best that can be written."""
    target = Path(path)
    parquet = importlib.util.find_spec("pyarrow") is not None
    if not target.suffix:
        named = [target.with_name(target.name + suffix) for suffix in SUFFIXES]
        there = [name for name in named if name.exists() or _rows_path(name).exists()]
        target = (there or named[0 if parquet else 1 :])[0]
    if target.suffix not in SUFFIXES:
        fail("path", str(path), f"a file name that ends in {' or '.join(SUFFIXES)}", SettingsError)
    if target.suffix == ".parquet" and not parquet:
        raise SettingsError(
            f"path is {str(path)!r}, and Parquet needs pyarrow; allowed: a .csv file, or an installation "
            "with the extra study, pip install miplight[study]"
        )
    return target


def _rows_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.rows")


def _opened(path: Path) -> BinaryIO:
    """Open the file of single rows for this process alone."""
    while True:
        stream = path.open("a+b")
        try:
            import fcntl  # not there on Windows, where nothing hinders a second sweep
        except ImportError:
            return stream
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            stream.close()
            raise SettingsError(f"path is {str(path)!r}, which another sweep is writing") from error
        # the sweep that held it may have removed it meanwhile
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(path.stat(), os.fstat(stream.fileno())):
                return stream
        stream.close()


def _cut(stream: BinaryIO) -> None:
    """Remove a last line that was cut short."""
    stream.seek(0)
    stream.truncate(stream.read().rfind(b"\n") + 1)
    stream.seek(0, os.SEEK_END)


def _read(path: Path | None) -> Iterator[Row]:
    """Rows of the table, then the newer ones beside it."""
    if path is None:
        return
    if path.exists():
        yield from _table_rows(path)
    beside = _rows_path(path)
    if beside.exists():
        for line in beside.read_bytes().split(b"\n")[:-1]:
            with contextlib.suppress(ValueError):  # a line that a full disk cut short
                row = json.loads(line)
                if isinstance(row, dict) and {"point", "repeat"} <= row.keys():
                    yield row


def _table_rows(path: Path) -> Iterator[Row]:
    pandas = pandas_module()
    try:
        if path.suffix == ".csv":
            # as text: numbers are then read to the last bit, and names of digits stay names
            found = pandas.read_csv(path, dtype=str, keep_default_na=False)
        else:
            found = pandas.read_parquet(path, engine="pyarrow")
        if not {"point", "repeat"} <= set(found.columns):
            raise ValueError("no columns point and repeat")
        for record in found.to_dict("records"):
            row = record if path.suffix != ".csv" else {name: parsed(name, v) for name, v in record.items()}
            yield {name: value for name, value in row.items() if not pandas.isna(value)}
    except ValueError as error:
        raise SettingsError(f"path is {str(path)!r}, which is no table of a sweep ({error})") from error


def _write(frame: Any, path: Path, suffix: str) -> None:
    if suffix == ".csv":
        frame.to_csv(path, index=False)
    else:
        frame.to_parquet(path, engine="pyarrow", index=False)
