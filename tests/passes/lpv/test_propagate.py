"""`propagate`: light from cell to cell: flux is kept, nothing grows, walls are tight [KD10]."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import lpv
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import record

Array = NDArray[np.float64]
KEPT = 0.8
"""The default of `lpv_most_flow`."""


def _run(
    runner: Runner,
    volume: lpv.Volume,
    flow: Array,
    open_faces: NDArray[np.uint32],
    transport: str = "directions",
    steps: int = 1,
    **params: float,
) -> tuple[Array, Array]:
    """The flow after some steps, and the sum over all, the first included."""
    values: dict[str, Any] = {**lpv.coefficients(transport), "most": 1.0, "reflected": 0.0, **params}
    now = np.ascontiguousarray(flow, np.float32).reshape(-1, 4)
    total = now.copy()
    for _ in range(steps):
        out = runner(
            "passes/lpv/propagate",
            len(now),
            volume=volume.record(),
            params=record(lpv.PROPAGATE, **values),
            flow=now,
            open=open_faces.ravel(),
            next=np.full_like(now, np.nan),
            total=total,
        )
        now, total = (read(out, name, np.float32, -1, 4) for name in ("next", "total"))
    return now.reshape(flow.shape).astype(np.float64), total.reshape(flow.shape).astype(np.float64)


def _volume(*size: int) -> lpv.Volume:
    return lpv.Volume(np.array([-1.0, 0.5, 2.0]), 0.25, (size[0], size[1], size[2]))


def _room(cells: int) -> tuple[lpv.Volume, NDArray[np.uint32]]:
    """A closed room of `cells` cells a side, a cell of margin about it."""
    volume = _volume(cells + 2, cells + 2, cells + 2)
    rooms = np.zeros(volume.shape, int)
    rooms[1:-1, 1:-1, 1:-1] = 1
    return volume, lpv.between(volume, rooms)


def _floor(volume: lpv.Volume, first: int, end: int) -> Array:
    """A part of the floor z = 1 with a radiosity of 1: flux of a face's area in each cell."""
    flow = np.zeros((3, *volume.shape, 4))
    flow[:, 1, first:end, first:end] = volume.edge**2 * lpv.clamped_cosine(np.array([0, 0, 1.0]))
    return flow


def test_solid_angles_are_those_of_the_literature() -> None:
    angles = [angle.sum() for _, _, angle in lpv.faces_seen(1)]
    assert_within(sorted(angles), [0.4007] + [0.4234] * 4, 5e-5, "front and sides")
    assert_within(sum(angles), 4 * np.pi / 6, 1e-12, "a sixth of the sphere")
    whole = sum(lpv.passing(face, "directions") for face in range(6))
    assert_within(whole, np.eye(4), 1e-12, "projections onto the six directions")
    assert_not_within(sum(lpv.passing(face, "faces") for face in range(6)), np.eye(4), 0.3)


@pytest.mark.parametrize("transport", ["directions", "faces"])
@pytest.mark.parametrize("reflected", [0.0, 0.7])
def test_a_step_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, transport: str, reflected: float
) -> None:
    volume = _volume(7, 5, 9)
    flow = rng.normal(size=(3, *volume.shape, 4)) * [0.5, 1, 1, 1] + [1, 0, 0, 0]
    flow = flow.astype(np.float32).astype(np.float64)
    open_faces = lpv.between(volume, rng.integers(0, 2, volume.shape))
    after, total = _run(runner, volume, flow, open_faces, transport, most=KEPT, reflected=reflected)
    expected = lpv.step(flow, open_faces, transport, KEPT, reflected)
    # sums of some 24 products, as large as the flow; shortened by a quotient of such sums
    bound = 200 * ULP * np.abs(flow).max()
    assert_within(after, expected, bound, "flow")
    assert_within(total, flow + expected, 2 * bound, "sum")
    other = lpv.step(flow, lpv.no_walls(volume), transport, KEPT, reflected)
    assert_not_within(after, other, bound)
    unlimited = lpv.step(flow, open_faces, transport, 1e9, reflected)
    assert_not_within(after, unlimited, bound)


@pytest.mark.parametrize("transport", ["directions", "faces"])
def test_a_closed_white_box_keeps_its_light_for_a_thousand_steps(runner: Runner, transport: str) -> None:
    volume, open_faces = _room(6)
    flow = _floor(volume, 1, 3)
    before = lpv.flux(flow).sum()
    for most in (KEPT, 1.0):
        after, _ = _run(runner, volume, flow, open_faces, transport, most=most, reflected=1.0)
        assert_within(lpv.flux(after).sum(), before, 1e-5 * before, "after one step")
        after, _ = _run(runner, volume, flow, open_faces, transport, 1000, most=most, reflected=1.0)
        assert np.isfinite(after).all()
        assert_within(lpv.flux(after).sum(), before, 1e-3 * before, "after a thousand")
        assert (lpv.flux(after)[:, 0] == 0).all(), "and none got out"
    leaking, _ = _run(runner, volume, flow, open_faces, transport, 1, most=KEPT, reflected=0.98)
    assert lpv.flux(leaking).sum() < before


def test_light_in_the_open_never_grows(runner: Runner, rng: np.random.Generator) -> None:
    volume = _volume(8, 8, 8)
    flow = rng.normal(size=(3, *volume.shape, 4))
    size = [float((flow**2).sum())]
    now = flow
    for _ in range(20):
        now, _ = _run(runner, volume, now, lpv.no_walls(volume), steps=5, most=KEPT)
        size.append(float((now**2).sum()))
    assert all(after <= before for before, after in itertools.pairwise(size))
    assert size[-1] < 1e-3 * size[0]


def test_an_even_field_stays_even(runner: Runner) -> None:
    """Constant radiance: a step brings each cell that lies off the end what it sends out."""
    volume = _volume(8, 8, 8)
    flow = np.zeros((3, *volume.shape, 4))
    flow[..., 0] = 3.0
    after, _ = _run(runner, volume, flow, lpv.no_walls(volume), most=KEPT)
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    assert_within(after[inside], flow[inside], 1e-5, "inside")
    assert_not_within(after, flow, 0.1)


def test_no_light_goes_through_a_wall(runner: Runner) -> None:
    """A wall of two cells across a volume, and one without thickness."""
    for thick in (2, 0):
        volume = _volume(16, 8, 8)
        rooms = np.zeros(volume.shape, int)
        rooms[..., 7:] = 1
        rooms[..., 7 + thick :] = 2
        flow = np.zeros((3, *volume.shape, 4))
        flow[:, :, :, 2, 0] = 1
        args = (volume, flow, lpv.between(volume, rooms))
        _, total = _run(runner, *args, steps=64, most=KEPT)
        assert (total[..., 7 + thick :, :] == 0).all()
        assert lpv.flux(total)[..., 6].min() > 0
        _, open_total = _run(runner, volume, flow, lpv.no_walls(volume), steps=64, most=KEPT)
        assert lpv.flux(open_total)[..., 7 + thick :].min() > 0


def _irradiance(volume: lpv.Volume, total: Array, place: tuple[int, int, int], towards: Array) -> float:
    out = lpv.through_face() / volume.edge**2
    at = total[0][place]
    return float(out[0] * at[0] + out[1] * at[1:] @ towards)


def _true_irradiance(point: Array, normal: Array, first: int, end: int) -> float:
    """From the cells `first` to `end` of the floor z = 1, radiosity 1, in cells."""
    x = first + (np.arange(200) + 0.5) * (end - first) / 200
    floor = np.stack([*np.meshgrid(x, x), np.ones((200, 200))], axis=-1).reshape(-1, 3)
    d = floor - point
    far = np.linalg.norm(d, axis=1)
    w = d / far[:, None]
    weight = np.clip(w @ normal, 0, None) * np.clip(-w[:, 2], 0, None) / far**2
    return float(weight.mean() * (end - first) ** 2 / np.pi)


def test_a_bright_floor_lights_walls_and_ceiling(runner: Runner) -> None:
    """A black room whose floor shines: what arrives is right within 40 %; faces lose nearly all of it."""
    cells = 16
    volume, open_faces = _room(cells)
    flow = _floor(volume, 1, cells + 1)
    up, side = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    middle = cells // 2 + 1
    for transport, near in (("directions", True), ("faces", False)):
        _, total = _run(runner, volume, flow, open_faces, transport, 96, most=KEPT)
        ceiling = _irradiance(volume, total, (cells, middle, middle), up)
        wall = _irradiance(volume, total, (middle, middle, cells), side)
        true_ceiling = _true_irradiance(np.array([middle, middle, cells + 1.0]), -up, 1, cells + 1)
        true_wall = _true_irradiance(np.array([cells + 1.0, middle, middle + 0.5]), -side, 1, cells + 1)
        ratios = ceiling / true_ceiling, wall / true_wall
        if near:
            assert all(0.6 < ratio < 1.4 for ratio in ratios), ratios
        else:
            assert ratios[0] < 0.25
            assert ratios[1] < 0.5
