"""A sweep on the workers of a Dask cluster: every point done once, also when workers die."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from .errors import SettingsError
from .study_rows import Renders, Row, failed

if TYPE_CHECKING:
    from .study_points import Point, Study

__all__ = ["spread"]

# Tries at a point whose answer was lost, apart from those that Dask makes by itself.
_TRIES = 5

# Of a worker process: its one set of renders, and whose turn it is. Threads would only disturb each other's times.
_turn = threading.Lock()
_kept: dict[str, Renders] = {}


def spread(client: Any, study: Study, todo: Sequence[tuple[Point, Sequence[int]]]) -> Iterator[list[Row]]:
    """Render on workers; the rows of each point as they arrive.

    What all points share is sent to each worker once. A point whose worker died is done by another one; a point
    that has ended several workers becomes rows with an error.

    Raises
    ------
    SettingsError
        If `client` is no Dask client.
    """
    try:
        import distributed
    except ImportError as error:
        raise SettingsError(
            "client needs Dask; allowed: None, or an installation with the extra study, "
            "pip install miplight[study]"
        ) from error
    if not isinstance(client, distributed.Client) or client.asynchronous:
        raise SettingsError(f"client is {client!r}; allowed: a dask.distributed.Client that is not asynchronous")
    waiting = _Waiting(client, study)
    try:
        for point, repeats in todo:
            waiting.submit(point, repeats)
        arriving = distributed.as_completed(list(waiting.futures))
        for future in arriving:
            point, repeats = waiting.futures.pop(future)
            rows = _answer(future, study, point, repeats)
            if rows is None:
                arriving.add(waiting.submit(point, repeats))
            else:
                yield rows
    finally:
        waiting.cancel()


class _Waiting:
    """What was handed out and has not come back."""

    def __init__(self, client: Any, study: Study) -> None:
        self._client = client
        self._study = study
        self._sent: Any = None
        self._tries: dict[str, int] = {}
        self.futures: dict[Any, tuple[Point, Sequence[int]]] = {}

    def submit(self, point: Point, repeats: Sequence[int]) -> Any:
        """Hand out a point, for the first time or again."""
        number = self._tries[point.key] = self._tries.get(point.key, 0) + 1
        if number > _TRIES:
            raise SettingsError(f"a point was lost by {_TRIES} workers; see the logs of the cluster")
        if self._sent is None or self._sent.status != "finished":  # lost with the last worker that had it
            self._sent = self._client.scatter(self._study, broadcast=True, hash=False)
        key = f"miplight-{self._study.token}-{point.key}-{number}"
        future = self._client.submit(_render, self._sent, point, list(repeats), key=key, pure=False)
        self.futures[future] = point, repeats
        return future

    def cancel(self) -> None:
        """Take back what nobody waits for any more."""
        if self.futures:
            self._client.cancel(list(self.futures), force=True)
        self.futures.clear()
        self._sent = None


def _answer(future: Any, study: Study, point: Point, repeats: Sequence[int]) -> list[Row] | None:
    """The rows of a point; None if they were lost on the way."""
    from distributed import KilledWorker

    if future.status == "finished":
        rows: list[Row] = future.result()
        return rows
    if future.status != "error":
        return None
    error = future.exception()
    if not isinstance(error, KilledWorker):
        raise error  # no worker could begin: a package that it does not have, for instance
    return [failed(study, point, repeat, f"KilledWorker: {error}") for repeat in repeats]


def _render(study: Study, point: Point, repeats: list[int]) -> list[Row]:
    """Runs on a worker, which keeps its renderer for the next point of the same sweep."""
    with _turn:
        if study.token not in _kept:
            for other in _kept.values():
                other.close()
            _kept.clear()
            _kept[study.token] = Renders(study)
        return list(_kept[study.token].rows(point, repeats))
