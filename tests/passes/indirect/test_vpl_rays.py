"""`vpl_rays`: rays towards virtual lights chosen by what they contribute."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.hashing import random4
from tests.passes.reference.light_cuts import Tree, cut, disc, random_tree
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import CUT, MISS, RAY, RECEIVER, VIRTUAL_LIGHT, record

Array = NDArray[np.float64]
RAYS, SEED = 16, 9


def _receivers(rng: np.random.Generator, count: int) -> NDArray[Any]:
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = rng.uniform([-0.7, -0.7, 0.1], [0.7, 0.7, 0.8], (count, 3))
    receivers["normal_shade"] = receivers["normal_geo"] = [0, 0, -1]
    receivers["pixel"] = rng.permutation(count)
    return receivers


def _list(rng: np.random.Generator, count: int) -> NDArray[Any]:
    """Virtual lights below the receivers, a quarter of them dark, in blocks of no texels."""
    lights = np.zeros(count, VIRTUAL_LIGHT)
    lights["position"] = rng.uniform([-1, -1, -0.3], [1, 1, 0], (count, 3))
    lights["normal"] = [0, 0, 1]
    lights["area"] = 1e-3
    lights["flux"] = rng.lognormal(0, 1, (count, 3)) * (rng.uniform(size=count) > 0.25)[:, None]
    return lights


def _run(
    runner: Runner,
    receivers: NDArray[Any],
    lights: NDArray[Any],
    irradiance: Array,
    texels: NDArray[np.float32] | None = None,
    ranges: NDArray[np.float32] | None = None,
    tree: bool = False,
    parts: NDArray[np.float32] | None = None,
    **params: Any,
) -> tuple[NDArray[Any], Array]:
    """Rays and weights, (n, RAYS)."""
    count = len(receivers)
    values = {
        "roots": len(lights),
        "maps": 1,
        "reach": 3e38,
        "rays": RAYS,
        "seed": SEED,
        "maps_size": 1,
        "parts": 1,
        **params,
    }
    lanes = 1 if parts is None else parts.shape[1]
    out = runner(
        "passes/indirect/vpl_rays",
        lanes * count,
        entry="main" if parts is None else "wide",
        constants={"FORM": 1, "TREE": float(tree), "LANES": lanes},
        params=record(CUT, **values),
        receivers=receivers,
        irradiance=np.stack([0 * irradiance] * 3 + [irradiance], axis=1).astype(np.float32),
        rsm_texels=np.zeros((3, 4), np.float32) if texels is None else texels,
        virtual_lights=lights,
        ranges=np.zeros((2, 4), np.float32) if ranges is None else ranges,
        rays=np.full(count * RAYS, np.nan, RAY),
        ray_weights=np.full((count * RAYS, 4), np.nan, np.float32),
        parts=np.zeros(1, np.float32) if parts is None else parts.ravel(),
    )
    rays = read(out, "rays", RAY).reshape(count, RAYS)
    weights = read(out, "ray_weights", np.float32, count, RAYS, 4)[..., :3].astype(np.float64)
    return rays, weights


def _contributions(receivers: NDArray[Any], lights: NDArray[Any]) -> Array:
    """(receivers, lights, 3)."""
    return np.array([[disc(receiver, light) for light in lights] for receiver in receivers])


def test_each_ray_goes_where_its_part_of_the_irradiance_comes_from(
    runner: Runner, rng: np.random.Generator
) -> None:
    receivers, lights = _receivers(rng, 64), _list(rng, 100)
    light = _contributions(receivers, lights)
    mean = light.mean(axis=2)
    irradiance = np.zeros(64)
    irradiance[receivers["pixel"]] = mean.sum(axis=1)
    rays, weights = _run(runner, receivers, lights, irradiance)
    along = np.cumsum(mean, axis=1)
    fraction = random4(receivers["pixel"][:, None], np.arange(RAYS)[None], 7, SEED)[..., 0]
    place = (np.arange(RAYS) + fraction) / RAYS * along[:, -1:]
    chosen = np.array([np.searchsorted(a, p) for a, p in zip(along, place, strict=True)])
    # leave out what lies on a border, where rounding decides
    apart = np.abs(along[:, None, :] - place[:, :, None]).min(axis=2)
    sure = apart > 1e-5 * along[:, -1:]
    assert sure.mean() > 0.95
    target = lights["position"][np.minimum(chosen, 99)] - receivers["origin"][:, None]
    assert_within(rays["direction"][sure], target[sure], 1e-5, "direction")
    assert_not_within(rays["direction"][sure], -target[sure], 1e-5)
    picked = np.take_along_axis(light, np.minimum(chosen, 99)[..., None], axis=1)
    expected = picked / picked.mean(axis=2, keepdims=True)
    assert_within(weights[sure], expected[sure], 1e-4 * expected[sure], "weights")
    assert (rays["t_max"][sure] < 1).all()
    assert (rays["t_max"][sure] > 0.999).all()


def test_weights_sum_to_the_irradiance(runner: Runner, rng: np.random.Generator) -> None:
    """The mean of the weights times the mean irradiance is the irradiance: an estimate without bias."""
    receivers, lights = np.repeat(_receivers(rng, 1), 4096), _list(rng, 60)
    receivers["pixel"] = np.arange(4096)
    light = _contributions(receivers[:1], lights)[0].sum(axis=0)
    _, weights = _run(runner, receivers, lights, np.full(4096, light.mean()))
    estimate = light.mean() * weights.mean(axis=(0, 1))
    assert_within(estimate, light, 0.005 * light)


def test_no_light_no_ray(runner: Runner, rng: np.random.Generator) -> None:
    receivers, lights = _receivers(rng, 8), _list(rng, 10)
    receivers["pixel"][3] = MISS
    lights["flux"] = 0
    rays, weights = _run(runner, receivers, lights, np.zeros(8))
    assert (rays["t_max"] <= rays["t_min"]).all()
    assert (weights == 0).all()


def test_targets_are_texels_of_the_block(runner: Runner, rng: np.random.Generator) -> None:
    """Of a block of 2 x 2 texels, one dark and one turned away, rays end at two, or at the light's place."""
    receivers, lights = _receivers(rng, 256), _list(rng, 1)
    lights["flux"], lights["extent"], lights["block"] = 1, 2, 1 | 1 << 16
    texels = np.zeros((4, 4, 3, 4), np.float32)
    texels[..., 0, :3] = rng.uniform(-1, -0.5, (4, 4, 3))
    texels[..., 1, :3] = [0, 0, 1]
    texels[..., 2, :3] = 1
    texels[2, 2, 2, :3] = 0  # dark
    texels[1, 2, 1, :3] = [0, 0, -1]
    irradiance = np.zeros(256)
    irradiance[receivers["pixel"]] = _contributions(receivers, lights).mean(axis=2)[:, 0]
    rays, _ = _run(runner, receivers, lights, irradiance, texels.reshape(-1, 4), maps_size=4)
    ends = (receivers["origin"][:, None] + rays["direction"]).reshape(-1, 3)
    places = [texels[y, x, 0, :3] for y, x in ((1, 1), (1, 2), (2, 1), (2, 2))]
    shares = [float((np.abs(ends - p).max(axis=1) < 1e-5).mean()) for p in [*places, lights["position"][0]]]
    assert shares[1] == shares[3] == 0
    assert sum(shares) == pytest.approx(1)
    # a texel that cannot stand for the light is tried again, once
    assert [shares[0], shares[2]] == pytest.approx([3 / 8] * 2, abs=0.03)
    assert shares[4] == pytest.approx(1 / 4, abs=0.03)


@pytest.mark.parametrize("lanes", [1, 4])
def test_goes_through_a_tree_as_the_cut_does(runner: Runner, rng: np.random.Generator, lanes: int) -> None:
    tree: Tree = random_tree(rng, 4)
    tree.nodes["extent"] = 0
    receivers = _receivers(rng, 32)
    exact = [cut(tree, receiver, (1, 4), "contribution", 0.02) for receiver in receivers]
    irradiance = np.zeros(32)
    irradiance[receivers["pixel"]] = [total.mean() for total, _, _ in exact]
    parts = None
    if lanes > 1:
        below = [
            cut(tree, r, (1, 4), "contribution", 0.02, roots=[k])[0].mean()
            for r in receivers
            for k in range(4)
        ]
        parts = np.reshape(below, (32, 4)).astype(np.float32)
    rays, weights = _run(
        runner,
        receivers,
        tree.nodes,
        irradiance,
        ranges=tree.ranges,
        tree=True,
        parts=parts,
        roots=4,
        coarsest=1,
        finest=4,
        bound=1,
        threshold=0.02,
        reference=1,
    )
    used = rays["t_max"] > 0
    assert used.mean() > 0.97
    ends = (receivers["origin"][:, None] + rays["direction"])[used]
    apart = np.abs(ends[:, None] - tree.nodes["position"][None]).max(axis=2).min(axis=1)
    assert (apart < 1e-5).all()
    # each fourth of the tree gets its share of the rays, to one
    if parts is not None:
        quarter = (
            tree.nodes["position"][1:5, None, None] - receivers["origin"][:, None] - rays["direction"]
        ) ** 2
        nearest = quarter[..., :2].sum(-1).argmin(0)
        shares = (nearest[..., None] == np.arange(4)).mean(1)
        expected = parts / parts.sum(1, keepdims=True)
        assert_within(shares, expected, 1.5 / RAYS, "rays")
        assert_not_within(shares, np.roll(expected, 1, 1), 1.5 / RAYS)
    assert_within(weights[used].mean(axis=1), np.ones(used.sum()), 1e-4)
