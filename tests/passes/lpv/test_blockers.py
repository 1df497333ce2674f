"""`blockers`: which faces of cells light passes: rays from middle to middle, and masks of their answers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.passes.reference import lpv
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import HIT, MISS, RAY, record

Array = NDArray[np.float64]
VOLUME = lpv.Volume(np.array([1.0, -2, 3]), 0.4, (6, 5, 7))


def _rays(runner: Runner, volume: lpv.Volume, first: int = 0) -> NDArray[Any]:
    out = runner(
        "passes/lpv/blockers",
        3 * volume.cells - first,
        entry="rays_between",
        volume=volume.record(),
        params=record(lpv.BLOCKERS, first=first),
        rays=np.zeros(3 * volume.cells - first, RAY),
    )
    return read(out, "rays", RAY)


def _meet(runner: Runner, hits: NDArray[Any], first: int) -> NDArray[np.float32]:
    out = runner(
        "passes/lpv/blockers",
        len(hits),
        entry="meet",
        params=record(lpv.BLOCKERS, first=first),
        hits=hits,
        met=np.full(first + len(hits), -5, np.float32),
    )
    return read(out, "met", np.float32)


def _faces(runner: Runner, volume: lpv.Volume, met: Array) -> NDArray[np.uint32]:
    out = runner(
        "passes/lpv/blockers",
        volume.cells,
        entry="faces",
        volume=volume.record(),
        surfaces=met.ravel().astype(np.float32),
        open=np.full(volume.cells, 99, np.uint32),
    )
    return read(out, "open", np.uint32, *volume.shape)


def test_rays_go_from_middle_to_middle(runner: Runner) -> None:
    rays = _rays(runner, VOLUME).reshape(3, *VOLUME.shape)
    assert (_rays(runner, VOLUME, 100) == rays.ravel()[100:]).all()
    middles = VOLUME.middles()
    for axis in range(3):
        mine = rays[axis]
        end = np.indices(VOLUME.shape)[2 - axis] == VOLUME.size[axis] - 1
        active = mine["t_max"] > mine["t_min"]
        assert (active == ~end).all()
        step = VOLUME.edge * np.eye(3)[axis]
        start = mine["origin"].astype(np.float64)
        stop = start + mine["direction"] * mine["t_max"][..., None]
        # a little over both ends, so that what lies in a middle is met
        assert_within(start[active], (middles - 0.02 * step)[active], 1e-6, "start")
        assert_within(stop[active], (middles + 1.02 * step)[active], 1e-6, "end")
        assert_not_within(stop[active], (middles + step)[active], 1e-3)


def test_hits_are_places_between_middles(runner: Runner, rng: np.random.Generator) -> None:
    hits = np.zeros(300, HIT)
    hits["t"] = rng.uniform(size=300)
    hits["instance"] = np.where(rng.uniform(size=300) < 0.4, MISS, 7)
    met = _meet(runner, hits, 40)
    assert (met[:40] == -5).all()
    missed = hits["instance"] == MISS
    assert (met[40:][missed] == lpv.NOWHERE).all()
    expected = -0.02 + 1.04 * hits["t"][~missed].astype(np.float64)
    assert_within(met[40:][~missed], expected, 2e-7, "places")
    assert_not_within(met[40:][~missed], hits["t"][~missed], 2e-7)


def test_masks_hold_what_rays_found(runner: Runner, rng: np.random.Generator) -> None:
    met = rng.uniform(-0.02, 1.02, (3, *VOLUME.shape))
    met[rng.uniform(size=met.shape) < 0.6] = lpv.NOWHERE
    found = _faces(runner, VOLUME, met)
    assert (found == lpv.masks(VOLUME, met)).all()
    assert (found != lpv.no_walls(VOLUME)).any()
    assert (_faces(runner, VOLUME, np.full_like(met, lpv.NOWHERE)) == lpv.no_walls(VOLUME)).all()
    rooms = rng.integers(0, 3, VOLUME.shape)
    assert (lpv.masks(VOLUME, lpv.surfaces(VOLUME, rooms)) == lpv.between(VOLUME, rooms)).all()


def test_a_sheet_is_tight_wherever_it_lies(runner: Runner, rng: np.random.Generator) -> None:
    """Planes in any direction, one of them through the middles: no cell reaches one on the other side."""
    volume = lpv.Volume(np.zeros(3), 1.0, (8, 8, 8))
    rays = _rays(runner, volume)
    planes = [(np.array([1.0, 0, 0]), 3.5), (np.array([1.0, 1, 0]), 8.0)]
    planes += [(n, n @ [4.1, 3.9, 4.2]) for n in rng.normal(size=(6, 3))]
    for normal, offset in planes:
        start = rays["origin"].astype(np.float64) @ normal - offset
        stop = start + rays["direction"].astype(np.float64) @ normal
        met = np.where(start * stop < 0, 0.5, lpv.NOWHERE)
        masks = _faces(runner, volume, met)
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
