"""Load: many threads, many frames in which everything changes; bits of a serial run, and no memory lost."""

from __future__ import annotations

import concurrent.futures
import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import floor_scene
from tests.stress.common import lamp, sized
from tests.stress.films import HOW, Film
from tests.stress.soak import SOAKS

ROOT = Path(__file__).parents[2]
THREADS = sized(4, 16)
STEPS = sized(6, 24)
Bits = list[bytes]


def _bits(renderer: ml.Renderer, number: int) -> Bits:
    film = Film(number)
    frames = [film.frame(renderer, step) for step in range(STEPS)]
    return [frame.image.tobytes() + frame.fragments.level_map.tobytes() for frame in frames]


@pytest.fixture(scope="module")
def serial(renderer: ml.Renderer) -> list[Bits]:
    """What each thread's film shows when it is alone."""
    made = [_bits(renderer, number) for number in range(THREADS)]
    assert made == [_bits(renderer, number) for number in range(THREADS)]
    assert len({bits for film in made for bits in film}) == THREADS * STEPS, "negative control: all differ"
    return made


def _together(work: Callable[[int], Bits]) -> list[Bits]:
    """Run the films at the same time, all from the same moment on."""
    start = threading.Barrier(THREADS)

    def run(number: int) -> Bits:
        start.wait()
        return work(number)

    with concurrent.futures.ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(run, range(THREADS)))


def test_threads_on_one_renderer_give_the_bits_of_a_serial_run(
    renderer: ml.Renderer, serial: list[Bits]
) -> None:
    assert _together(lambda number: _bits(renderer, number)) == serial


def test_threads_with_a_renderer_each_give_the_bits_of_a_serial_run(adapter: str, serial: list[Bits]) -> None:
    def alone(number: int) -> Bits:
        with ml.Renderer(adapter) as own:
            return _bits(own, number)

    assert _together(alone) == serial


def test_threads_that_change_one_scene_never_see_half_a_change(renderer: ml.Renderer) -> None:
    """One thread swaps two states of a light while others render: each frame is one of the two."""
    scene = floor_scene(lamp())
    light, camera = scene.lights["light_0"], ml.Camera.look_at((0, 2, 2), (0, 0, 0), width=16, height=16)
    assert isinstance(light, ml.AreaLight)
    states = [
        {"corner": light.corner.copy(), "edge_u": light.edge_u.copy()},
        {"corner": light.corner + np.array((1, 0.5, 0)), "edge_u": 0.2 * light.edge_u},
    ]
    allowed = set()
    for state in states:
        light.set_geometry(**state)
        allowed.add(renderer.render(scene, camera, HOW[0]).image.tobytes())
    assert len(allowed) == 2
    done = threading.Event()

    def swap() -> None:
        step = 0
        while not done.is_set():
            step += 1
            light.set_geometry(**states[step % 2])

    swapper = threading.Thread(target=swap)
    swapper.start()
    try:
        with concurrent.futures.ThreadPoolExecutor(THREADS) as pool:
            renders = [pool.submit(renderer.render, scene, camera, HOW[0]) for _ in range(sized(24, 400))]
            seen = {job.result().image.tobytes() for job in renders}
    finally:
        done.set()
        swapper.join()
    assert seen <= allowed


# films whose frames leave nothing behind; the software driver keeps code of kernels of the others
STEADY = {"default", "brute-force", "final-gather"}


def _soak(frames: int, kinds: set[str]) -> dict[str, float]:
    """Bytes a frame by kind of film, in a process of its own, whose heap no other test has stretched."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.stress.soak", str(frames), *sorted(kinds)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=sized(100, 1500),
        check=True,
    )
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    assert set(found) == {*kinds, "frames that are kept", "renderers"}
    return found


def test_memory_does_not_grow_with_frames() -> None:
    """Each has another light, mesh, camera and size; buffers and trees of old ones are given back."""
    growth = _soak(sized(80, 1500), STEADY)
    assert growth.pop("frames that are kept") > 32_000, "negative control: images and maps of these sizes"
    assert growth.pop("renderers") < 2 * 2**20
    assert max(growth.values()) < 16_000, growth


def test_memory_does_not_grow_where_the_driver_could_compile() -> None:
    """Mesa compiles kernels anew where uniforms decide about a loop: see docs/stability.md."""
    kinds = {*SOAKS} - STEADY
    growth = _soak(sized(20, 300), kinds)
    assert max(growth[kind] for kind in kinds) < 2**17, growth
