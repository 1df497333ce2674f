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
"""Near the default of `lpv_most_flow`."""
AXES = ("along_x", "along_y", "along_z")


SIDES = [None, *lpv.AXES]


def _run(
    runner: Runner,
    volume: lpv.Volume,
    flow: Array,
    open_faces: NDArray[np.uint32],
    transport: str = "lobes",
    steps: int = 1,
    side: Array | None = None,
    channels: int = 3,
    **params: float,
) -> tuple[Array, Array]:
    """The flow after some steps, and (6, 3, z, y, x) the means that left through faces in all of them."""
    values: dict[str, Any] = {**lpv.coefficients(), "most": 1.0, "reflected": 0.0, **params}
    now = np.ascontiguousarray(flow, np.float32).reshape(-1, 4)
    lower, upper = np.zeros_like(now), np.zeros_like(now)
    sides = dict(zip(("SIDE_X", "SIDE_Y", "SIDE_Z"), (0, 0, 0) if side is None else side, strict=True))
    items = channels * volume.cells
    for first in range(0, len(now), items):
        held = {"params": record(lpv.PROPAGATE, **values, first=first)}
        along = {name: np.full((2 * items, 4), np.nan, np.float32) for name in AXES}
        for _ in range(steps):
            left = {"flow": now, "passed_lower": lower, "passed_upper": upper, **along}
            constants = {"FACES": transport == "faces", **sides}
            out = runner("passes/lpv/propagate", items, entry="leave", constants=constants, **held, **left)
            lower, upper = (read(out, f"passed_{name}", np.float32, -1, 4) for name in ("lower", "upper"))
            along = {name: read(out, name, np.float32, -1, 4) for name in AXES}
            arrived = {"volume": volume.record(), "open": open_faces.ravel(), "flow": now, **along}
            out = runner("passes/lpv/propagate", items, entry="arrive", **held, **arrived)
            now = read(out, "flow", np.float32, -1, 4)
    passed = np.stack([each[:, axis] for axis in range(3) for each in (lower, upper)])
    shape = (6, *flow.shape[:-1])
    return now.reshape(flow.shape).astype(np.float64), passed.reshape(shape).astype(np.float64)


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


def _flow(rng: np.random.Generator, volume: lpv.Volume, most: float = 1.0) -> Array:
    """Any light, some of it a beam, some nearly even, some none."""
    mean = rng.lognormal(0, 2, (3, *volume.shape, 1)) * (rng.uniform(size=(3, *volume.shape, 1)) < 0.9)
    way = rng.normal(size=(3, *volume.shape, 3))
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    net = most * rng.uniform(0, 1, mean.shape) ** 0.5
    flow = np.concatenate([mean, np.sqrt(3) * net * mean * way], axis=-1)
    return flow.astype(np.float32).astype(np.float64)


def test_solid_angles_are_those_of_the_literature() -> None:
    angles = [angle.sum() for _, _, angle in lpv.faces_seen(1)]
    assert_within(sorted(angles), [0.4007] + [0.4234] * 4, 5e-5, "front and sides")
    assert_within(sum(angles), 4 * np.pi / 6, 1e-12, "a sixth of the sphere")


@pytest.mark.parametrize("transport", ["lobes", "faces"])
@pytest.mark.parametrize("reflected", [0.0, 0.7])
def test_a_step_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, transport: str, reflected: float
) -> None:
    volume = _volume(7, 5, 9)
    flow = _flow(rng, volume)
    open_faces = lpv.between(volume, rng.integers(0, 2, volume.shape))
    after, passed = _run(runner, volume, flow, open_faces, transport, most=KEPT, reflected=reflected)
    expected, left = lpv.step(flow, open_faces, transport, KEPT, reflected)
    # sixteenth powers of sums of three products, and sums of some fifty of them, as large as the flow
    bound = 400 * ULP * np.abs(flow).max()
    assert_within(after, expected, bound, "flow")
    assert_within(passed, left, bound, "what left")
    other, _ = lpv.step(flow, lpv.no_walls(volume), transport, KEPT, reflected)
    assert_not_within(after, other, bound)
    unlimited, _ = lpv.step(flow, open_faces, transport, 1e9, reflected)
    assert_not_within(after, unlimited, bound)
    in_turn, passed_in_turn = _run(
        runner, volume, flow, open_faces, transport, channels=1, most=KEPT, reflected=reflected
    )
    assert (in_turn == after).all()
    assert (passed_in_turn == passed).all()


@pytest.mark.parametrize("side", range(6))
def test_light_never_flies_back_to_where_it_left(runner: Runner, rng: np.random.Generator, side: int) -> None:
    volume = _volume(5, 6, 4)
    flow, way = _flow(rng, volume, KEPT), lpv.AXES[side]
    open_faces = lpv.between(volume, rng.integers(0, 2, volume.shape))
    after, passed = _run(runner, volume, flow, open_faces, side=way, most=KEPT)
    expected, left = lpv.step(flow, open_faces, "lobes", KEPT, side=way)
    bound = 400 * ULP * np.abs(flow).max()
    assert_within(after, expected, bound, "flow")
    assert_within(passed, left, bound, "what left")
    assert (passed[side ^ 1] == 0).all()
    together, _ = _run(runner, volume, flow, open_faces, most=KEPT)
    assert_not_within(together, expected, bound)


def test_all_light_leaves_and_none_is_negative(runner: Runner, rng: np.random.Generator) -> None:
    """However far from even: no face gets less than nothing, and the mean and the net flow are kept."""
    volume = _volume(6, 6, 6)
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    beams = _flow(rng, volume, 0.999)
    # sharper lobes than 24 directions have are cut
    flow = np.zeros_like(beams)
    flow[inside] = _flow(rng, volume, 0.85)[inside]
    for side in SIDES:
        assert _run(runner, volume, beams, lpv.no_walls(volume), side=side)[1].min() >= 0
        after, passed = _run(runner, volume, flow, lpv.no_walls(volume), side=side)
        assert passed.min() >= 0
        assert_within(passed.sum(axis=0), flow[..., 0], 1e-5 * flow[..., 0].max(), "mean")
        kept, before = after.sum(axis=(1, 2, 3)), flow.sum(axis=(1, 2, 3))
        # what flies behind its side is turned, and cut
        known = slice(0, 4 if side is None else 1)
        bound = 1e-5 * np.abs(flow).sum(axis=(1, 2, 3)).max()
        assert_within(kept[:, known], before[:, known], bound, "all light and its net flow")
    _, linear = _run(runner, volume, flow, lpv.no_walls(volume), "faces")
    assert linear.min() < -0.1 * linear.max(), "negative control: two bands are"


def test_faint_light_goes_the_same_way(runner: Runner, rng: np.random.Generator) -> None:
    """Squares of 1e-25 are nothing in single precision."""
    volume = _volume(6, 5, 4)
    flow = _flow(rng, volume, KEPT)
    after, passed = _run(runner, volume, flow, lpv.no_walls(volume), most=KEPT)
    faint, faint_passed = _run(runner, volume, 1e-25 * flow, lpv.no_walls(volume), most=KEPT)
    assert_within(faint * 1e25, after, 1e-5 * after.max(), "flow")
    assert_within(faint_passed * 1e25, passed, 1e-5 * passed.max(), "what left")


@pytest.mark.parametrize("transport", ["lobes", "faces"])
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
    now = _flow(rng, volume)
    size = [float(lpv.flux(now).sum())]
    for _ in range(20):
        now, _ = _run(runner, volume, now, lpv.no_walls(volume), steps=5, most=KEPT)
        size.append(float(lpv.flux(now).sum()))
    assert all(after <= before for before, after in itertools.pairwise(size))
    assert size[-1] < 1e-3 * size[0]


def test_an_even_field_stays_even(runner: Runner) -> None:
    """Constant radiance: a step brings each cell that lies off the end what it sends out."""
    volume = _volume(8, 8, 8)
    flow = np.zeros((3, *volume.shape, 4))
    flow[..., 0] = 3.0
    after, passed = _run(runner, volume, flow, lpv.no_walls(volume), most=KEPT)
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    assert_within(after[inside], flow[inside], 1e-5, "inside")
    assert_within(passed, np.full(passed.shape, 0.5), 1e-6, "a sixth through each face")
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
        _, passed = _run(runner, *args, steps=64, most=KEPT)
        assert (passed[..., 7 + thick :] == 0).all()
        assert passed.sum(axis=0)[..., 6].min() > 0
        _, open_passed = _run(runner, volume, flow, lpv.no_walls(volume), steps=64, most=KEPT)
        assert open_passed.sum(axis=0)[..., 7 + thick :].min() > 0


def _irradiance(volume: lpv.Volume, passed: Array, place: tuple[int, int, int], towards: Array) -> float:
    """Of a surface before the cell."""
    at = passed[(slice(None), 0, *place)]
    return float(lpv.falling(-towards, at) / volume.edge**2)


def _true_irradiance(point: Array, normal: Array, first: int, end: int) -> float:
    """From the cells `first` to `end` of the floor z = 1, radiosity 1, in cells."""
    x = first + (np.arange(200) + 0.5) * (end - first) / 200
    floor = np.stack([*np.meshgrid(x, x), np.ones((200, 200))], axis=-1).reshape(-1, 3)
    d = floor - point
    far = np.linalg.norm(d, axis=1)
    w = d / far[:, None]
    weight = np.clip(w @ normal, 0, None) * np.clip(-w[:, 2], 0, None) / far**2
    return float(weight.mean() * (end - first) ** 2 / np.pi)


def test_a_bright_floor_lights_walls_and_ceiling_and_not_itself(runner: Runner) -> None:
    """A black room whose floor shines: what arrives is right within 35 %; faces lose nearly all of it."""
    cells = 16
    volume, open_faces = _room(cells)
    flow = _floor(volume, 1, cells + 1)
    up, across = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    middle = cells // 2 + 1
    true_ceiling = _true_irradiance(np.array([middle, middle, cells + 1.0]), -up, 1, cells + 1)
    true_wall = _true_irradiance(np.array([cells + 1.0, middle, middle + 0.5]), -across, 1, cells + 1)
    for transport, side in (("lobes", up), ("lobes", None), ("faces", None)):
        _, passed = _run(runner, volume, flow, open_faces, transport, 96, side=side, most=KEPT)
        ceiling = _irradiance(volume, passed, (cells, middle, middle), up)
        wall = _irradiance(volume, passed, (middle, middle, cells), across)
        own = _irradiance(volume, passed, (1, middle, middle), -up)
        ratios = ceiling / true_ceiling, wall / true_wall
        if transport == "lobes":
            assert all(0.65 < ratio < 1.35 for ratio in ratios), ratios
            assert own == 0 if side is not None else 0 < own < 0.3
        else:
            assert ratios[0] < 0.25
            assert ratios[1] < 0.5
