"""A thread that draws what was asked for last: nothing piles up, and what is out of date is given up."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

# Still for so long, seconds, counts as still: a hand rests between two movements.
_SETTLE = 0.25
# A view that does not say that it showed a picture is not waited for any longer than this, seconds.
_ACKNOWLEDGE = 1.0
# Pictures on their way to the view at a time: one is shown while the next one is made.
_UNDERWAY = 2


class Superseded(BaseException):
    """Ends a render whose result nobody wants any more; no `Exception`, so that nothing takes it for one."""


@dataclass(frozen=True)
class Job:
    """One picture to draw.

    Parameters
    ----------
    version
        Of the request that it answers.
    stage
        0 while something moves, then 1, 2, … each finer than the one before.
    sent
        How many pictures were drawn before it.
    """

    version: int
    stage: int
    sent: int


class Loop:
    """Draws on a thread of its own: at once and coarsely after a request, then finer when there is no other.

    Parameters
    ----------
    draw
        Draws a job; returns whether there is a finer stage. It may call `check` of this loop, and lets
        `Superseded` pass. It handles its own errors.
    """

    def __init__(self, draw: Callable[[Job], bool]) -> None:
        self._draw = draw
        self._wake = threading.Condition()
        self._version = 0
        self._touched = 0.0
        self._drawn = (0, 0)  # version and stage that were drawn last
        self._finished = True
        self._sent = self._shown = 0
        self._sent_at = 0.0
        self._job: Job | None = None
        self._overdue = float("inf")
        self._closed = False
        self._thread: threading.Thread | None = None

    # from any thread

    def start(self) -> None:
        """Begin to draw; nothing happens if it has begun."""
        with self._wake:
            if self._thread is None and not self._closed:
                self._thread = threading.Thread(target=self._run, name="miplight-live", daemon=True)
                self._thread.start()

    def request(self, *, settled: bool = False) -> None:
        """Something changed: draw it; `settled`: at once as finely as when nothing moves."""
        with self._wake:
            self._version += 1
            self._touched = time.monotonic() - (_SETTLE if settled else 0.0)
            self._wake.notify_all()

    def settle(self) -> None:
        """Nothing moves any more: do not wait before drawing finely."""
        with self._wake:
            self._touched = min(self._touched, time.monotonic() - _SETTLE)
            self._wake.notify_all()

    def shown(self, sent: int) -> None:
        """The view shows the picture with this number."""
        with self._wake:
            self._shown = max(self._shown, sent)  # it may say so before `_draw` is back
            self._wake.notify_all()

    def close(self) -> None:
        """End the thread: give up what it draws and wait until it is gone."""
        with self._wake:
            self._closed = True
            self._wake.notify_all()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=30.0)

    # from the thread that draws

    def patience(self, seconds: float) -> None:
        """How long the coarse picture that is being drawn may take before a newer request ends it."""
        with self._wake:
            self._overdue = time.monotonic() + seconds

    def check(self) -> None:
        """Called while a job is drawn.

        Raises
        ------
        Superseded
            If the job is out of date. A coarse one is only after `patience`: a hand that never rests would
            see nothing otherwise.
        """
        with self._wake:
            job = self._job
            if job is None:
                return
            newer = job.version != self._version
            if self._closed or (newer and (job.stage > 0 or time.monotonic() > self._overdue)):
                raise Superseded

    def _run(self) -> None:
        while True:
            job = self._next()
            if job is None:
                return
            try:
                more = self._draw(job)
            except Superseded:
                continue
            finally:
                with self._wake:
                    self._job, self._overdue = None, float("inf")
            with self._wake:
                self._drawn, self._finished = (job.version, job.stage), not more
                self._sent, self._sent_at = job.sent + 1, time.monotonic()

    def _next(self) -> Job | None:
        """Wait for something to draw; None at the end."""
        with self._wake:
            while not self._closed:
                job, pause = self._due()
                if job is not None:
                    self._job = job
                    return job
                self._wake.wait(pause)
            return None

    def _due(self) -> tuple[Job | None, float | None]:
        """What to draw now, or how many seconds to wait at most until the question is asked again."""
        now = time.monotonic()
        rest = self._touched + _SETTLE - now
        version, stage = self._drawn
        if version == self._version and (self._finished and stage > 0):
            return None, None
        if version == self._version and stage == 0 and rest > 0:
            return None, rest
        late = self._late(now)
        if late > 0:
            return None, late
        if version != self._version:
            stage = 0 if rest > 0 else 1
        elif self._version == 0:
            return None, None
        else:
            stage += 1
        return Job(self._version, stage, self._sent), None

    def _late(self, now: float) -> float:
        """Seconds to wait for the view, which has pictures that it did not show yet."""
        if self._sent - self._shown < _UNDERWAY:
            return 0.0
        rest = self._sent_at + _ACKNOWLEDGE - now
        if rest <= 0:  # it is hidden, or gone
            self._shown = self._sent
        return rest
