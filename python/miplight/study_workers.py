"""A sweep on the workers of a Dask cluster: every point done once, also when workers die."""

from __future__ import annotations

import pickle
import threading
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from .errors import SettingsError
from .study_rows import Renders, Row, failed

if TYPE_CHECKING:
    from .study_points import Point, Study

__all__ = ["spread"]

# Of a worker process: its one set of renders, and whose turn it is: threads would disturb each other's times.
_turn = threading.Lock()
_kept: dict[str, Renders] = {}


def spread(client: Any, study: Study, todo: Sequence[tuple[Point, Sequence[int]]]) -> Iterator[list[Row]]:
    """Render on workers; the rows of each point as they arrive.

    What all points share is sent to each worker once. A point whose worker died is done by another one; one
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
        raise SettingsError(
            f"client is {client!r}; allowed: a dask.distributed.Client that is not asynchronous"
        )
    waiting = _Waiting(client, study)
    suspects: list[tuple[Point, Sequence[int]]] = []
    try:
        for point, repeats in todo:
            waiting.submit(point, repeats)
        for future in distributed.as_completed(list(waiting.futures)):
            task = waiting.futures.pop(future)
            rows, _ = _answer(future)
            if rows is None:
                suspects.append(task)
            else:
                yield rows
        # one that ends its worker takes along what waits there: alone, each shows whether it was the one
        for point, repeats in suspects:
            future = waiting.submit(point, repeats)
            rows, lost = _answer(future)
            del waiting.futures[future]
            yield rows or [failed(study, point, repeat, lost) for repeat in repeats]
    finally:
        waiting.cancel()


class _Waiting:
    """What was handed out and has not come back."""

    def __init__(self, client: Any, study: Study) -> None:
        self._client = client
        self._token = study.token
        self._pickled = pickle.dumps(study)
        self._shared: Any = None
        self._number = 0
        self.futures: dict[Any, tuple[Point, Sequence[int]]] = {}

    def submit(self, point: Point, repeats: Sequence[int]) -> Any:
        """Hand out a point, for the first time or again."""
        future = self._client.submit(
            _render, self._study(), point, list(repeats), key=self._key("point"), pure=False
        )
        self.futures[future] = point, repeats
        return future

    def _study(self) -> Any:
        """The study on the cluster: made by a task, which is done again when all workers that had it died."""
        if self._shared is None or self._shared.status not in ("pending", "finished"):
            with warnings.catch_warnings():
                # large it is, and it is sent to each worker once
                warnings.filterwarnings("ignore", message="Sending large graph")
                self._shared = self._client.submit(
                    pickle.loads, self._pickled, key=self._key("study"), pure=False
                )
        return self._shared

    def _key(self, what: str) -> str:
        """A name that no other task has had."""
        self._number += 1
        return f"miplight-{what}-{self._token}-{self._number}"

    def cancel(self) -> None:
        """Take back what nobody waits for any more."""
        if self.futures:
            self._client.cancel(list(self.futures), force=True)
        self.futures.clear()
        self._shared = None


def _answer(future: Any) -> tuple[list[Row] | None, str]:
    """The rows of a point; or None and why, if its workers died.

    Raises
    ------
    Exception
        If no worker could begin: it does not have a package, for instance.
    """
    from distributed import KilledWorker

    try:
        return future.result(), ""
    except KilledWorker as error:
        return None, f"KilledWorker: {error}"
    except Exception as error:
        if future.status == "error":
            raise
        return None, f"{type(error).__name__}: {error}"


def _render(study: Study, point: Point, repeats: list[int]) -> list[Row]:
    """Runs on a worker, which keeps its renderer for the next point of the same sweep."""
    with _turn:
        if study.token not in _kept:
            for other in _kept.values():
                other.close()
            _kept.clear()
            _kept[study.token] = Renders(study)
        return list(_kept[study.token].rows(point, repeats))
