"""`shadow` in its WGSL form: which samples of a light receivers see, against every triangle in float64."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import MISS, RECEIVER, SHADOW, record
from tests.passes.reference.trees import Object, meet, random_objects, trees

NORMAL = np.array([0.0, -1.0, 0.0])


@dataclasses.dataclass
class Case:
    """Receivers and the samples of one light, patterns × strata."""

    objects: list[Object]
    receivers: NDArray[Any]
    points: NDArray[np.float32]
    strata: int
    two_sided: bool = False
    cos_cutoff: float = -2.0


def _case(rng: np.random.Generator, strata: int, count: int = 257, **more: Any) -> Case:
    patterns = 3
    points = np.empty((patterns * strata, 4), np.float32)
    points[:, :3] = rng.uniform((-1, 2.5, -1), (1, 4.5, 1), (patterns * strata, 3))
    points[:, 3] = 0.999
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = rng.uniform(-3, 3, (count, 3)) * (1, 1.5, 1)
    normals = rng.normal(size=(2, count, 3))
    normals[1] = normals[0] + 0.3 * normals[1]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    receivers["normal_geo"], receivers["normal_shade"] = normals
    receivers["pattern"] = rng.integers(0, patterns, count)
    receivers["pattern"][::19] = MISS
    receivers["pattern"][7::23] = patterns
    return Case(random_objects(rng), receivers, points, strata, **more)


def _run(runner: Runner, case: Case, asked: NDArray[np.bool_] | None = None) -> tuple[NDArray[np.bool_], int]:
    """Which samples are seen (of those asked), (receivers, strata), and how many rays that took."""
    count, words = len(case.receivers), -(-case.strata // 32)
    params = record(
        SHADOW,
        light_normal=NORMAL,
        cone_axis=NORMAL,
        two_sided=case.two_sided,
        cos_cutoff=case.cos_cutoff,
        receivers=count,
        strata=case.strata,
        patterns=len(case.points) // case.strata,
        words=words,
    )
    before = np.full(count * words, MISS, np.uint32)
    if asked is not None:
        wide = np.ones((count, 32 * words), bool)
        wide[:, : case.strata] = asked
        before = np.packbits(wide, axis=1, bitorder="little").reshape(-1).view(np.uint32)
    out = runner(
        "passes/visibility/shadow",
        count * words,
        entry="main" if asked is None else "asked",
        params=params,
        receivers=case.receivers,
        points=case.points,
        visibility=before,
        counter=np.zeros(2, np.uint32),
        **trees(case.objects),
    )
    bits = np.unpackbits(out["visibility"].reshape(count, -1), axis=1, bitorder="little").astype(bool)
    assert not bits[:, case.strata :].any(), "spare bits are cleared"
    return bits[:, : case.strata], int(read(out, "counter", np.uint64)[0])


def _reference(case: Case) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Seen, facing, and where rounding may decide; (receivers, strata)."""
    r = case.receivers
    patterns = len(case.points) // case.strata
    live = r["pattern"] < patterns
    row = np.where(live, r["pattern"], 0)
    points = case.points.reshape(patterns, case.strata, 4).astype(np.float64)[row]
    origin = np.broadcast_to(r["origin"].astype(np.float64)[:, None], points[..., :3].shape)
    d = points[..., :3] - origin
    unit = d / np.linalg.norm(d, axis=-1, keepdims=True)
    normals = [r[name].astype(np.float64) for name in ("normal_geo", "normal_shade")]
    cosines = [np.einsum("rsk,rk->rs", unit, n) for n in normals]
    if not case.two_sided:
        cosines.append(-unit @ NORMAL)
    if case.cos_cutoff > -1:
        cosines.append(-unit @ NORMAL - case.cos_cutoff)
    smallest = np.minimum.reduce(cosines)
    facing = (smallest > 0) & live[:, None]
    end = points[..., 3].ravel()
    met = meet(case.objects, origin.reshape(-1, 3), d.reshape(-1, 3), np.zeros(len(end)), end)
    doubtful = met.doubtful.reshape(facing.shape) | (np.abs(smallest) < 1e-5)
    return facing & ~met.hit.reshape(facing.shape), facing, doubtful


@pytest.mark.parametrize("strata", [1, 16, 32, 33, 70])
@pytest.mark.parametrize("kind", [{}, {"two_sided": True}, {"two_sided": True, "cos_cutoff": 0.7}])
def test_bits_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, strata: int, kind: dict[str, Any]
) -> None:
    case = _case(rng, strata, **kind)
    found, rays = _run(runner, case)
    seen, facing, doubtful = _reference(case)
    assert (found == seen)[~doubtful].all()
    assert doubtful.mean() < 0.2
    assert abs(rays - int(facing.sum())) <= 2
    assert 0 < seen.sum() < facing.sum() < facing.size


def test_each_condition_counts(runner: Runner, rng: np.random.Generator) -> None:
    """Negative controls: bits change with each thing that they depend on."""
    case = _case(rng, 64)
    bits = _run(runner, case)[0]
    for name, value in [("objects", []), ("two_sided", True), ("cos_cutoff", 0.8)]:
        changed = dataclasses.replace(case, **{name: value})
        assert (_run(runner, changed)[0] != bits).any(), name
    for name in ("normal_geo", "normal_shade"):
        receivers = case.receivers.copy()
        receivers[name] *= -1
        assert (_run(runner, dataclasses.replace(case, receivers=receivers))[0] != bits).any(), name


def test_inactive_receivers_see_nothing(runner: Runner, rng: np.random.Generator) -> None:
    case = _case(rng, 40)
    bits, _ = _run(runner, case)
    inactive = case.receivers["pattern"] >= 3
    assert inactive.any()
    assert not bits[inactive].any()
    assert bits[~inactive].any()


@pytest.mark.parametrize("strata", [1, 16, 33, 70])
@pytest.mark.parametrize("kind", [{}, {"two_sided": True, "cos_cutoff": 0.7}])
def test_asked_samples_stay_when_nothing_hides_them(
    runner: Runner, rng: np.random.Generator, strata: int, kind: dict[str, Any]
) -> None:
    case = _case(rng, strata, **kind)
    asked = rng.uniform(size=(len(case.receivers), strata)) < 0.3
    found, rays = _run(runner, case, asked)
    seen, facing, doubtful = _reference(case)
    live = (case.receivers["pattern"] < 3)[:, None]
    expected = asked & live & (seen | ~facing)
    assert (found == expected)[~doubtful].all()
    assert abs(rays - int((asked & facing).sum())) <= 2
    # Negative control: facing alone does not decide, nor does what nobody asked for.
    assert (expected != (asked & live)).any()
    assert (expected != (live & (seen | ~facing))).any()
