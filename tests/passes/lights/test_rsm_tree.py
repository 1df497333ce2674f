"""`rsm_tree`: virtual lights of all squares of texels, and bounds that hold for what is in them [NSW09]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.light_trees import flat, morton, tree
from tests.passes.reference.rsm import FAR
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import RSM_MAP, RSM_TREE, VIRTUAL_LIGHT, record
from tests.passes.reference.virtual_lights import Array, random_texels

STEM = "passes/lights/rsm_tree"
FIELDS = ("position", "normal", "area", "flux", "solid_angle", "radius", "spread", "thickness")


def _first(level: int, maps: int) -> int:
    return maps * sum(4**k for k in range(level))


def run_tree(
    runner: Runner, texels: Array, tiles: int = 1, single: int = 99
) -> tuple[NDArray[Any], NDArray[np.float32]]:
    """All nodes, and their ranges (n, 2, 4)."""
    maps, resolution = texels.shape[:2]
    finest = resolution.bit_length() - 1
    all_ = _first(finest + 1, maps)
    nodes, ranges = np.zeros(all_, VIRTUAL_LIGHT), np.zeros((2 * all_, 4), np.float32)
    table = np.concatenate([record(RSM_MAP, tiles=tiles, resolution=resolution, map=k) for k in range(maps)])
    rows = texels.reshape(-1, 4).astype(np.float32)
    for level in range(finest, -1, -1):
        leaves = level == finest
        more = {"maps": table, "rsm_texels": rows} if leaves else {}
        params = record(RSM_TREE, level=level, finest=finest, maps=maps, single=single)
        out = runner(
            STEM,
            maps * 4**level,
            entry="leaves" if leaves else "reduce",
            params=params,
            nodes=nodes,
            ranges=ranges,
            **more,
        )
        nodes = read(out, "nodes", VIRTUAL_LIGHT)
        ranges = read(out, "ranges", np.float32, 2 * all_, 4)
    return nodes, ranges.reshape(all_, 2, 4)


@pytest.mark.parametrize(
    ("maps", "resolution", "tiles", "single"), [(1, 16, 1, 99), (3, 16, 4, 2), (2, 64, 2, 0), (1, 64, 1, 4)]
)
def test_nodes_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, maps: int, resolution: int, tiles: int, single: int
) -> None:
    texels = random_texels(rng, maps, resolution)
    nodes, ranges = run_tree(runner, texels, tiles, single)
    expected, expected_ranges = flat(tree(texels, tiles, single))
    for name in ("block", "extent"):
        assert (nodes[name] == expected[name]).all()
    for name in FIELDS:
        # a rounding a level of numbers up to 3; where a mean normal is short its direction is less sure
        bound = 1e-5 * np.abs(expected[name]) + (4e-6 if name in FIELDS[:2] or name in FIELDS[5:] else 0)
        assert_within(nodes[name], expected[name], bound, name)
        assert_not_within(nodes[name], np.roll(expected[name], 1, 0), bound)
    assert (ranges == expected_ranges.astype(np.float32)).all()
    assert (ranges[:, 1, 3] == np.float32(FAR)).mean() > 0.3, "some see nothing"
    assert (ranges[:, 0, 3] == np.float32(FAR)).mean() > 0.2, "some have no flux"


def test_sums_are_kept_at_every_level(runner: Runner, rng: np.random.Generator) -> None:
    maps, resolution = 2, 32
    texels = random_texels(rng, maps, resolution)
    nodes, _ = run_tree(runner, texels)
    lit = texels[..., 2, :3].sum(-1, keepdims=True) > 0
    for level in range(6):
        part = nodes[_first(level, maps) : _first(level + 1, maps)].reshape(maps, -1)
        for name, values in (
            ("flux", texels[..., 2, :3]),
            ("area", texels[..., 2, 3:] * lit),
            ("solid_angle", texels[..., 1, 3:]),
        ):
            total = values.sum((1, 2))
            sums = part[name].astype(np.float64).reshape(maps, -1, total.shape[1]).sum(1)
            assert_within(sums, total, 12 * ULP * total, name)
            assert_not_within(sums, total * 1.00001, 12 * ULP * total)


def test_every_bound_holds_for_the_leaves(runner: Runner, rng: np.random.Generator) -> None:
    """Brute force: discs about all texels with flux, against each node above them."""
    maps, resolution = 2, 16
    texels = random_texels(rng, maps, resolution)
    nodes, ranges = run_tree(runner, texels)
    leaves = nodes[_first(4, maps) :].reshape(maps, -1)
    loose = 0
    for level in range(4):
        part = nodes[_first(level, maps) : _first(level + 1, maps)]
        held = leaves.reshape(len(part), -1)
        for k, (node, inside) in enumerate(zip(part, held, strict=True)):
            lit = inside[inside["flux"].sum(1) > 0]
            if not len(lit):
                assert node["flux"].sum() == 0
                continue
            unit = node["normal"] / np.linalg.norm(node["normal"])
            turned = np.linalg.norm(lit["normal"] - unit, axis=1)
            assert turned.max() <= node["spread"] + 1e-5
            u = np.cross(lit["normal"], rng.normal(size=lit["normal"].shape))
            u *= (lit["radius"] / np.linalg.norm(u, axis=1))[:, None]
            points = np.concatenate([lit["position"] + u, lit["position"] - u]).astype(np.float64)
            away = points - node["position"]
            assert np.linalg.norm(away, axis=1).max() <= node["radius"] + 1e-6
            assert np.abs(away @ unit).max() <= node["thickness"] + 1e-6
            loose += np.linalg.norm(away, axis=1).max() > 0.5 * node["radius"]
            bounds = ranges[_first(level, maps) + k]
            assert (lit["normal"].min(0) == bounds[0, :3]).all()
            assert (lit["normal"].max(0) == bounds[1, :3]).all()
    assert loose > 0.8 * _first(4, maps), "and they are not much too large"


def test_nodes_lie_where_their_numbers_say(runner: Runner, rng: np.random.Generator) -> None:
    """A node's four children are side by side, and its block is theirs."""
    maps, resolution = 3, 16
    nodes, _ = run_tree(runner, random_texels(rng, maps, resolution))
    for level in range(5):
        part = nodes[_first(level, maps) : _first(level + 1, maps)].reshape(maps, -1)
        width = resolution >> level
        at = morton(1 << level) * width
        assert (part["block"] == at[:, 0] | at[:, 1] << 16).all()
        assert (part["extent"] & 0xFFFF == width).all()
        assert (part["extent"] >> 16 == np.arange(maps)[:, None]).all()
        if level < 4:
            below = nodes[_first(level + 1, maps) : _first(level + 2, maps)].reshape(maps, -1, 4)
            assert (below["block"][:, :, 0] == part["block"]).all()
            assert (below["block"][:, :, 3] == part["block"] + (width // 2) * (1 + (1 << 16))).all()


def test_normals_that_cancel_have_the_direction_of_the_brightest(
    runner: Runner, rng: np.random.Generator
) -> None:
    texels = random_texels(rng, 1, 2, dark=0.0)
    texels[0, :, :, 2, :3] = 1
    texels[0, 0, 0, 2, 0] = texels[0, 1, 1, 2, 0] = 2
    up = np.array([0.6, 0.8, 0])
    texels[0, 0, :, 1, :3], texels[0, 1, :, 1, :3] = -up, up
    light, _ = run_tree(runner, texels, single=0)
    assert_within(light["normal"][0], -up, 1e-6, "normal")
    nodes, _ = run_tree(runner, texels)
    assert_within(nodes["normal"][0] / np.linalg.norm(nodes["normal"][0]), -up, 1e-6, "normal")
    assert np.linalg.norm(nodes["normal"][0]) < 1e-5
    assert_within(nodes["spread"][0], 2.0, 1e-6, "spread")


def test_one_wall_is_thin_and_a_corner_is_not(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 1, 16, dark=0.0)
    texels[..., 0, 2], texels[..., 1, :3] = -1, (0, 0, 1)
    nodes, _ = run_tree(runner, texels)
    assert_within(nodes["thickness"], np.zeros(len(nodes)), 1e-6, "thickness")
    texels[0, :, 8:, 1, :3], texels[0, :, 8:, 0, 2] = (-1, 0, 0), -1 + texels[0, :, 8:, 0, 0]
    nodes, _ = run_tree(runner, texels)
    assert nodes["thickness"][0] > 0.3
    assert nodes["spread"][0] > 0.5
