"""`specular`: L += specular Σ V L A/N f cosθ_s cosθ_l / d², f = (n + 2)/(2π) cosⁿ about the mirror [LW94]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gathering import Case, facing_up, geometry_terms, random_case, visibility_words
from tests.passes.reference.image import random_view
from tests.passes.reference.lights import Area, Light, random_area, random_spot, table
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER, record, row

Array = NDArray[np.float64]


def _cosines(view: NDArray[Any], case: Case) -> Array:
    """Cosine between the mirror direction and the direction to each sample, (live, strata)."""
    r = case.receivers[case.live]
    origin, normal = (r[name].astype(np.float64) for name in ("origin", "normal_shade"))
    along = origin - view["eye"][0].astype(np.float64)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    mirror = along - 2 * (along * normal).sum(1, keepdims=True) * normal
    d = case.points[r["pattern"]] - origin[:, None]
    cosines: Array = (d * mirror[:, None]).sum(-1) / np.linalg.norm(d, axis=-1)
    return cosines


def _radiance(light: Light, view: NDArray[Any], case: Case, lobes: Array, instances: NDArray[Any]) -> Array:
    terms, _ = geometry_terms(light, case)
    if case.seen is not None:
        terms = terms * case.seen[case.live]
    pixels = case.receivers["pixel"][case.live]
    surface = lobes[instances[pixels]]
    n = surface[:, 3:]
    power = np.where(_cosines(view, case) > 0, np.clip(_cosines(view, case), 1e-30, None) ** n, 0)
    total = np.zeros((len(case.receivers), 3))
    total[pixels] = surface[:, :3] * ((terms * power * (n + 2) / (2 * np.pi)) @ case.radiance)
    return total


def _run(
    runner: Runner, lights: list[Light], number: int, view: NDArray[Any], case: Case, lobes: Array, at: Any
) -> NDArray[np.float32]:
    count = len(case.receivers)
    out = runner(
        "passes/gather/specular",
        count,
        params=record(
            GATHER,
            strata=case.strata,
            words=0 if case.seen is None else -(-case.strata // 32),
            light=number,
        ),
        view=view,
        receivers=case.receivers,
        visibility=np.zeros(1, np.uint32) if case.seen is None else visibility_words(case.seen),
        light_points=np.pad(case.points, ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        light_radiance=np.pad(case.radiance, ((0, 0), (0, 1))).astype(np.float32),
        lights=table(lights),
        instance_lobes=lobes.astype(np.float32),
        g_albedo=row(np.zeros((count, 3)), at),
        specular_radiance=np.zeros((count, 4), np.float32),
    )
    return read(out, "specular_radiance", np.float32, count, 4)[:, :3]


@pytest.mark.parametrize("kind", ["area", "spot"])
@pytest.mark.parametrize("traced", [True, False])
def test_radiance_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, kind: str, traced: bool
) -> None:
    light = random_spot(rng) if kind == "spot" else random_area(rng)
    case = random_case(rng, light, 1500, 37, traced)
    view = random_view(rng, 16, 16)
    lobes = np.array([(0, 0, 0, 5.0), (0.2, 0.4, 0.1, 0.0), (0.3, 0.1, 0.5, 7.5), (0.9, 0.8, 0.7, 200.0)])
    at = rng.integers(0, len(lobes), len(case.receivers))
    found = _run(runner, [random_area(rng), light], 1, view, case, lobes, at)
    expected = _radiance(light, view, case, lobes, at)
    # a rounding of the cosine counts n-fold
    bound = (2e-5 + 200 * 30 * ULP) * expected + 1e-5 * expected.mean()
    assert_within(found, expected, bound, "radiance")
    assert (expected > 0).mean() > 0.02
    assert_not_within(found, expected * 1.02, bound)
    lobes[:, 3] += 0.5
    assert_not_within(found, _radiance(light, view, case, lobes, at), bound)


def test_a_wide_light_straight_ahead_is_reflected_whole(runner: Runner) -> None:
    """Normal incidence, a light that fills the lobe: specular · L, because the lobe integrates to 1."""
    view = random_view(np.random.default_rng(1), 16, 16)
    view["eye"][0] = (0, 5, 0)
    light = Area(np.array([-8, 1, -8.0]), np.array([16.0, 0, 0]), np.array([0, 0, 16.0]), np.full(3, 3.0))
    side = 200  # some drivers end a loop after 65,535 turns
    middles = (np.arange(side) + 0.5) / side
    ab = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    radiance = np.broadcast_to(light.radiance * light.area / side**2, (side**2, 3))
    case = facing_up(np.zeros((1, 3)), light.point(ab), radiance)
    for n in (10.0, 50.0):
        lobes = np.array([(0.25, 0.5, 1.0, n)])
        found = _run(runner, [light], 0, view, case, lobes, np.zeros(1, np.int64))
        assert_within(found[0] / 3, lobes[0, :3], 2e-3, f"n = {n}")
