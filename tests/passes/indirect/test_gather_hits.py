"""`gather_hits`: light at the hits of gather rays, one shadow ray each, and the ray that goes on [Kaj86]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.hashing import pcg4d, random4
from tests.passes.reference.hemisphere import cosine_directions
from tests.passes.reference.lights import Area, Light, Spot, random_area, random_spot, table
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER_PATH, GATHER_WAVE, MISS, RAY, record
from tests.passes.reference.surfaces import (
    ORIGIN_ERROR,
    Placed,
    light_quad,
    pack,
    random_hits,
    random_mesh,
    surfaces,
)

Array = NDArray[np.float64]
# Powers of the real root of x⁴ = x + 1 make the R3 sequence [Rob18].
R3 = 1 / 1.2207440846057596 ** np.arange(1, 4)
EDGE_ON = 1e-4


@dataclasses.dataclass
class Case:
    """Rays with their hits and paths, as the trace leaves them."""

    meshes: list[Placed]
    lights: list[Light]
    hits: NDArray[Any]
    rays: NDArray[Any]
    paths: NDArray[Any]


def _case(
    rng: np.random.Generator, lights: list[Light], count: int = 4096, meshes: list[Placed] | None = None
) -> Case:
    if meshes is None:
        meshes = [random_mesh(rng, kind) for kind in ("rigid", "mirrored", "stretched")]
    rays = np.zeros(count, RAY)
    rays["direction"] = rng.normal(size=(count, 3))
    rays["t_max"] = 3e38
    paths = np.zeros(count, GATHER_PATH)
    paths["throughput"] = rng.uniform(0.1, 1, (count, 3))
    paths["pixel"], paths["stratum"] = np.divmod(np.arange(count), 64)
    paths["pending"] = np.nan
    return Case(meshes, lights, random_hits(rng, meshes, count), rays, paths)


def _run(
    runner: Runner, case: Case, slopes: bool = False, **wave: int
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Rays that go on, shadow rays, paths."""
    values = {"lights": len(case.lights), "seed": 5, "strata": 64, "tiles": 1, **wave}
    out = runner(
        "passes/indirect/gather_hits",
        len(case.hits),
        constants={"LAST": values.get("last", 0), "LATER": values.get("bounce", 0) > 0, "SLOPES": slopes},
        wave=record(GATHER_WAVE, **values),
        hits=case.hits,
        rays=case.rays,
        paths=case.paths,
        shadow_rays=np.zeros(len(case.hits), RAY),
        lights=table(case.lights),
        **pack(case.meshes),
    )
    return read(out, "rays", RAY), read(out, "shadow_rays", RAY), read(out, "paths", GATHER_PATH)


def _places(paths: NDArray[Any], seed: int, bounce: int = 0) -> Array:
    """Places on the light: at first the R3 sequence from the pixel's hashed start, later plain hashes."""
    if bounce:
        return random4(paths["pixel"], paths["stratum"], 4 * bounce + 1, seed)[:, :3]
    start = pcg4d(paths["pixel"], 0, 3, seed)[:, :3] / 2.0**32
    places: Array = (start + paths["stratum"].astype(np.float64)[:, None] * R3) % 1.0
    return places


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _active(rays: NDArray[Any]) -> NDArray[np.bool_]:
    active: NDArray[np.bool_] = rays["t_max"] > rays["t_min"]
    return active


def _light(rng: np.random.Generator, kind: str) -> Light:
    if kind == "spot":
        return random_spot(rng, 70)
    picture = (2, 3) if kind == "picture" else None
    return random_area(rng, picture, two_sided=kind == "two-sided", linear=True)


def _single_light(case: Case, places: Array) -> tuple[Array, Array, Array, Array]:
    """With one light the equation is exact: (d, irradiance carried, how far from an edge, its rounding)."""
    light = case.lights[0]
    s = surfaces(case.meshes, case.hits, case.rays["direction"].astype(np.float64))
    origin = s.position + s.normal_geo * (ORIGIN_ERROR * s.reach)[:, None]
    target = light.point(places[:, :2]) if isinstance(light, Area) else light.position
    d = target - origin
    far = np.linalg.norm(d, axis=1)
    w = d / far[:, None]
    shade, geo = (w * s.normal_shade).sum(axis=1), (w * s.normal_geo).sum(axis=1)
    if isinstance(light, Area):
        emits = light.emitted(places[:, :2]) * (light.area * light.cosine(-w))[:, None]
        edge = np.abs(w @ light.normal)
    else:
        emits = light.intensity * light.lights(-w)[:, None]
        edge = np.abs(-w @ light.axis - light.cos_cutoff)
    clear = np.minimum.reduce([np.abs(shade), np.abs(geo), s.facing, edge])
    lit = (geo > 0)[:, None] * np.clip(shade, 0, None)[:, None] * emits
    carried = case.paths["throughput"] * s.albedo / np.pi * lit / far[:, None] ** 2
    size = np.abs(s.albedo) * emits.max() / far[:, None] ** 2
    return d, carried, clear, size


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "picture", "spot"])
@pytest.mark.parametrize("bounce", [0, 2])
def test_light_from_one_light_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, kind: str, bounce: int
) -> None:
    case = _case(rng, [_light(rng, kind)])
    _, shadow, paths = _run(runner, case, bounce=bounce)
    places = _places(case.paths, 5, bounce)
    d, carried, clear, size = _single_light(case, places)
    sure = clear > EDGE_ON
    assert sure.mean() > 0.95
    lit = sure & (carried.max(axis=1) > 0)
    dark = sure & ~lit
    assert min(lit.mean(), dark.mean()) > 0.005
    assert (_active(shadow)[lit]).all()
    # steps of 2^-32 a stratum, and the rounding of places, positions and normals
    assert_within(shadow["direction"][lit], d[lit], 1e-5, "shadow rays")
    assert (shadow["t_max"][lit] < 1).all()
    assert (shadow["t_max"][lit] > 0.999).all()
    # an error e of the cosines weighs by the light's size over d²
    bound = 2e-4 * carried + 3e-5 * size
    assert_within(paths["pending"][sure], carried[sure], bound[sure], "irradiance carried")
    assert (paths["pending"][dark] == 0).all()
    other = _single_light(case, 1 - places)[1]
    assert_not_within(
        paths["pending"][sure], other[sure] if kind != "spot" else 1.01 * carried[sure], bound[sure]
    )


def test_the_places_on_a_light_cover_it_evenly() -> None:
    """Over the 64 strata of a pixel every eighth of each axis has its eight points, give or take one."""
    paths = np.zeros(64 * 50, GATHER_PATH)
    paths["pixel"], paths["stratum"] = np.divmod(np.arange(len(paths)), 64)
    places = _places(paths, 5).reshape(50, 64, 3)
    for axis in range(3):
        counts = np.stack([np.histogram(p[:, axis], 8, (0, 1))[0] for p in places])
        assert abs(counts - 8).max() <= 3
    assert_within(R3[0] ** -4 - R3[0] ** -1 - 1, 0.0, 1e-12, "the root of x⁴ = x + 1")


def _quadrature(light: Light, point: Array, normal: Array, side: int = 300) -> Array:
    """Irradiance of an unshadowed light at a point with equal normals, by the midpoint rule."""
    if isinstance(light, Spot):
        d = light.position - point
        w = d / np.linalg.norm(d)
        return light.intensity * light.lights(-w) * max(0.0, float(w @ normal)) / (d @ d)
    middles = (np.arange(side) + 0.5) / side
    ab = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    d = light.point(ab) - point
    far = np.linalg.norm(d, axis=1)
    w = d / far[:, None]
    weight = np.clip(w @ normal, 0, None) * light.cosine(-w) / far**2
    irradiance: Array = (light.emitted(ab) * weight[:, None]).mean(axis=0) * light.area
    return irradiance


@pytest.mark.parametrize("bounce", [0, 1])
def test_many_lights_are_chosen_without_bias(runner: Runner, rng: np.random.Generator, bounce: int) -> None:
    """The same hit for many pixels and strata: the mean is the sum over lights, within its own deviation."""
    count = 1 << 16
    lights: list[Light] = [
        Area(np.array([-1, 3.0, -1]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([9.0, 1, 1])),
        Area(
            np.array([2, 0.2, 0]),
            np.array([0, 1.0, 0]),
            np.array([0, 0.2, 1.0]),
            rng.uniform(0, 5, (2, 2, 3)),
            two_sided=True,
        ),
        Spot(np.array([0.5, 2.0, 1]), np.array([-0.5, -2.0, -1]), np.array([1.0, 9, 3]), 0.9),
        Area(np.array([-3, 1.0, 3]), np.array([0, 1.0, 0]), np.array([1.0, 0, 1.0]), np.array([0.1, 0.1, 9])),
    ]
    ground = Placed(
        np.array([(-9, 0, -9), (0, 0, 9), (9, 0, -9.0)]),
        np.array([(0, 1, 2)], np.uint32),
        np.eye(4),
        np.array([0.8, 0.5, 0.2]),
    )
    case = _case(rng, lights, count, [ground])
    case.hits["u"], case.hits["v"] = 0.5, 0.25
    case.rays["direction"] = (0.1, -1, 0.2)
    case.paths["throughput"] = 1
    _, _, paths = _run(runner, case, bounce=bounce)
    samples = paths["pending"].astype(np.float64)
    hit = np.array([-9 * 0.25 + 9 * 0.25, 0, -9 * 0.25 + 9 * 0.5 - 9 * 0.25])
    each = [_quadrature(light, hit, np.array([0, 1.0, 0])) for light in lights]
    expected = np.sum(each, axis=0) * ground.albedo / np.pi
    assert all(e.max() > 0 for e in each), "every light counts"
    deviation = samples.std(axis=0) / np.sqrt(count)
    assert_within(samples.mean(axis=0), expected, 4 * deviation + 1e-4 * expected, "mean")
    for missing in each:
        without = expected - missing * ground.albedo / np.pi
        assert_not_within(samples.mean(axis=0), without, 4 * deviation + 1e-4 * expected)


@pytest.mark.parametrize("bounce", [0, 3])
def test_rays_go_on_about_the_shading_normal(runner: Runner, rng: np.random.Generator, bounce: int) -> None:
    case = _case(rng, [random_area(rng)])
    rays, _, paths = _run(runner, case, bounce=bounce)
    s = surfaces(case.meshes, case.hits, case.rays["direction"].astype(np.float64))
    square = random4(case.paths["pixel"], case.paths["stratum"], 4 * bounce + 2, 5)[:, :2]
    expected = cosine_directions(s.normal_shade, square)
    above = (expected * s.normal_geo).sum(axis=1)
    sure = (np.abs(above) > EDGE_ON) & (s.facing > EDGE_ON)
    on = sure & (above > 0)
    assert (_active(rays)[on]).all()
    assert not _active(rays)[sure & (above < 0)].any(), "none goes below the surface"
    # the frame of a tangent jumps where the normal's z changes sign
    steady = on & (np.abs(s.normal_shade[:, 2]) > 1e-4)
    height = (expected * s.normal_shade).sum(axis=1)
    bound = (4e-5 + 1e-6 / np.maximum(height, 4e-4))[:, None]
    assert_within(rays["direction"][steady], expected[steady], bound[steady], "directions")
    assert_not_within(
        rays["direction"][steady], cosine_directions(s.normal_geo, square)[steady], bound[steady]
    )
    origin = s.position + s.normal_geo * (ORIGIN_ERROR * s.reach)[:, None]
    assert_within(rays["origin"][on], origin[on], ORIGIN_ERROR * s.reach[on, None], "origins")
    worth = case.paths["throughput"] * s.albedo
    assert_within(paths["throughput"], worth, 2e-5 * case.paths["throughput"], "throughput")
    assert_not_within(paths["throughput"], worth / np.pi, 2e-5 * case.paths["throughput"])


def test_slopes_are_gradients_of_what_a_patch_fills(runner: Runner, rng: np.random.Generator) -> None:
    """Of log(cos cos' / r²) by the ray's origin, but for the part along its own normal [WH92]."""
    case = _case(rng, [random_area(rng)])
    case.rays["origin"] = rng.normal(size=(len(case.rays), 3))
    s = surfaces(case.meshes, case.hits, case.rays["direction"].astype(np.float64))
    start = case.rays["origin"].astype(np.float64)
    cosine = -(s.normal_geo * _unit(s.position - start)).sum(axis=1)
    clear = cosine > 0.3
    _, _, paths = _run(runner, case, slopes=True)

    def logarithm(origin: Array) -> Array:
        """Of (−n'·d) / r⁴; the factor n·d changes along the surface's normal alone."""
        d = s.position - origin
        return np.log(np.where(clear, -(s.normal_geo * d).sum(axis=1), 1)) - 4 * np.log(
            np.linalg.norm(d, axis=1)
        )

    step, expected = 1e-5, np.zeros((len(start), 3))
    for axis, unit in enumerate(np.eye(3) * step):
        expected[:, axis] = (logarithm(start + unit) - logarithm(start - unit)) / (2 * step)
    size = np.linalg.norm(expected, axis=1, keepdims=True)
    found = paths["slope"].astype(np.float64)
    assert clear.sum() > 500
    assert_within(found[clear], expected[clear], 1e-4 * size[clear], "slopes")
    assert_not_within(found[clear], 1.1 * expected[clear], 1e-4 * size[clear])
    _, _, without = _run(runner, case)
    assert (without["slope"] == 0).all()


def test_the_last_bounce_sends_no_ray(runner: Runner, rng: np.random.Generator) -> None:
    case = _case(rng, [random_area(rng)])
    rays, shadow, _ = _run(runner, case, last=1)
    assert not _active(rays).any()
    assert _active(shadow).any()


def test_black_surfaces_send_no_ray(runner: Runner, rng: np.random.Generator) -> None:
    case = _case(rng, [random_area(rng)], meshes=[random_mesh(rng, "rigid", albedo=np.zeros(3))])
    rays, _, paths = _run(runner, case)
    assert not _active(rays).any()
    assert (paths["pending"] == 0).all()


def test_misses_lights_and_idle_rays_carry_nothing(runner: Runner, rng: np.random.Generator) -> None:
    light = random_area(rng)
    case = _case(rng, [light], meshes=[random_mesh(rng, "rigid"), light_quad(light, 0)])
    missed = rng.uniform(size=len(case.hits)) < 0.3
    case.hits["instance"][missed], case.hits["triangle"][missed] = MISS, MISS
    idle = rng.uniform(size=len(case.hits)) < 0.3
    case.rays["t_min"][idle], case.rays["t_max"][idle] = 1, 0
    rays, shadow, paths = _run(runner, case)
    nothing = idle | missed | (case.hits["instance"] == 1)
    assert not _active(rays)[nothing].any()
    assert not _active(shadow)[nothing].any()
    assert (paths["pending"][nothing] == 0).all()
    assert (_active(rays)[~nothing]).mean() > 0.5
    assert (paths["pixel"] == case.paths["pixel"]).all()
    assert (paths["stratum"] == case.paths["stratum"]).all()


def test_no_light_that_can_be_seen_is_no_shadow_ray(runner: Runner, rng: np.random.Generator) -> None:
    """A light that looks the other way, and none at all."""
    below = Area(np.array([0, 50.0, 0]), np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), np.ones(3))
    assert below.normal[1] > 0
    case = _case(rng, [below])
    _, shadow, paths = _run(runner, case)
    assert not _active(shadow).any()
    assert (paths["pending"] == 0).all()
    case.lights = [Area(below.corner, below.v, below.u, below.radiance)]
    assert _active(_run(runner, case)[1]).any(), "turned round it lights"
    case.lights = [below]
    none = _run(runner, case, lights=0)
    assert not _active(none[1]).any()
