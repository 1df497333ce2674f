"""`vpl_gather`: irradiance from every light of a list: points, discs, quadrilaterals [NSW09; WEH89]."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.light_cuts import disc
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import MISS, RECEIVER, RSM_MAP, VIRTUAL_LIGHT, VPL_GATHER, record

Array = NDArray[np.float64]
FORMS = ("point", "disc", "quad")
FAR = 3e38
RESOLUTION, WIDTH = 64, 8
"""Texels along an edge of the map, and along one of each block."""


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _receivers(rng: np.random.Generator, count: int) -> NDArray[Any]:
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = rng.uniform(-1, 1, (count, 3))
    receivers["normal_shade"] = _unit(rng.normal(size=(count, 3)))
    tilted = receivers["normal_shade"] + 0.3 * rng.normal(size=(count, 3))
    receivers["normal_geo"] = _unit(tilted.astype(np.float64))
    receivers["pixel"] = rng.permutation(count)
    return receivers


def _lights(rng: np.random.Generator, count: int) -> NDArray[Any]:
    lights = np.zeros(count, VIRTUAL_LIGHT)
    lights["position"] = rng.uniform(-2, 2, (count, 3))
    lights["normal"] = _unit(rng.normal(size=(count, 3)))
    lights["area"] = rng.lognormal(-3, 1, count)
    lights["flux"] = rng.lognormal(0, 1, (count, 3)) * (rng.uniform(size=count) > 0.2)[:, None]
    return lights


def _run(
    runner: Runner,
    receivers: NDArray[Any],
    lights: NDArray[Any],
    form: str,
    reach: float = FAR,
    maps: NDArray[Any] | None = None,
    ends: tuple[int, ...] = (),
) -> Array:
    """`ends`: where parts of the list end before its own end."""
    irradiance, count = np.full((len(receivers), 4), np.nan, np.float32), len(ends) + 1
    parts = np.zeros(count * len(receivers), np.float32)
    for part, (first, end) in enumerate(pairwise((0, *ends, len(lights)))):
        out = runner(
            "passes/indirect/vpl_gather",
            len(receivers),
            constants={"FORM": FORMS.index(form)},
            params=record(VPL_GATHER, first=first, end=end, reach=reach, part=part, parts=count),
            receivers=receivers,
            maps=np.zeros(1, RSM_MAP) if maps is None else maps,
            virtual_lights=lights,
            irradiance=irradiance,
            parts=parts,
        )
        irradiance = read(out, "irradiance", np.float32, len(receivers), 4)
        parts = read(out, "parts", np.float32)
    if ends:
        total = parts.reshape(-1, count).sum(axis=1)
        assert_within(total, irradiance[receivers["pixel"], 3], 1e-5 * total + 1e-9, "parts")
    return irradiance.astype(np.float64)


@pytest.mark.parametrize("form", ["point", "disc"])
@pytest.mark.parametrize(("reach", "ends"), [(FAR, ()), (1.0, ()), (FAR, (40, 90))])
def test_sums_up_points_and_discs(
    runner: Runner, rng: np.random.Generator, form: str, reach: float, ends: tuple[int, ...]
) -> None:
    receivers, lights = _receivers(rng, 200), _lights(rng, 150)
    apart = np.linalg.norm(lights["position"][None] - receivers["origin"][:, None], axis=2)
    each = np.array([[disc(r, light, form == "disc") for light in lights] for r in receivers])
    expected = (each * (apart < reach)[..., None]).sum(axis=1)
    out = _run(runner, receivers, lights, form, reach, ends=ends)[receivers["pixel"]]
    bound = 2e-5 * np.abs(each).sum(axis=1) + 1e-6
    assert_within(out[:, :3], expected, bound, form)
    assert_not_within(out[:, :3], 1.01 * expected + 1e-3, bound)
    assert_within(out[:, 3], expected.mean(axis=1), bound.mean(axis=1), "mean")


def test_a_disc_is_exact_on_its_axis(runner: Runner) -> None:
    """E = B A / (π d² + A) from a disc of radiosity B seen along its axis [WEH89]; a point is too bright."""
    radius, far, radiosity = 0.5, 0.7, 3.0
    lights, receivers = np.zeros(1, VIRTUAL_LIGHT), np.zeros(1, RECEIVER)
    lights["area"], lights["normal"] = np.pi * radius**2, (0, 0, 1)
    lights["flux"] = radiosity * np.pi * radius**2
    receivers["origin"], receivers["normal_shade"] = (0, 0, far), (0, 0, -1)
    receivers["normal_geo"] = receivers["normal_shade"]
    exact = radiosity * radius**2 / (radius**2 + far**2)
    assert _run(runner, receivers, lights, "disc")[0, :3] == pytest.approx([exact] * 3, rel=1e-6)
    assert _run(runner, receivers, lights, "point")[0, 0] > 1.3 * exact


def _floor(rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[Any], Array]:
    """A spot 2 above a floor, blocks of its map as virtual lights, and their corners on the floor."""
    maps = record(RSM_MAP, origin=[0, 0, 2], axis=[0, 0, -1], tan_half=1.0, tiles=1, resolution=RESOLUTION)
    count = RESOLUTION // WIDTH
    cells = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2)
    lights = np.zeros(len(cells), VIRTUAL_LIGHT)
    # [DBC17] at -z: the tangents are (1, 0, 0) and (0, -1, 0)
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    place = (cells[:, None] + corner) / count
    on_floor = 2 * (2 * place - 1) * [1, -1]
    corners = np.concatenate([on_floor, np.zeros((len(cells), 4, 1))], axis=2)
    lights["position"], lights["normal"] = corners.mean(axis=1), (0, 0, 1)
    lights["area"], lights["radius"] = (4 / count) ** 2, np.sqrt(2) * 2 / count
    lights["flux"] = rng.uniform(0.5, 1, (len(cells), 3))
    lights["block"] = cells[:, 0] * WIDTH | cells[:, 1] * WIDTH << 16
    lights["extent"] = WIDTH
    return maps, lights, corners


def _patch(receiver: Any, light: Any, corners: Array, parts: int) -> Array:
    """The quadrilateral in parts × parts points, finer towards what is near: brute force in float64."""
    steps = (np.arange(parts) + 0.5) / parts
    u, v = np.meshgrid(steps, steps)
    points = corners[0] + u[..., None] * (corners[1] - corners[0]) + v[..., None] * (corners[3] - corners[0])
    d = points - receiver["origin"]
    far = np.linalg.norm(d, axis=-1)
    w = d / far[..., None]
    shade = np.clip(w @ receiver["normal_shade"].astype(np.float64), 0, None)
    shade *= w @ receiver["normal_geo"].astype(np.float64) > 0
    kernel = shade * np.clip(-w @ light["normal"].astype(np.float64), 0, None) / (np.pi * far**2)
    irradiance: Array = light["flux"].astype(np.float64) * kernel.mean()
    return irradiance


def test_near_quadrilaterals_are_exact(runner: Runner, rng: np.random.Generator) -> None:
    """Receivers on a wall and tilted ones, from close above the floor on, against brute force."""
    maps, lights, corners = _floor(rng)
    receivers = np.zeros(24, RECEIVER)
    height = np.geomspace(0.03, 1.0, 24)
    receivers["origin"] = np.stack([rng.uniform(-1.5, 1.5, 24), np.full(24, 0.37), height], axis=1)
    normal = np.tile([0.0, 1.0, 0.0], (24, 1)) + np.where(np.arange(24) % 2, 0.4, 0)[:, None] * rng.normal(
        size=(24, 3)
    )
    receivers["normal_shade"] = _unit(normal)
    receivers["normal_geo"] = (0, 1, 0)
    receivers["pixel"] = np.arange(24)
    expected = np.zeros((24, 3))
    for i, receiver in enumerate(receivers):
        for light, around in zip(lights, corners, strict=True):
            near = np.linalg.norm(light["position"] - receiver["origin"]) < 4 * light["radius"]
            # beyond so many radii it is a point
            expected[i] += _patch(receiver, light, around, 400) if near else disc(receiver, light, False)
    out = _run(runner, receivers, lights, "quad", maps=maps)[:, :3]
    assert_within(out, expected, 2e-3 * expected, "quadrilaterals")
    for form in ("point", "disc"):
        other = _run(runner, receivers, lights, form, maps=maps)[:, :3]
        assert_not_within(other, expected, 0.05 * expected)


def test_without_a_block_a_quadrilateral_is_a_disc(runner: Runner, rng: np.random.Generator) -> None:
    maps, lights, _ = _floor(rng)
    receivers = _receivers(rng, 64)
    receivers["origin"][:, 2] = np.abs(receivers["origin"][:, 2])
    lights["extent"], lights["radius"] = 0, 100.0
    near = lights[:60]  # as many as a receiver has room for
    out = _run(runner, receivers, near, "quad", maps=maps)
    assert_within(out, _run(runner, receivers, near, "disc"), 1e-4 * np.abs(out) + 1e-6)


def test_inactive_receivers_are_left_alone(runner: Runner, rng: np.random.Generator) -> None:
    receivers, lights = _receivers(rng, 8), _lights(rng, 8)
    receivers["pixel"][::2] = MISS
    out = _run(runner, receivers, lights, "disc")
    assert np.isfinite(out[receivers["pixel"][1::2]]).all()
    assert np.isnan(out[:, 0]).sum() == 4
