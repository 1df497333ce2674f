"""`voxel_shadow`: what receivers see of a light through random voxels, against float64."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import MISS, RECEIVER, SHADOW, record
from tests.passes.reference.voxels import (
    Bits,
    Grid,
    blocks_of,
    meets,
    pack_bits,
    packed_grid,
    random_grid,
    segments,
)

KINDS = [{}, {"two_sided": True}, {"two_sided": True, "cos_cutoff": 0.5}]


@dataclasses.dataclass
class Case:
    """Receivers around a grid, and the samples of one light, patterns × strata."""

    grid: Grid
    filled: Bits
    receivers: NDArray[Any]
    points: NDArray[np.float32]
    strata: int
    normal: NDArray[np.float32]
    two_sided: bool = False
    cos_cutoff: float = -2.0


def _unit(rng: np.random.Generator, *shape: int) -> NDArray[np.float64]:
    v = rng.normal(size=(*shape, 3))
    made: NDArray[np.float64] = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return made


def _case(rng: np.random.Generator, strata: int, count: int = 97, density: float = 0.01, **more: Any) -> Case:
    grid = random_grid(rng, **({"words": 3} if strata > 40 else {}))
    filled = rng.uniform(size=(grid.rows, grid.columns, grid.slices)) < density
    patterns = 3
    points = np.full((patterns * strata, 4), 0.9999, np.float32)
    local = rng.uniform((-2, -2, -1), (2, 2, 8), (patterns * strata, 3))
    points[:, :3] = local @ grid.axes + grid.eye
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = rng.uniform((-3, -3, -1), (3, 3, 8), (count, 3)) @ grid.axes + grid.eye
    receivers["normal_geo"] = _unit(rng, count)
    tilted = receivers["normal_geo"] + 0.3 * rng.normal(size=(count, 3))
    receivers["normal_shade"] = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    receivers["pattern"] = rng.integers(0, patterns, count)
    receivers["pattern"][::19] = MISS
    receivers["pattern"][7::23] = patterns
    return Case(grid, filled, receivers, points, strata, _unit(rng).astype(np.float32), **more)


def _run(
    runner: Runner,
    case: Case,
    dda: bool,
    asked: Bits | None = None,
    voxel_bits: NDArray[np.uint32] | None = None,
) -> Bits:
    """Which samples are seen (of those asked), (receivers, strata)."""
    count, words = len(case.receivers), -(-case.strata // 32)
    params = record(
        SHADOW,
        light_normal=case.normal,
        cone_axis=case.normal,
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
        "passes/visibility/voxel_shadow",
        count * words,
        entry=("main" if asked is None else "asked") + ("_dda" if dda else ""),
        params=params,
        voxels=case.grid.packed(),
        voxel_bits=packed_grid(case.filled) if voxel_bits is None else voxel_bits,
        receivers=case.receivers,
        points=case.points,
        visibility=before,
    )
    bits = np.unpackbits(read(out, "visibility", np.uint8).reshape(count, -1), axis=1, bitorder="little")
    assert not bits[:, case.strata :].any(), "spare bits are cleared"
    return bits[:, : case.strata].astype(bool)


def _facing(case: Case) -> tuple[Bits, Bits, NDArray[np.float64], NDArray[np.float64]]:
    """Facing and live, doubtful, and the samples and origins of each pair; (receivers, strata)."""
    r, patterns = case.receivers, len(case.points) // case.strata
    live = r["pattern"] < patterns
    points = case.points.reshape(patterns, case.strata, 4)[np.where(live, r["pattern"], 0), :, :3]
    points64 = points.astype(np.float64)
    origin = np.broadcast_to(r["origin"].astype(np.float64)[:, None], points64.shape)
    d = points64 - origin
    unit = d / np.linalg.norm(d, axis=-1, keepdims=True)
    cosines = [np.einsum("rsk,rk->rs", unit, r[name]) for name in ("normal_geo", "normal_shade")]
    if not case.two_sided:
        cosines.append(-unit @ case.normal)
    if case.cos_cutoff > -1:
        cosines.append(-unit @ case.normal - case.cos_cutoff)
    smallest = np.minimum.reduce(cosines)
    return (smallest > 0) & live[:, None], np.abs(smallest) < 1e-5, points64, origin


def _reference(case: Case, dda: bool) -> tuple[Bits, Bits, Bits]:
    """Hidden, facing, and where a little more or less decides; (receivers, strata)."""
    facing, doubtful, points, origin = _facing(case)
    n = np.broadcast_to(case.receivers["normal_geo"].astype(np.float64)[:, None], points.shape)
    d = points - origin
    normal = case.normal.astype(np.float64)
    m = np.where((d @ normal < 0)[..., None], normal, -normal)
    if case.cos_cutoff > -1:
        m = -d / np.linalg.norm(d, axis=-1, keepdims=True)
    pick = facing & ~doubtful
    answers = []
    for nudge in (0.0, 3e-6, -3e-6):
        off = nudge * np.array([1.0, -0.7, 0.4])
        s = segments(case.grid, origin[pick] + off, n[pick], points[pick] - off[::-1], m[pick])
        answers.append(meets(case.grid, case.filled, s, dda))
    hidden = np.zeros(facing.shape, bool)
    hidden[pick] = answers[0]
    doubtful = doubtful.copy()
    doubtful[pick] |= (answers[1] != answers[0]) | (answers[2] != answers[0])
    return hidden, facing, doubtful


@pytest.mark.parametrize("dda", [False, True])
@pytest.mark.parametrize("strata", [1, 33, 50])
@pytest.mark.parametrize("kind", KINDS)
def test_bits_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, strata: int, kind: dict[str, Any], dda: bool
) -> None:
    case = _case(rng, strata, **kind)
    found = _run(runner, case, dda)
    hidden, facing, doubtful = _reference(case, dda)
    assert (found == (facing & ~hidden))[~doubtful].all()
    assert doubtful.mean() < 0.02
    if strata > 1:
        assert 0 < hidden.sum() < facing.sum() < facing.size


@pytest.mark.parametrize("dda", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_asked_samples_stay_when_nothing_hides_them(
    runner: Runner, rng: np.random.Generator, kind: dict[str, Any], dda: bool
) -> None:
    case = _case(rng, 45, **kind)
    asked = rng.uniform(size=(len(case.receivers), case.strata)) < 0.4
    found = _run(runner, case, dda, asked)
    hidden, _, doubtful = _reference(case, dda)
    live = (case.receivers["pattern"] < 3)[:, None]
    assert (found == (asked & live & ~hidden))[~doubtful].all()
    # Negative control: neither what was asked alone decides, nor what is hidden alone.
    assert (found != (asked & live)).any()
    assert (found != (live & ~hidden)).any()


@pytest.mark.parametrize("dda", [False, True])
def test_each_rule_counts(runner: Runner, rng: np.random.Generator, dda: bool) -> None:
    """Negative controls: bits change with each thing that they depend on, and the two marches differ."""
    case = _case(rng, 40, density=0.02)
    bits = _run(runner, case, dda)
    assert (bits != _run(runner, case, not dda)).any()
    changes: list[Case] = [
        dataclasses.replace(case, filled=np.roll(case.filled, 1, axis)) for axis in range(3)
    ]
    changes.append(dataclasses.replace(case, grid=dataclasses.replace(case.grid, bias=4.0)))
    for changed in changes:
        assert (bits != _run(runner, changed, dda)).any()
    if not dda:
        more = dataclasses.replace(case, grid=dataclasses.replace(case.grid, steps=40))
        assert (bits != _run(runner, more, dda)).any()


def test_empty_blocks_are_passed(runner: Runner, rng: np.random.Generator) -> None:
    """In a wide grid with little in it the answers are those of all steps, whatever blocks save."""
    case = _case(rng, 40)
    wide = random_grid(rng, 96, 68, 2)
    wide.steps, wide.scale, wide.eye, wide.axes = 80, 4 * case.grid.scale, case.grid.eye, case.grid.axes
    filled = rng.uniform(size=(wide.rows, wide.columns, wide.slices)) < 0.0008
    case = dataclasses.replace(case, grid=wide, filled=filled)
    assert 0.02 < blocks_of(filled).mean() < 0.5
    found = _run(runner, case, False)
    hidden, facing, doubtful = _reference(case, False)
    assert (found == (facing & ~hidden))[~doubtful].all()
    assert hidden.sum() > 20
    everywhere = packed_grid(filled)
    everywhere[pack_bits(filled).size :] = 0xFFFFFFFF
    assert (_run(runner, case, False, voxel_bits=everywhere) == found).all(), "blocks only save time"
    # Negative control: without blocks nothing is found.
    everywhere[pack_bits(filled).size :] = 0
    assert (_run(runner, case, False, voxel_bits=everywhere) == facing)[~doubtful].all()


@pytest.mark.parametrize("dda", [False, True])
def test_a_wall_hides_all_and_nothing_hides_nothing(
    runner: Runner, rng: np.random.Generator, dda: bool
) -> None:
    case = _case(rng, 40, count=200)
    grid = case.grid
    local = rng.uniform((-0.3, -0.2, 1.2), (0.3, 0.2, 2), (200, 3))
    case.receivers["origin"] = local @ grid.axes + grid.eye
    case.receivers["normal_geo"] = case.receivers["normal_shade"] = grid.axes[2]
    case.receivers["pattern"] = 0
    samples = rng.uniform((-0.3, -0.2, 5), (0.3, 0.2, 6), (len(case.points), 3))
    case.points[:, :3] = samples @ grid.axes + grid.eye
    case.normal = (-grid.axes[2]).astype(np.float32)
    filled = np.zeros_like(case.filled)
    assert _run(runner, dataclasses.replace(case, filled=filled), dda).all()
    filled[..., grid.slices // 2] = True
    assert not _run(runner, dataclasses.replace(case, filled=filled), dda).any()
    # Negative control: a hole in the wall lets some through.
    filled[:, grid.columns // 2 :] = False
    assert _run(runner, dataclasses.replace(case, filled=filled), dda).any()


@pytest.mark.parametrize("dda", [False, True])
def test_what_is_outside_of_the_grid_hides_nothing(
    runner: Runner, rng: np.random.Generator, dda: bool
) -> None:
    """All voxels are full: only rays that never enter the grid arrive."""
    case = _case(rng, 40, two_sided=True)
    full = dataclasses.replace(case, filled=np.ones_like(case.filled))
    behind = dataclasses.replace(full, receivers=case.receivers.copy(), points=case.points.copy())
    for array, count in ((behind.receivers["origin"], 97), (behind.points, len(case.points))):
        array[:, :3] = rng.uniform((-2, -2, -3), (2, 2, 0.5), (count, 3)) @ case.grid.axes + case.grid.eye
    facing, doubtful, _, _ = _facing(behind)
    assert (_run(runner, behind, dda) == facing)[~doubtful].all()
    facing, _, _, _ = _facing(full)
    assert _run(runner, full, dda).sum() < 0.6 * facing.sum()
