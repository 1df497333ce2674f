"""`map_shadow`: what receivers see of a light by random shadow maps, against float64."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, read
from tests.passes.reference.shadow_maps import direction, place
from tests.passes.reference.structs import MAP, MISS, RECEIVER, SHADOW, record

Bits = NDArray[np.bool_]
BIAS, TEXEL = 0.5, np.sqrt(2 * np.pi)
FIRST = 77  # maps of other lights come before


@dataclasses.dataclass
class Case:
    """Receivers, patterns × strata samples of one light, and the first pattern's maps."""

    receivers: NDArray[Any]
    points: NDArray[np.float32]
    strata: int
    normal: NDArray[np.float64]
    distances: NDArray[np.float32]
    resolution: int = 9
    two_sided: bool = False
    tan_half: float = 0.0
    sets: int = 1
    """Interleaved sets of samples, each a pattern after the other; all of them have maps."""


def _case(rng: np.random.Generator, strata: int, two_sided: bool, count: int = 150, sets: int = 1) -> Case:
    patterns, resolution = 3 * sets, 9
    points = np.full((patterns * strata, 4), 0.9999, np.float32)
    points[:, :3] = rng.uniform(-0.5, 0.5, (patterns * strata, 3))
    normals = rng.normal(size=(2, count, 3))
    normals[1] = normals[0] + 0.3 * normals[1]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = rng.uniform(-3, 3, (count, 3))
    receivers["normal_geo"], receivers["normal_shade"] = normals
    receivers["pattern"] = rng.integers(0, patterns, count)
    receivers["pattern"][::19] = MISS
    texels = sets * strata * (1 + two_sided) * resolution**2
    distances = rng.uniform(0.5, 6, FIRST + texels).astype(np.float32)
    distances[rng.uniform(size=len(distances)) < 0.2] = 1e30
    n = rng.normal(size=3)
    normal = (n / np.linalg.norm(n)).astype(np.float32).astype(np.float64)
    return Case(receivers, points, strata, normal, distances, resolution, two_sided, sets=sets)


def _run(runner: Runner, case: Case, asked: Bits | None = None) -> Bits:
    count, words = len(case.receivers), -(-case.strata // 32)
    params = record(
        SHADOW,
        light_normal=case.normal,
        two_sided=case.two_sided,
        cone_axis=case.normal,
        cos_cutoff=-2.0,
        receivers=count,
        strata=case.strata,
        patterns=len(case.points) // case.strata,
        words=words,
    )
    sides = 1 + case.two_sided
    maps = record(
        MAP,
        normal=case.normal,
        resolution=case.resolution,
        sides=sides,
        first=FIRST,
        samples=case.sets * case.strata,
        tan_half=case.tan_half,
    )
    before = np.full(count * words, MISS, np.uint32)
    if asked is not None:
        wide = np.ones((count, 32 * words), bool)
        wide[:, : case.strata] = asked
        before = np.packbits(wide, axis=1, bitorder="little").reshape(-1).view(np.uint32)
    out = runner(
        "passes/visibility/map_shadow",
        count * words,
        entry="main" if asked is None else "asked",
        map=maps,
        params=params,
        receivers=case.receivers,
        points=case.points,
        visibility=before,
        distances=case.distances,
    )
    bits = np.unpackbits(read(out, "visibility", np.uint8).reshape(count, -1), axis=1, bitorder="little")
    assert not bits[:, case.strata :].any(), "spare bits are cleared"
    return bits[:, : case.strata].astype(bool)


def _reference(case: Case) -> tuple[Bits, Bits, Bits]:
    """Hidden, facing, and where rounding may decide; (receivers, strata)."""
    r, patterns = case.receivers, len(case.points) // case.strata
    live = r["pattern"] < patterns
    table = case.points.reshape(patterns, case.strata, 4)[..., :3].astype(np.float64)
    own = table[np.where(live, r["pattern"], 0)] - r["origin"].astype(np.float64)[:, None]
    unit = own / np.linalg.norm(own, axis=-1, keepdims=True)
    cosines = [np.einsum("rsk,rk->rs", unit, r[name]) for name in ("normal_geo", "normal_shade")]
    if not case.two_sided:
        cosines.append(-unit @ case.normal)
    smallest = np.minimum.reduce(cosines)
    facing = (smallest > 0) & live[:, None]
    hidden, doubtful = np.zeros_like(facing), np.abs(smallest) < 1e-5
    for sample in range(case.sets * case.strata):
        which, k = divmod(sample, case.strata)
        asks = r["pattern"] % case.sets == which
        d = r["origin"].astype(np.float64) - table[which, k]
        side = (d @ case.normal < 0) & case.two_sided
        for back in range(1 + case.two_sided):
            n = case.normal * (1 - 2 * back)
            at = place(n, d, case.resolution, case.tan_half)
            texel = np.clip(np.floor(at), 0, case.resolution - 1).astype(int)
            ray = direction(n, texel, case.resolution, case.tan_half)
            distance, slope = np.linalg.norm(d, axis=1), (r["normal_geo"] * ray).sum(1)
            with np.errstate(divide="ignore"):
                plane = np.clip((r["normal_geo"] * d).sum(1) / slope, 0.5 * distance, 2 * distance)
            plane = np.where(slope < 0, plane, 2 * distance)
            first = FIRST + (sample * (1 + case.two_sided) + back) * case.resolution**2
            stored = case.distances[first + texel[:, 1] * case.resolution + texel[:, 0]]
            width = 2 * case.tan_half or TEXEL
            limit = plane - BIAS * width / case.resolution * distance
            unsure = (np.abs(at - np.round(at)).min(1) < 1e-4) | (np.abs(stored - limit) < 1e-4)
            unsure |= (np.abs(slope) < 1e-5) | (np.abs(d @ case.normal) < 1e-5)
            here = asks & (side == bool(back))
            hidden[here, k] = (stored < limit)[here]
            doubtful[here, k] |= (unsure & facing[:, k])[here]
    return hidden, facing, doubtful


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize(
    ("strata", "sets", "tan_half"), [(1, 1, 0.0), (40, 1, 0.0), (16, 4, 0.0), (3, 1, 1.5)]
)
def test_bits_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, strata: int, sets: int, tan_half: float, two_sided: bool
) -> None:
    case = _case(rng, strata, two_sided, sets=sets)
    case.tan_half = tan_half
    hidden, facing, doubtful = _reference(case)
    found = _run(runner, case)
    assert (found == (facing & ~hidden))[~doubtful].all()
    assert doubtful.mean() < 0.05
    asked = rng.uniform(size=facing.shape) < 0.4
    live = (case.receivers["pattern"] < 3 * sets)[:, None]
    expected = asked & live & ~(facing & hidden)
    assert (_run(runner, case, asked) == expected)[~doubtful].all()
    # Negative controls: hidden ones and faces both decide.
    assert (found != facing).any()
    assert (expected != (asked & live)).any()
    empty = dataclasses.replace(case, distances=np.full_like(case.distances, 1e30))
    assert (_run(runner, empty) == facing)[~doubtful].all()


def test_a_plane_does_not_hide_itself(runner: Runner, rng: np.random.Generator) -> None:
    """The bias follows the slope: a bare floor, seen by its own maps, is lit everywhere."""
    case = _case(rng, 16, two_sided=False, count=400)
    case.normal = np.array([0.0, -1.0, 0.0])
    case.points[:, 1] = 2.0
    case.receivers["origin"] = rng.uniform((-6, 0, -6), (6, 0, 6), (400, 3))
    case.receivers["normal_geo"] = case.receivers["normal_shade"] = (0, 1, 0)
    case.receivers["pattern"] = 0
    texels = np.stack(np.meshgrid(np.arange(9), np.arange(9)), -1).reshape(-1, 2)
    down = direction(case.normal, texels, 9)
    case.distances[FIRST:] = np.tile(2.0 / -down[:, 1], 16)
    assert _run(runner, case).all()
    # Negative control: a floor a little higher hides all of it.
    case.distances[FIRST:] *= 0.3
    assert not _run(runner, case).any()
