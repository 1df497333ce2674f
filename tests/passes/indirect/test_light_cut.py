"""`light_cut`: irradiance from a cut through the tree of virtual lights [NSW09 Sec. 3.5; WFA05]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from numpy.typing import NDArray

from tests.passes.reference.light_cuts import Tree, bounds, cut, disc, emission, random_tree
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import CUT, MISS, RECEIVER, RSM_MAP, VIRTUAL_LIGHT, record

Array = NDArray[np.float64]
BOUNDS = ("paper", "contribution", "error")


def _receivers(rng: np.random.Generator, count: int, low: float = 0.05) -> NDArray[Any]:
    """Above the surface of the tree, most of them looking down on it."""
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = rng.uniform([-0.7, -0.7, low], [0.7, 0.7, 0.8], (count, 3))
    normal = rng.normal(size=(count, 3)) + np.array([0, 0, -1.5])
    receivers["normal_shade"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    receivers["normal_geo"] = receivers["normal_shade"]
    receivers["pixel"] = rng.permutation(count)
    return receivers


def _params(tree: Tree, levels: tuple[int, int], bound: str, threshold: float) -> NDArray[Any]:
    coarsest, finest = levels
    return record(
        CUT,
        roots=4**coarsest,
        coarsest=coarsest,
        finest=finest,
        maps=1,
        bound=BOUNDS.index(bound),
        threshold=threshold,
        reach=3e38,
        reference=min(coarsest, 3),
        parts=1,
    )


def _run(
    runner: Runner,
    tree: Tree,
    receivers: NDArray[Any],
    levels: tuple[int, int],
    bound: str,
    threshold: float,
    form: int = 1,
    lanes: int = 1,
) -> tuple[Array, int]:
    out = runner(
        "passes/indirect/light_cut",
        lanes * len(receivers),
        entry="wide" if lanes > 1 else "main",
        constants={"FORM": form, "LANES": lanes},
        params=_params(tree, levels, bound, threshold),
        receivers=receivers,
        maps=np.zeros(1, RSM_MAP),
        virtual_lights=tree.nodes,
        ranges=tree.ranges,
        irradiance=np.full((len(receivers), 4), np.nan, np.float32),
        evaluations=np.zeros(2, np.uint32),
        parts=np.zeros(lanes * len(receivers), np.float32),
    )
    if lanes > 1:
        parts = read(out, "parts", np.float32, len(receivers), lanes).sum(axis=1)
        light = read(out, "irradiance", np.float32, len(receivers), 4)[:, 3]
        given = receivers["pixel"] != MISS
        assert_within(parts[given], light[receivers["pixel"][given]], 1e-5 * parts[given] + 1e-9, "parts")
    low, high = (int(word) for word in read(out, "evaluations", np.uint32))
    return read(out, "irradiance", np.float32, len(receivers), 4).astype(np.float64), low + 256 * high


@pytest.mark.parametrize("lanes", [1, 4, 16])
@pytest.mark.parametrize(("bound", "threshold"), [("paper", 1.5), ("contribution", 0.02), ("error", 0.01)])
def test_agrees_with_the_reference(
    runner: Runner, rng: np.random.Generator, bound: str, threshold: float, lanes: int
) -> None:
    tree, receivers = random_tree(rng, 5), _receivers(rng, 96)
    out, count = _run(runner, tree, receivers, (2, 5), bound, threshold, lanes=lanes)
    expected = [cut(tree, receiver, (2, 5), bound, threshold) for receiver in receivers]
    sure = np.array([closest > 1e-3 for _, _, closest in expected])
    assert sure.mean() > 0.4
    light = np.array([total for total, _, _ in expected])
    got = out[receivers["pixel"]]
    assert_within(got[sure, :3], light[sure], 1e-4 * light[sure] + 1e-6, "irradiance")
    assert_not_within(got[sure, :3], 1.001 * light[sure] + 1e-4, 1e-4 * light[sure] + 1e-6)
    assert_within(got[:, 3], got[:, :3].mean(axis=1), 1e-5 * got[:, 3] + 1e-9, "mean")
    nodes = sum(number for _, number, _ in expected)
    assert count == pytest.approx(nodes, rel=0.02)
    # the cut is a cut: more than the roots, less than the leaves
    assert 16 * len(receivers) < count < 0.7 * 4**5 * len(receivers)


def test_without_a_threshold_every_leaf_counts(runner: Runner, rng: np.random.Generator) -> None:
    tree, receivers = random_tree(rng, 4), _receivers(rng, 64)
    leaves = tree.nodes[tree.first(4) :]
    light = np.array([sum(disc(receiver, leaf) for leaf in leaves) for receiver in receivers])
    out, _ = _run(runner, tree, receivers, (1, 4), "contribution", 0.0)
    assert_within(out[receivers["pixel"], :3], light, 1e-4 * light + 1e-6)
    coarse, count = _run(runner, tree, receivers, (2, 2), "contribution", 0.0)
    roots = tree.nodes[tree.first(2) : tree.first(3)]
    light = np.array([sum(disc(receiver, root) for root in roots) for receiver in receivers])
    assert_within(coarse[receivers["pixel"], :3], light, 1e-4 * light + 1e-6)
    assert count == 16 * len(receivers)


@pytest.mark.parametrize("bound", ["contribution", "error"])
def test_error_follows_the_threshold(runner: Runner, rng: np.random.Generator, bound: str) -> None:
    tree, receivers = random_tree(rng, 6), _receivers(rng, 256, low=0.15)
    exact, leaves = _run(runner, tree, receivers, (6, 6), bound, 0.0)
    errors, counts = [], []
    for threshold in (0.1, 0.03, 0.01, 0.003):
        out, count = _run(runner, tree, receivers, (2, 6), bound, threshold)
        errors.append(np.sqrt(((out - exact) ** 2).mean()) / exact.mean())
        counts.append(count / leaves)
    assert errors == sorted(errors, reverse=True)
    assert counts == sorted(counts)
    assert errors[-1] < 0.01
    assert counts[0] < 0.05


def test_bounds_hold_for_what_is_in_a_node(runner: Runner, rng: np.random.Generator) -> None:
    """Every leaf of a node gives no less than its least and no more than its most, as point and as disc."""
    tree, receivers = random_tree(rng, 5), _receivers(rng, 200)
    checked = 0
    for receiver in receivers:
        number = int(rng.integers(4**2))
        node = tree.nodes[tree.first(2) + number]
        leaves = tree.nodes[tree.first(5) + 4**3 * number :][: 4**3]
        lit = leaves[leaves["flux"].sum(axis=1) > 0]
        least, most = bounds(receiver, node)
        for as_disc in (False, True):
            per_flux = [disc(receiver, leaf, as_disc).mean() / leaf["flux"].mean() for leaf in lit]
            assert least <= min(per_flux) * (1 + 1e-5)
            assert max(per_flux) <= most * (1 + 1e-5)
            checked += max(per_flux) > 0
    assert checked > 200


@pytest.mark.parametrize("lanes", [1, 8])
def test_inactive_receivers_are_left_alone(runner: Runner, rng: np.random.Generator, lanes: int) -> None:
    tree, receivers = random_tree(rng, 3), _receivers(rng, 8)
    receivers["pixel"][::2] = MISS
    out, _ = _run(runner, tree, receivers, (1, 3), "error", 0.01, lanes=lanes)
    touched = np.isfinite(out[:, 0])
    assert touched.sum() == 4
    assert touched[receivers["pixel"][1::2]].all()


@pytest.mark.parametrize("alike", [0.15, 0.5, 0.8, 0.95])
def test_emission_is_that_of_normals_about_their_mean(rng: np.random.Generator, alike: float) -> None:
    """Against normals spread as von Mises and Fisher have it; one cosine is far off."""
    mean_length = lambda kappa: 1 / np.tanh(kappa) - 1 / kappa  # noqa: E731
    kappa = scipy.optimize.brentq(lambda kappa: mean_length(kappa) - alike, 1e-3, 1e3)
    normals = scipy.stats.vonmises_fisher([0, 0, 1], kappa).rvs(200_000, random_state=rng)
    x = np.linspace(-1, 1, 41)
    directions = np.stack([np.sqrt(1 - x**2), 0 * x, x], axis=1)
    exact = np.array([np.maximum(normals @ w, 0).mean() for w in directions])
    assert_within(emission(x, alike), exact, 0.02, "emission")
    assert_not_within(np.maximum(x, 0), exact, 0.04 if alike > 0.9 else 0.1)


def test_emission_keeps_energy_and_ends_at_the_cosine() -> None:
    """Over all directions its mean is 1/4, as that of the clamped cosine."""
    x, weights = np.polynomial.legendre.leggauss(200)
    for alike in (0.0, 0.3, 0.6, 0.9, 0.999):
        assert (emission(x, alike) * weights).sum() / 2 == pytest.approx(0.25, rel=0.01)
    assert_within(emission(x, 1.0), np.maximum(x, 0), 1e-12)
    assert_within(emission(x, 0.0), np.full(len(x), 0.25), 1e-12)


def test_a_node_of_surfaces_that_face_different_ways_shines_like_them(
    runner: Runner, rng: np.random.Generator
) -> None:
    """Far from a ball whose points all reflect the same, a single node is as bright as they are."""
    normals = rng.normal(size=(4**5, 3)) * [1, 1, 0.5] + [0, 0, 1.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    leaves = np.zeros(4**5, VIRTUAL_LIGHT)
    leaves["position"], leaves["normal"], leaves["flux"] = 0.01 * normals, normals, 1.0
    node = np.zeros(1, VIRTUAL_LIGHT)
    node["position"], node["normal"], node["flux"] = leaves["position"].mean(0), normals.mean(0), float(4**5)
    node["radius"], node["thickness"], node["spread"] = 0.02, 0.02, 2.0
    receivers = np.zeros(40, RECEIVER)
    away = rng.normal(size=(40, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    receivers["origin"], receivers["normal_shade"], receivers["normal_geo"] = 2 * away, -away, -away
    receivers["pixel"] = np.arange(40)
    single = Tree(node, np.zeros((2, 4), np.float32), 0)
    out = _run(runner, single, receivers, (0, 0), "error", 0.0)[0][:, 0]
    all_of = np.array([sum(disc(receiver, leaf)[0] for leaf in leaves) for receiver in receivers])
    assert_within(out, all_of, 0.06 * all_of.max(), "irradiance")
    node["normal"] /= np.linalg.norm(node["normal"])
    out = _run(runner, single, receivers, (0, 0), "error", 0.0)[0][:, 0]
    assert_not_within(out, all_of, 0.15 * all_of.max())


def test_nodes_give_no_more_than_their_surfaces_may(runner: Runner) -> None:
    """What a cluster's mean emission sends behind all of its surfaces is cut off."""
    node = np.zeros(1, VIRTUAL_LIGHT)
    node["normal"], node["flux"], node["radius"], node["thickness"] = (0, 0, 0.6), 1.0, 1e-3, 1e-3
    away = np.array([np.sqrt(0.96), 0, -0.2])
    receivers = np.zeros(1, RECEIVER)
    receivers["origin"], receivers["normal_shade"], receivers["normal_geo"] = 2 * away, -away, -away
    lit = []
    for spread in (0.1, 2.0):
        node["spread"] = spread
        single = Tree(node, np.zeros((2, 4), np.float32), 0)
        lit.append(_run(runner, single, receivers, (0, 0), "error", 0.0)[0][0, 0])
    assert lit[0] == 0
    assert lit[1] == pytest.approx(emission(-0.2, 0.6).item() / (4 * np.pi), rel=1e-3)
