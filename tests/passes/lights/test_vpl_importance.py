"""`vpl_importance`: virtual lights drawn in proportion to the flux of texels [DS06; CJAM05]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.hashing import pcg4d
from tests.passes.reference.light_trees import flat, tree
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import VIRTUAL_LIGHT, VPL_IMPORTANCE, record
from tests.passes.reference.virtual_lights import Array, random_texels

# Powers of the real root of x³ = x + 1 make the R2 sequence [Rob18].
R2 = 1 / 1.324717957244746 ** np.arange(1, 3)


def _run(runner: Runner, texels: Array, count: int, seed: int = 3) -> NDArray[Any]:
    """Lights of each map (maps, count)."""
    maps, resolution = texels.shape[:2]
    wide, _ = flat(tree(texels))
    nodes = np.zeros(len(wide), VIRTUAL_LIGHT)
    for name in wide.dtype.names or ():
        nodes[name] = wide[name]
    params = record(VPL_IMPORTANCE, count=count, maps=maps, finest=resolution.bit_length() - 1, seed=seed)
    blank = np.zeros(maps * count, VIRTUAL_LIGHT)
    out = runner("passes/lights/vpl_importance", maps * count, params=params, nodes=nodes, vpls=blank)
    return read(out, "vpls", VIRTUAL_LIGHT, maps, count)


def _points(map_: int, count: int, seed: int = 3) -> Array:
    start = pcg4d(map_, 0, 2, seed)[:2] / 2.0**32
    points: Array = (start + np.arange(count)[:, None] * R2) % 1
    return points


def _warped(weights: Array, points: Array) -> NDArray[np.int64]:
    """Column and row of the texel that each point becomes: both halves of the rows, then of the columns."""
    found = np.zeros((len(points), 2), np.int64)
    for k, (x, y) in enumerate(points):
        part, corner = weights, np.zeros(2, np.int64)
        while part.shape[0] > 1:
            half = part.shape[0] // 2
            top = part[:half].sum() / part.sum()
            below = y >= top
            y = (y - top) / (1 - top) if below else y / top
            part = part[half:] if below else part[:half]
            left = part[:, :half].sum() / part.sum()
            right = x >= left
            x = (x - left) / (1 - left) if right else x / left
            part = part[:, half:] if right else part[:, :half]
            corner += half * np.array([right, below])
        found[k] = corner
    return found


@pytest.mark.parametrize(("maps", "resolution", "count"), [(1, 16, 256), (3, 32, 100)])
def test_lights_are_those_of_warped_points(
    runner: Runner, rng: np.random.Generator, maps: int, resolution: int, count: int
) -> None:
    texels = random_texels(rng, maps, resolution)
    lights = _run(runner, texels, count)
    weights = texels[..., 2, :3].sum(-1)
    for number in range(maps):
        own = lights[number]
        at = np.stack([own["block"] & 0xFFFF, own["block"] >> 16], -1)
        expected = _warped(weights[number], _points(number, count))
        # a point within rounding of a border may fall to the other side
        assert (at == expected).all(1).mean() > 0.98
        assert (at == _warped(weights[number], _points(number, count, 4))).all(1).mean() < 0.5
        texel = texels[number, at[:, 1], at[:, 0]]
        share = weights[number].sum() / (count * weights[number, at[:, 1], at[:, 0]])
        assert (own["extent"] == number << 16).all()
        assert (own["position"] == texel[:, 0, :3]).all()
        assert (own["normal"] == texel[:, 1, :3]).all()
        assert ((own["spread"] == 0) & (own["thickness"] == 0)).all()
        wanted = {
            "flux": texel[:, 2, :3] * share[:, None],
            "area": texel[:, 2, 3] * share,
            "solid_angle": texel[:, 1, 3] * share,
            "radius": np.sqrt(texel[:, 2, 3] * share / 2),
        }
        for name, values in wanted.items():
            assert_within(own[name], values, 3e-6 * values, name)
            assert_not_within(own[name], values * 1.001, 3e-6 * values)


@pytest.mark.parametrize("count", [1, 7, 256])
def test_the_sum_of_flux_is_the_map_s(runner: Runner, rng: np.random.Generator, count: int) -> None:
    texels = random_texels(rng, 2, 32)
    sums = _run(runner, texels, count)["flux"].astype(np.float64).sum((1, 2))
    total = texels[..., 2, :3].sum((1, 2, 3))
    assert_within(sums, total, 2e-6 * total, "flux of all channels")
    assert_not_within(sums, total[::-1], 2e-6 * total)


def _chi_square(counts: NDArray[np.int64], shares: Array) -> float:
    expected = counts.sum() * shares[shares > 0]
    return float(((counts[shares > 0] - expected) ** 2 / expected).sum())


def test_densities_follow_the_flux(runner: Runner, rng: np.random.Generator) -> None:
    """No further off than random draws would be; and nothing is drawn that reflects nothing."""
    texels = random_texels(rng, 1, 8)
    lights = _run(runner, texels, 20000)[0]
    counts = np.zeros((8, 8), np.int64)
    np.add.at(counts, (lights["block"] >> 16, lights["block"] & 0xFFFF), 1)
    shares = texels[0, ..., 2, :3].sum(-1)
    shares = shares / shares.sum()
    assert counts[shares == 0].sum() == 0
    cells = int((shares > 0).sum())
    assert _chi_square(counts, shares) < cells, "the mean of random draws"
    even = (shares > 0) / cells
    assert _chi_square(counts, even) > 100 * cells
    red = texels[0, ..., 2, 0] / texels[0, ..., 2, 0].sum()
    assert _chi_square(counts, red) > 10 * cells


def test_all_channels_are_without_bias(runner: Runner, rng: np.random.Generator) -> None:
    """Over many seeds the mean of the estimate of each channel, of area and solid angle is the map's."""
    texels = random_texels(rng, 1, 8)
    runs = [_run(runner, texels, 64, seed)[0] for seed in range(200)]
    lit = texels[0, ..., 2, :3].sum(-1) > 0
    for name, total in (
        ("flux", texels[0, ..., 2, :3].sum((0, 1))),
        ("area", texels[0, ..., 2, 3][lit].sum()),
        ("solid_angle", texels[0, ..., 1, 3][lit].sum()),
    ):
        sums = np.stack([run[name].astype(np.float64).sum(0) for run in runs])
        error = 5 * sums.std(0) / np.sqrt(len(runs))
        assert_within(sums.mean(0), total, error, name)
        assert_not_within(sums.mean(0), total * 1.2, error)


def test_a_dark_map_has_lights_without_flux(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 2, 8)
    texels[0, ..., 2, :3] = 0
    lights = _run(runner, texels, 16)
    assert (lights["flux"][0] == 0).all()
    assert np.isfinite(lights["position"]).all()
    assert (lights["flux"][1].sum(1) > 0).all()


def test_equal_seeds_are_equal_lights(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 2, 16)
    first = _run(runner, texels, 64)
    assert first.tobytes() == _run(runner, texels, 64).tobytes()
    assert first.tobytes() != _run(runner, texels, 64, seed=4).tobytes()
