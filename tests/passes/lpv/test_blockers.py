"""`blockers`: which faces of cells light passes: rays from middle to middle, and masks of their answers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.passes.reference import lpv
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import RAY

Array = NDArray[np.float64]
VOLUME = lpv.Volume(np.array([1.0, -2, 3]), 0.4, (6, 5, 7))


def _rays(runner: Runner, volume: lpv.Volume) -> NDArray[Any]:
    out = runner(
        "passes/lpv/blockers",
        3 * volume.cells,
        entry="rays_between",
        volume=volume.record(),
        rays=np.zeros(3 * volume.cells, RAY),
    )
    return read(out, "rays", RAY, 3, *volume.shape)


def _faces(runner: Runner, volume: lpv.Volume, blocked: NDArray[np.bool_]) -> NDArray[np.uint32]:
    bits = np.zeros(-(-blocked.size // 32) * 32, bool)
    bits[: blocked.size] = blocked.ravel()
    out = runner(
        "passes/lpv/blockers",
        volume.cells,
        entry="faces",
        volume=volume.record(),
        occluded=np.packbits(bits, bitorder="little").view(np.uint32),
        open=np.full(volume.cells, 99, np.uint32),
    )
    return read(out, "open", np.uint32, *volume.shape)


def test_rays_go_from_middle_to_middle(runner: Runner) -> None:
    rays = _rays(runner, VOLUME)
    middles = VOLUME.middles()
    for axis in range(3):
        mine = rays[axis]
        last = np.arange(VOLUME.size[axis]) == VOLUME.size[axis] - 1
        end = np.moveaxis(np.zeros(VOLUME.shape, bool) | False, 2 - axis, -1).copy()
        end[..., last] = True
        end = np.moveaxis(end, -1, 2 - axis)
        active = mine["t_max"] > mine["t_min"]
        assert (active == ~end).all()
        step = VOLUME.edge * np.eye(3)[axis]
        start = mine["origin"].astype(np.float64)
        stop = start + mine["direction"] * mine["t_max"][..., None]
        # a little over both ends, so that what lies in a middle is met
        assert_within(start[active], (middles - 0.02 * step)[active], 1e-6, "start")
        assert_within(stop[active], (middles + 1.02 * step)[active], 1e-6, "end")
        assert_not_within(stop[active], (middles + step)[active], 1e-3)


def test_masks_hold_what_rays_found(runner: Runner, rng: np.random.Generator) -> None:
    blocked = rng.uniform(size=(3, *VOLUME.shape)) < 0.4
    found = _faces(runner, VOLUME, blocked)
    expected = lpv.no_walls(VOLUME)
    for axis in range(3):
        array_axis = 2 - axis
        up = expected & (~(blocked[axis].astype(np.uint32) << (2 * axis + 1))).astype(np.uint32)
        below = np.roll(blocked[axis], 1, array_axis)
        expected = up & (~(below.astype(np.uint32) << (2 * axis))).astype(np.uint32)
    assert (found == expected).all()
    assert (found != lpv.no_walls(VOLUME)).any()
    free = _faces(runner, VOLUME, np.zeros_like(blocked))
    assert (free == lpv.no_walls(VOLUME)).all()


def test_a_sheet_is_tight_wherever_it_lies(runner: Runner, rng: np.random.Generator) -> None:
    """Planes in any direction, one of them through the middles: no cell reaches one on the other side."""
    volume = lpv.Volume(np.zeros(3), 1.0, (8, 8, 8))
    rays = _rays(runner, volume)
    planes = [(np.array([1.0, 0, 0]), 3.5), (np.array([1.0, 1, 0]), 8.0)]
    planes += [(n, n @ [4.1, 3.9, 4.2]) for n in rng.normal(size=(6, 3))]
    for normal, offset in planes:
        start = rays["origin"].astype(np.float64) @ normal - offset
        stop = start + rays["direction"].astype(np.float64) @ normal
        masks = _faces(runner, volume, start * stop < 0)
        side = np.sign(np.round(volume.middles() @ normal - offset, 9))
        reached = np.zeros(volume.shape, bool)
        first = tuple(np.argwhere(side < 0)[0])
        reached[first] = True
        for _ in range(64):
            for face in range(6):
                open_faces = (masks >> face & 1).astype(bool)
                reached |= open_faces & lpv.shifted(reached[None], face)[0]
        assert reached.sum() > 50
        assert not reached[side > 0].any()
