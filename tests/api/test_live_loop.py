"""The thread behind a live view: what is asked for last is drawn first, and nothing piles up."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from miplight.live_view.loop import Job, Loop, Superseded


class Draws:
    """Draws nothing, takes its time, and keeps what it was asked for."""

    def __init__(self, seconds: float = 0.0, stages: int = 2) -> None:
        self.jobs: list[Job] = []
        self.ended: list[Job] = []
        self.seconds, self.stages = seconds, stages
        self.patience: float | None = None
        self.loop = Loop(self)
        self.acknowledges = True

    def __call__(self, job: Job) -> bool:
        """Draw a job, unless it is out of date."""
        self.jobs.append(job)
        if job.stage == 0 and self.patience is not None:
            self.loop.patience(self.patience)
        end = time.monotonic() + self.seconds
        while time.monotonic() < end:
            self.loop.check()
            time.sleep(0.005)
        self.ended.append(job)
        if self.acknowledges:
            self.loop.shown(job.sent + 1)
        return job.stage < self.stages

    def until(self, there: Callable[[], bool], seconds: float = 5.0) -> None:
        """Wait until something is there."""
        end = time.monotonic() + seconds
        while not there():
            assert time.monotonic() < end, self.jobs
            time.sleep(0.005)


@pytest.fixture
def draws() -> Iterator[Draws]:
    made = Draws()
    yield made
    made.loop.close()


def test_it_draws_coarsely_then_finely_then_rests(draws: Draws) -> None:
    draws.loop.start()
    time.sleep(0.05)
    assert not draws.jobs, "nothing was asked for"
    draws.loop.request()
    draws.until(lambda: len(draws.ended) == 3)
    time.sleep(0.1)
    assert [(job.version, job.stage) for job in draws.ended] == [(1, 0), (1, 1), (1, 2)]


def test_the_newest_request_wins(draws: Draws) -> None:
    draws.seconds = 0.05
    draws.loop.start()
    for _ in range(100):
        draws.loop.request()
        time.sleep(0.003)
    draws.until(lambda: draws.ended[-1:] == [Job(100, 2, draws.ended[-1].sent)])
    moving = [job.version for job in draws.ended if job.stage == 0]
    assert moving == sorted(set(moving))
    assert 3 <= len(moving) <= 12, "each takes 50 ms of 300"
    assert [job.stage for job in draws.ended if job.version == 100][-2:] == [1, 2]
    # pictures of a moving hand are drawn to their end, or nothing would be seen
    assert [job for job in draws.jobs if job.stage == 0] == [job for job in draws.ended if job.stage == 0]


def test_a_fine_picture_is_given_up(draws: Draws) -> None:
    draws.loop.start()
    draws.loop.request(settled=True)
    draws.until(lambda: len(draws.ended) == 2)
    draws.seconds = 30.0
    draws.loop.request(settled=True)
    draws.until(lambda: len(draws.jobs) == 3)
    asked = time.monotonic()
    draws.seconds = 0.0
    draws.loop.request()
    draws.until(lambda: draws.ended[-1].version == 3)
    assert time.monotonic() - asked < 1.0
    assert draws.jobs[2] not in draws.ended


def test_a_coarse_picture_is_given_up_when_patience_ends(draws: Draws) -> None:
    draws.seconds, draws.patience = 30.0, 0.1
    draws.loop.start()
    draws.loop.request()
    draws.until(lambda: len(draws.jobs) == 1)
    time.sleep(0.2)
    assert not draws.ended, "there is no newer request, so it goes on"
    assert len(draws.jobs) == 1
    draws.seconds = 0.0
    draws.loop.request()
    draws.until(lambda: draws.ended[:1] == [Job(2, 0, 0)])


def test_pictures_that_nobody_shows_do_not_pile_up(draws: Draws) -> None:
    draws.acknowledges = False
    draws.loop.start()
    for _ in range(30):
        draws.loop.request()
        time.sleep(0.01)
    assert len(draws.ended) == 2, "two may be underway"
    draws.loop.shown(1)
    draws.until(lambda: len(draws.ended) == 3)
    # a page that never answers is not waited for without end
    draws.until(lambda: draws.ended[-1].stage == 2, seconds=8.0)


def test_closing_gives_up_what_is_drawn() -> None:
    draws = Draws(seconds=30.0)
    draws.loop.start()
    draws.loop.request()
    draws.until(lambda: len(draws.jobs) == 1)
    start = time.monotonic()
    draws.loop.close()
    draws.loop.close()
    assert time.monotonic() - start < 1.0
    assert not draws.ended
    assert not [thread for thread in threading.enumerate() if thread.name == "miplight-live"]
    draws.loop.start()
    assert len(draws.jobs) == 1


def test_nothing_else_catches_the_end_of_a_render() -> None:
    assert not issubclass(Superseded, Exception)
