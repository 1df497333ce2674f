"""`trace` in its WGSL form: what rays meet in two levels of trees, against every triangle in float64 [WBW13].

The native form is compared with this one, ray by ray, in `tests/rust/trace_forms.rs`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import HIT, MISS, RAY
from tests.passes.reference.trees import Met, Object, meet, random_objects, trees

STEM = "passes/visibility/trace"


def _rays(rng: np.random.Generator, count: int) -> NDArray[Any]:
    rays = np.zeros(count, RAY)
    rays["origin"] = rng.uniform(-3, 3, (count, 3))
    rays["direction"] = rng.normal(size=(count, 3)) * rng.uniform(0.1, 3, (count, 1))
    inwards = rng.uniform(size=count) < 0.7
    rays["direction"][inwards] = rng.normal(size=(inwards.sum(), 3)) - rays["origin"][inwards]
    axis = rng.integers(0, 3, count)
    straight = rng.uniform(size=count) < 0.2
    rays["direction"][straight] = np.eye(3)[axis[straight]] * rng.choice([-1, 1], (straight.sum(), 1))
    rays["t_max"] = np.inf
    short = rng.uniform(size=count) < 0.3
    rays["t_min"][short] = rng.uniform(0, 0.5, short.sum())
    rays["t_max"][short] = rng.uniform(0.5, 2, short.sum())
    return rays


def _meet(objects: list[Object], rays: NDArray[Any]) -> Met:
    columns = (rays[name].astype(np.float64) for name in ("origin", "direction", "t_min", "t_max"))
    return meet(objects, *columns)


def _closest(runner: Runner, objects: list[Object], rays: NDArray[Any]) -> tuple[NDArray[Any], int]:
    out = runner(
        STEM,
        len(rays),
        entry="closest",
        rays=rays,
        hits=np.full(len(rays), -1, HIT),
        counter=np.zeros(2, np.uint32),
        **trees(objects),
    )
    return read(out, "hits", HIT), int(read(out, "counter", np.uint64)[0])


def _occluded(runner: Runner, objects: list[Object], rays: NDArray[Any]) -> NDArray[np.bool_]:
    words = np.full(-(-len(rays) // 32), MISS, np.uint32)
    lists = {"rays": rays, "occluded": words, "counter": np.zeros(2, np.uint32)}
    out = runner(STEM, len(rays), entry="any_hit", **lists, **trees(objects))
    bits = np.unpackbits(out["occluded"], bitorder="little").astype(bool)
    assert not bits[len(rays) :].any(), "spare bits are cleared"
    return bits[: len(rays)]


def test_the_reference_knows_a_simple_case() -> None:
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    thing = Object(triangle, np.eye(3) * 2, np.array([0.0, 0, 5]))
    origin = np.array([[0.5, 0.25, 1], [0.5, 0.25, 9], [3, 3, 1]])
    met = meet([thing], origin, np.array([[0, 0, 2.0]] * 3), np.zeros(3), np.full(3, np.inf))
    assert met.t.tolist() == [2, np.inf, np.inf]
    assert (met.u[0], met.v[0]) == (0.25, 0.125)
    assert met.hit.tolist() == [True, False, False]
    assert not met.doubtful.any()


def test_closest_hits_agree_with_the_reference(runner: Runner, rng: np.random.Generator) -> None:
    objects, rays = random_objects(rng), _rays(rng, 6001)
    found, counted = _closest(runner, objects, rays)
    met = _meet(objects, rays)
    sure = ~met.doubtful
    assert counted == len(rays)
    assert sure.mean() > 0.8
    assert 0.15 < met.hit.mean() < 0.9
    assert (found["instance"][sure] == met.instance[sure]).all()
    assert (found["triangle"][sure] == met.triangle[sure]).all()
    at = sure & met.hit
    bound = 1e-5 * (1 + met.t[at])
    assert_within(found["t"][at], met.t[at], bound, "t")
    assert_not_within(found["t"][at] * 1.001, met.t[at], bound)
    for name in ("u", "v"):
        assert_within(found[name][at], getattr(met, name)[at], 3e-3, name)
    missed = found[found["instance"] == MISS]
    assert (missed["triangle"] == MISS).all()
    assert np.isinf(missed["t"]).all()


def test_a_triangle_out_of_place_is_seen(runner: Runner, rng: np.random.Generator) -> None:
    """Negative control of the comparison above."""
    objects, rays = random_objects(rng), _rays(rng, 3000)
    met = _meet(objects, rays)
    objects[2].corners += np.float32(0.05)
    found, _ = _closest(runner, objects, rays)
    assert (found["triangle"] != met.triangle)[~met.doubtful].mean() > 0.002


def test_any_hit_is_whether_there_is_a_closest(runner: Runner, rng: np.random.Generator) -> None:
    objects, rays = random_objects(rng), _rays(rng, 4003)
    met = _meet(objects, rays)
    found = _occluded(runner, objects, rays)
    assert (found == met.hit)[~met.doubtful].all()
    assert not (found == np.roll(met.hit, 1)).all()


def test_the_ends_of_a_ray_are_open(runner: Runner) -> None:
    triangle = np.array([[[-1, -1, 2], [3, -1, 2], [-1, 3, 2]]], np.float32)
    objects = [Object(triangle, np.eye(3), np.zeros(3))]
    ends = np.array([(0, 2), (0, 2.01), (2, 9), (1.99, 9), (3, 1), (2.5, 9)], np.float32)
    rays = np.zeros(len(ends), RAY)
    rays["direction"], rays["t_min"], rays["t_max"] = (0, 0, 1), *ends.T
    found, counted = _closest(runner, objects, rays)
    assert (found["instance"] == 0).tolist() == [False, True, False, True, False, False]
    assert counted == 5, "a ray whose ends are the wrong way round is not traced"


@pytest.mark.parametrize("field", ["origin", "direction"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_faulty_rays_miss(runner: Runner, rng: np.random.Generator, field: str, value: float) -> None:
    objects, rays = random_objects(rng), _rays(rng, 64)
    rays[field][::2, 1] = value
    found, counted = _closest(runner, objects, rays)
    assert (found["instance"][::2] == MISS).all()
    assert counted == 32
    rays["direction"] = 0
    assert _closest(runner, objects, rays)[1] == 0


def test_nothing_to_hit(runner: Runner, rng: np.random.Generator) -> None:
    rays = _rays(rng, 100)
    assert (_closest(runner, [], rays)[0]["instance"] == MISS).all()
    assert not _occluded(runner, [], rays).any()


def test_no_ray_leaks_through_an_edge(runner: Runner, rng: np.random.Generator) -> None:
    """Rays from inside a fan of triangles about one corner, through edges and corners of it."""
    angles = np.linspace(0, 2 * np.pi, 33)[:-1]
    rim = np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.3, 0.3, 32)], 1)
    tip = np.broadcast_to([0.05, -0.03, 1.7], rim.shape)
    corners = np.stack([tip, rim, np.roll(rim, -1, 0)], 1).astype(np.float32)
    objects = [Object(corners, np.eye(3), np.zeros(3))]
    count = 20_000
    share = rng.uniform(0, 0.95, (count, 1)) * (rng.uniform(size=(count, 1)) < 0.9)
    target = corners[0, 0] + (corners[rng.integers(0, 32, count), 1] - corners[0, 0]) * share
    rays = np.zeros(count, RAY)
    rays["origin"] = rng.uniform(-0.1, 0.1, (count, 3))
    rays["direction"], rays["t_max"] = (target - rays["origin"]) * rng.uniform(0.3, 3, (count, 1)), np.inf
    assert (_closest(runner, objects, rays)[0]["instance"] == 0).all()
    # Negative control: without one triangle some rays do get out.
    objects[0].corners = corners[:-1]
    assert (_closest(runner, objects, rays)[0]["instance"] == MISS).any()
