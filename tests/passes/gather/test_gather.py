"""`gather`: E += Σ V L A/N cosθ_s cosθ_l / d² over the samples of one light [NPW10 Eq. 2, corrected]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.passes.reference.lights import (
    Area,
    Light,
    Spot,
    polygon_irradiance,
    random_area,
    random_spot,
    single,
    table,
)
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER, MISS, RECEIVER, record

Array = NDArray[np.float64]


@dataclasses.dataclass
class Case:
    """Receivers, samples of one light, and which of them are seen."""

    receivers: NDArray[Any]
    points: Array
    radiance: Array
    seen: NDArray[np.bool_] | None

    @property
    def strata(self) -> int:
        """Samples of a pattern."""
        return len(self.radiance)


def _random_case(
    rng: np.random.Generator, light: Light, count: int, strata: int, traced: bool = True
) -> Case:
    patterns = 3
    receivers = np.zeros(count, RECEIVER)
    normals = rng.normal(size=(2, count, 3))
    normals[1] = normals[0] + 0.3 * normals[1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    receivers["origin"] = rng.normal(size=(count, 3)) * 3
    receivers["normal_geo"], receivers["normal_shade"] = normals
    receivers["pattern"] = rng.integers(0, patterns, count)
    receivers["pattern"][rng.uniform(size=count) < 0.1] = MISS
    receivers["pixel"] = rng.permutation(count)
    if isinstance(light, Spot):
        points = np.broadcast_to(light.position, (patterns, strata, 3))
        radiance = np.broadcast_to(light.intensity, (strata, 3))
    else:
        points = single(light.point(rng.uniform(size=(patterns, strata, 2))))
        radiance = single(rng.uniform(0, 2, (strata, 3)))
    seen = rng.uniform(size=(count, strata)) < 0.7 if traced else None
    return Case(receivers, np.asarray(points), np.asarray(radiance), seen)


def _bits(seen: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Visibility as words: bit k % 32 of word k / 32 is sample k."""
    padded = np.pad(seen, ((0, 0), (0, -seen.shape[1] % 32)))
    return np.packbits(padded, axis=1, bitorder="little").view("<u4")


def _run(
    runner: Runner, lights: list[Light], number: int, case: Case, before: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    count = len(case.receivers)
    words = 0 if case.seen is None else -(-case.strata // 32)
    out = runner(
        "passes/gather/gather",
        count,
        params=record(GATHER, strata=case.strata, words=words, light=number),
        receivers=case.receivers,
        visibility=np.zeros(1, np.uint32) if case.seen is None else _bits(case.seen),
        light_points=np.pad(case.points, ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        light_radiance=np.pad(case.radiance, ((0, 0), (0, 1))).astype(np.float32),
        lights=table(lights),
        direct_irradiance=np.zeros((count, 4), np.float32) if before is None else before,
    )
    return read(out, "direct_irradiance", np.float32, count, 4)[:, :3]


def _irradiance(light: Light, case: Case) -> tuple[Array, Array]:
    """Irradiance a pixel, and the sum of what float32 may lose: of every term its share of roundings."""
    r = case.receivers
    total = np.zeros((len(r), 3))
    loss = np.zeros((len(r), 3))
    live = np.flatnonzero(r["pattern"] != MISS)
    d = case.points[r["pattern"][live]] - r["origin"][live].astype(np.float64)[:, None]
    far = np.linalg.norm(d, axis=-1)
    w = d / far[..., None]
    geo, shade = (
        (w * r[name][live].astype(np.float64)[:, None]).sum(-1) for name in ("normal_geo", "normal_shade")
    )
    emits = light.lights(-w) if isinstance(light, Spot) else light.cosine(-w)
    terms = np.where(geo > 0, np.clip(shade, 0, None) * emits / far**2, 0)
    size = np.where(geo > 0, 1 / far**2, 0)
    if case.seen is not None:
        terms, size = terms * case.seen[live], size * case.seen[live]
    total[r["pixel"][live]] = terms @ case.radiance
    # cancellation in d: coordinates are up to ten times as large as the distance
    loss[r["pixel"][live]] = (size * (1 + 10 / far)) @ case.radiance * (40 + case.strata / 8) * ULP
    return total, loss


LIGHTS = ["one-sided", "two-sided", "picture", "spot"]


def _light(rng: np.random.Generator, kind: str) -> Light:
    if kind == "spot":
        return random_spot(rng)
    return random_area(rng, (3, 4) if kind == "picture" else None, two_sided=kind == "two-sided")


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("strata", [1, 37, 64])
@pytest.mark.parametrize("traced", [True, False])
def test_irradiance_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, kind: str, strata: int, traced: bool
) -> None:
    light = _light(rng, kind)
    lights: list[Light] = [random_area(rng), random_spot(rng), light]
    case = _random_case(rng, light, 1500, strata, traced)
    found = _run(runner, lights, 2, case)
    expected, bound = _irradiance(light, case)
    assert_within(found, expected, bound, "irradiance")
    assert (expected.any(axis=1)).mean() > 0.05, "some receivers are lit"

    case.radiance = case.radiance * (1 + 1e-3)
    assert_not_within(found, _irradiance(light, case)[0], bound)
    if traced:
        assert case.seen is not None
        case.seen = ~case.seen
        assert_not_within(found, _irradiance(light, case)[0], bound)


def test_lights_add_up(runner: Runner, rng: np.random.Generator) -> None:
    """The pass adds to what is there; inactive receivers leave their pixel alone."""
    light = random_area(rng)
    case = _random_case(rng, light, 300, 16)
    before = rng.uniform(0, 1, (300, 4)).astype(np.float32)
    found = _run(runner, [light], 0, case, before)
    alone = _run(runner, [light], 0, case)
    assert_within(found, before[:, :3] + alone.astype(np.float64), 2 * ULP * np.abs(found), "sums")
    idle = case.receivers["pixel"][case.receivers["pattern"] == MISS]
    assert (found[idle] == before[idle, :3]).all()


def test_a_square_light_above_a_floor_has_lambert_s_irradiance(
    runner: Runner, rng: np.random.Generator
) -> None:
    """The polygon's closed form; 64 × 64 samples err by less than (cell/distance)²/10."""
    light = Area(np.array([-0.5, 2, -0.5]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.full(3, 5.0))
    count, side = 400, 64
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"][:, [0, 2]] = rng.uniform(-3, 3, (count, 2))
    receivers["normal_geo"] = receivers["normal_shade"] = (0, 1, 0)
    receivers["pixel"] = np.arange(count)
    middles = (np.arange(side) + 0.5) / side
    ab = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(1, -1, 2)
    radiance = np.broadcast_to(light.radiance * light.area / side**2, (side**2, 3))
    found = _run(runner, [light], 0, Case(receivers, light.point(ab), radiance, None))
    corners = light.point(np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)]))
    expected = 5 * polygon_irradiance(corners, receivers["origin"], np.array([0, 1.0, 0]))
    assert_within(found, np.repeat(expected[:, None], 3, axis=1), 5e-5 * expected[:, None], "irradiance")
    assert_not_within(found[:, 0], expected * 1.001, 5e-5 * expected)


def test_the_edge_of_a_spot_is_hard(runner: Runner) -> None:
    """Two units under a spot of 30° the cone ends at 2·tan 30° = 1.1547."""
    light = Spot(np.array([0, 2.0, 0]), np.array([0, -1.0, 0]), np.ones(3), np.cos(np.radians(30)))
    receivers = np.zeros(2, RECEIVER)
    edge = 2 * np.tan(np.radians(30))
    receivers["origin"][:, 0] = edge * (1 - 1e-4), edge * (1 + 1e-4)
    receivers["normal_geo"] = receivers["normal_shade"] = (0, 1, 0)
    receivers["pixel"] = 0, 1
    case = Case(receivers, light.position[None, None], light.intensity[None], None)
    found = _run(runner, [light], 0, case)[:, 0]
    assert_within(found[0], np.cos(np.radians(30)) ** 3 / 4, 1e-4, "cos³/h² at the edge")
    assert found[1] == 0


def test_tiny_and_huge_distances_neither_overflow_nor_vanish(runner: Runner) -> None:
    """E scales as 1/s² when everything but the radiance is scaled by s."""
    for scale in (1e-12, 1e-4, 1e5, 1e12):
        light = Area(
            np.array([-0.5, 2, -0.5]) * scale, np.array([scale, 0, 0]), np.array([0, 0, scale]), np.ones(3)
        )
        receivers = np.zeros(1, RECEIVER)
        receivers["normal_geo"] = receivers["normal_shade"] = (0, 1, 0)
        case = Case(receivers, light.point(np.array([[[0.5, 0.5]]])), np.ones((1, 3)), None)
        found = _run(runner, [light], 0, case).astype(np.float64) * scale**2
        assert_within(found, np.full((1, 3), 0.25), 1e-6, f"scale {scale}")
