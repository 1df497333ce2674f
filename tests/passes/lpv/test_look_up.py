"""`look_up`: irradiance at receivers from what passed the cells before them [KD10]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import lpv
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import MISS, RECEIVER, record

Array = NDArray[np.float64]
VOLUME = lpv.Volume(np.array([1.0, -2, 3]), 0.4, (9, 7, 8))
NOTHING = np.full((3, *VOLUME.shape), lpv.NOWHERE)


def _receivers(rng: np.random.Generator, count: int) -> NDArray[Any]:
    """Anywhere but in the margin, with normals of all directions."""
    receivers = np.zeros(count, RECEIVER)
    inside = rng.uniform(1, np.array(VOLUME.size) - 1, (count, 3))
    receivers["origin"] = VOLUME.corner + inside * VOLUME.edge
    normal = rng.normal(size=(count, 3))
    shade = normal + 0.3 * rng.normal(size=(count, 3))
    receivers["normal_geo"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    receivers["normal_shade"] = shade / np.linalg.norm(shade, axis=1, keepdims=True)
    receivers["pixel"] = rng.permutation(count)
    return receivers


def _run(
    runner: Runner, receivers: NDArray[Any], passed: Array, met: Array, outside: float | None = None
) -> NDArray[np.float32]:
    """Irradiance in the order of the receivers; `passed` is (6, 3, z, y, x).

    With `outside` the volume lies inside of another, which has that irradiance everywhere.
    """
    means = np.zeros((2, passed[0].size, 4), np.float32)
    for face in range(6):
        means[face % 2, :, face // 2] = passed[face].ravel()
    out = runner(
        "passes/lpv/look_up",
        len(receivers),
        constants={"NESTED": float(outside is not None)},
        volume=VOLUME.record(),
        params=record(lpv.LOOK_UP, scale=np.sqrt(4 * np.pi) / VOLUME.edge**2),
        receivers=receivers,
        passed_lower=means[0],
        passed_upper=means[1],
        open=lpv.masks(VOLUME, met).ravel(),
        met=met.ravel().astype(np.float32),
        irradiance=np.full((len(receivers), 4), -7 if outside is None else outside, np.float32),
    )
    found = read(out, "irradiance", np.float32, -1, 4)
    return found[np.where(receivers["pixel"] == MISS, 0, receivers["pixel"]), :3]


def _expected(receivers: NDArray[Any], passed: Array, met: Array) -> Array:
    fields = [receivers[n].astype(np.float64) for n in ("origin", "normal_geo", "normal_shade")]
    rows = [lpv.look_up(VOLUME, passed, met, *row) for row in zip(*fields, strict=True)]
    return np.array(rows)


def test_receivers_see_the_cells_before_them(runner: Runner, rng: np.random.Generator) -> None:
    receivers = _receivers(rng, 1000)
    passed = (
        rng.uniform(0, 1, (6, 3, *VOLUME.shape))
        * np.array([1, 0.2, 0.5, 0.6, 0, 1])[:, None, None, None, None]
    )
    passed = passed.astype(np.float32).astype(np.float64)
    rooms = rng.integers(0, 2, VOLUME.shape)
    walls = lpv.surfaces(VOLUME, rooms, 0.3)
    for met in (NOTHING, walls):
        found = _run(runner, receivers, passed, met)
        expected = _expected(receivers, passed, met)
        # places good to 1e-6 of a cell; shares of cells near the plane are small, their quotient is not
        bound = 1e-4 * expected.max()
        assert_within(found, expected, bound, "irradiance")
        turned = receivers.copy()
        turned["normal_shade"] *= -1
        assert_not_within(found, _expected(turned, passed, met), bound)
    assert_not_within(found, _expected(receivers, passed, NOTHING), bound)
    assert_not_within(found, _expected(receivers, passed, lpv.surfaces(VOLUME, rooms, 0.6)), bound)


def test_a_volume_inside_of_another_takes_over_from_its_border_on(
    runner: Runner, rng: np.random.Generator
) -> None:
    """Within two cells of the border less and less; outside of it the other's light stays."""
    receivers = _receivers(rng, 1500)
    inside = rng.uniform(-1, np.array(VOLUME.size) + 1, (1500, 3))
    receivers["origin"] = VOLUME.corner + inside * VOLUME.edge
    passed = rng.uniform(0, 1, (6, 3, *VOLUME.shape)).astype(np.float32).astype(np.float64)
    found = _run(runner, receivers, passed, NOTHING, 3.0)
    place = (receivers["origin"].astype(np.float64) - VOLUME.corner) / VOLUME.edge
    near = np.minimum(place, np.array(VOLUME.size) - place).min(axis=1)
    share = np.clip(near / 2, 0, 1)[:, None]
    assert (share == 0).any()
    assert (share == 1).any()
    own = _expected(receivers, passed, NOTHING)
    bound = 1e-4 * own.max()
    assert_within(found, share * own + (1 - share) * 3.0, bound, "irradiance")
    assert_not_within(found, own, bound)
    assert (found[share[:, 0] == 0] == 3.0).all()


def _beams(w: Array, radiance: Array) -> Array:
    """(6,) means that beams w (n, 3) of that radiance times solid angle leave through the faces of a cell."""
    through = np.maximum(lpv.AXES @ w.T, 0) * VOLUME.edge**2
    made: Array = through @ radiance / np.sqrt(4 * np.pi)
    return made


def _everywhere(means: Array) -> Array:
    return np.broadcast_to(means[:, None, None, None, None], (6, 3, *VOLUME.shape))


@pytest.mark.parametrize("walls", [False, True])
def test_in_a_furnace_everyone_gets_the_same(runner: Runner, rng: np.random.Generator, walls: bool) -> None:
    """Radiance of 2 from everywhere: a beam of it takes through a face what falls on it."""
    radiance = 2.0
    w = rng.normal(size=(20_000, 3))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    passed = _everywhere(_beams(w, np.full(len(w), 4 * np.pi * radiance / len(w))))
    rooms = rng.integers(0, 3, VOLUME.shape) if walls else np.zeros(VOLUME.shape, int)
    found = _run(runner, _receivers(rng, 1000), passed, lpv.surfaces(VOLUME, rooms, 0.8))
    expected = np.full(found.shape, np.pi * radiance)
    assert_within(found, expected, 0.05 * expected, "irradiance")
    assert_not_within(found, 1.1 * expected, 0.05 * expected)


def test_a_beam_falls_by_the_cosine(runner: Runner, rng: np.random.Generator) -> None:
    """Exact for surfaces along the axes; never from behind, never more than all of it."""
    receivers = _receivers(rng, 500)
    axis = np.array([0, 0, 1.0])
    found = _run(runner, receivers, _everywhere(_beams(-axis[None], np.ones(1))), NOTHING)[:, 0]
    cosine = receivers["normal_shade"].astype(np.float64) @ axis
    assert_within(found[cosine < 0], np.zeros((cosine < 0).sum()), 1e-6, "from behind")
    # between the cosine and its square
    front = cosine > 0
    assert (found[front] <= cosine[front] * (1 + 1e-4)).all()
    assert (found[front] >= cosine[front] ** 2 * (1 - 1e-4)).all()
    w = np.array([0.48, 0.6, -0.64])
    for name in ("normal_geo", "normal_shade"):
        receivers[name] = axis
    found = _run(runner, receivers, _everywhere(_beams(w[None], np.ones(1))), NOTHING)
    assert_within(found, np.full(found.shape, 0.64), 1e-4, "oblique on a floor")


def test_light_behind_a_sheet_is_not_seen(runner: Runner, rng: np.random.Generator) -> None:
    """A bright and a dark side, the sheet anywhere between middles, receivers on its dark side."""
    normal = np.array([1.0, 0, 0])
    middles = VOLUME.middles()
    for place in (3.1, 3.6, 4.4, 4.49):
        bright = (middles[..., 0] - VOLUME.corner[0]) / VOLUME.edge < place
        passed = np.zeros((6, 3, *VOLUME.shape))
        passed[:, :, bright] = 1
        # the sheet crosses the way from the middle of its last bright cell to the next
        met = lpv.surfaces(VOLUME, bright.astype(int), (place - 0.5) % 1)
        receivers = _receivers(rng, 200)
        receivers["origin"][:, 0] = VOLUME.corner[0] + place * VOLUME.edge
        for name in ("normal_geo", "normal_shade"):
            receivers[name] = normal
        assert (_run(runner, receivers, passed, met) == 0).all()
        for name in ("normal_geo", "normal_shade"):
            receivers[name] = -normal
        assert (_run(runner, receivers, passed, met) > 0).all()


def test_whoever_stands_on_the_floor_sees_its_own_side(runner: Runner, rng: np.random.Generator) -> None:
    """The same sheet, receivers on a floor right beside it: the middle of their cell may lie beyond."""
    middles = VOLUME.middles()
    for place in (3.1, 3.4, 3.6, 3.9):
        bright = (middles[..., 0] - VOLUME.corner[0]) / VOLUME.edge < place
        passed = np.zeros((6, 3, *VOLUME.shape))
        passed[:, :, bright] = 1
        met = lpv.surfaces(VOLUME, bright.astype(int), (place - 0.5) % 1)
        receivers = _receivers(rng, 200)
        receivers["origin"][:, 2] = VOLUME.corner[2] + 2 * VOLUME.edge
        for name in ("normal_geo", "normal_shade"):
            receivers[name] = (0, 0, 1)
        for side in (-1, 1):
            beside = place + side * rng.uniform(0.01, 0.5, 200)
            receivers["origin"][:, 0] = VOLUME.corner[0] + beside * VOLUME.edge
            found = _run(runner, receivers, passed, met)
            assert ((found > 0) == (side < 0)).all()


def test_nobody_writes_for_who_is_not_there(runner: Runner, rng: np.random.Generator) -> None:
    receivers = _receivers(rng, 64)
    receivers["pixel"] = MISS
    found = _run(runner, receivers, np.ones((6, 3, *VOLUME.shape)), NOTHING)
    assert (found == -7).all()
