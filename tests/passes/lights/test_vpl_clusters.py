"""`vpl_clusters`: a cut through the tree over reflective shadow maps [NSW09 Sec. 3.4]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.lights.test_rsm_tree import run_tree
from tests.passes.reference.rsm import FAR
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import VIRTUAL_LIGHT, VPL_CLUSTERS, record
from tests.passes.reference.virtual_lights import Array, random_texels

STEM = "passes/lights/vpl_clusters"
NEVER = 3.0e38


@dataclasses.dataclass
class Case:
    """A tree, and what clusters may be."""

    nodes: NDArray[Any]
    ranges: NDArray[np.float32]
    maps: int
    first_spot: int
    area: tuple[int, int]
    spot: tuple[int, int]
    metric: str
    depth: float
    normal: float

    def first(self, level: int) -> int:
        """Nodes above a level."""
        return self.maps * sum(4**k for k in range(level))

    def levels(self, map_: int) -> tuple[int, int]:
        """Coarsest and finest level of a map's clusters."""
        return self.spot if map_ >= self.first_spot else self.area

    def clean(self, node: int) -> bool:
        """Whether nothing in a node calls for smaller ones; thresholds as float32 has them."""
        light, (least, largest) = self.nodes[node], self.ranges[node]
        depth, normal = np.float32(self.depth), np.float32(self.normal)
        if largest[3] >= np.float32(FAR) and self.depth < NEVER:
            return False
        if self.metric == "plane":
            with np.errstate(over="ignore"):
                return bool(light["thickness"] <= depth * light["radius"] and light["spread"] <= normal)
        apart = largest - least
        return bool(apart[3] <= depth and apart[:3].max() <= normal)

    def cut(self) -> list[int]:
        """The nodes, by going down from each of the coarsest as long as one is not clean."""
        found = []
        for map_ in range(self.maps):
            coarsest, finest = self.levels(map_)
            todo = [(coarsest, k) for k in range(4**coarsest)]
            while todo:
                level, k = todo.pop()
                node = self.first(level) + map_ * 4**level + k
                if not self.nodes["flux"][node].sum() > 0:
                    continue
                if level == finest or self.clean(node):
                    found.append(node)
                else:
                    todo += [(level + 1, 4 * k + c) for c in range(4)]
        return sorted(found)


def _smooth(rng: np.random.Generator, maps: int, resolution: int) -> Array:
    """A ground that is flat here and rough there, with a step, a hole and black parts."""
    texels = random_texels(rng, maps, resolution, dark=0.0)
    half = resolution // 2
    texels[:, :, :half, 0, 2], texels[:, :, :half, 1, :3] = -1, (0, 0, 1)
    texels[:, : half // 2, :half, 0, 2] = -1.5
    texels[..., 0, 3] = np.linalg.norm(texels[..., 0, :3], axis=-1)
    texels[:, half + 1, 2, 0], texels[:, half + 1, 2, 2] = (0, 0, 0, FAR), 0
    texels[:, half + 3, half // 2, 2, :3] = 0
    texels[:, -4:, :4, 2, :3] = 0
    rounded: Array = texels.astype(np.float32).astype(np.float64)
    return rounded


def _case(runner: Runner, texels: Array, **options: Any) -> Case:
    values = {
        "first_spot": 1,
        "area": (1, 4),
        "spot": (0, 3),
        "metric": "plane",
        "depth": 0.25,
        "normal": 0.5,
    }
    nodes, ranges = run_tree(runner, texels)
    return Case(nodes, ranges, len(texels), **{**values, **options})


def _run(runner: Runner, case: Case) -> tuple[list[int], NDArray[Any]]:
    """Which nodes are taken, and the packed list."""
    coarsest, finest = min(case.area[0], case.spot[0]), max(case.area[1], case.spot[1])
    first = case.first(coarsest)
    count = case.first(finest + 1) - first
    params = record(
        VPL_CLUSTERS,
        first=first,
        maps=case.maps,
        first_spot=case.first_spot,
        by_range=case.metric == "range",
        coarsest_area=case.area[0],
        finest_area=case.area[1],
        coarsest_spot=case.spot[0],
        finest_spot=case.spot[1],
        depth_threshold=case.depth,
        normal_threshold=case.normal,
    )
    states = np.zeros(count, np.uint32)
    out = runner(
        STEM,
        count,
        entry="judge",
        params=params,
        nodes=case.nodes,
        ranges=case.ranges.reshape(-1, 4),
        states=states,
    )
    states = read(out, "states", np.uint32)
    out = runner(STEM, count, entry="choose", params=params, states=states, chosen=np.zeros(count, np.uint32))
    chosen = np.flatnonzero(read(out, "chosen", np.uint32)).astype(np.uint32)
    blank = np.zeros(len(chosen), VIRTUAL_LIGHT)
    out = runner(
        STEM, len(chosen), entry="pack", params=params, nodes=case.nodes, chosen_list=chosen, vpls=blank
    )
    return (first + chosen).tolist(), read(out, "vpls", VIRTUAL_LIGHT)


@pytest.mark.parametrize(
    ("metric", "depth", "normal"),
    [
        ("plane", 0.25, 0.5),
        ("plane", 0.05, NEVER),
        ("plane", NEVER, 0.9),
        ("range", 0.2, 0.5),
        ("range", 0.1, NEVER),
        ("range", NEVER, 0.8),
    ],
)
def test_the_cut_is_that_of_going_down(
    runner: Runner, rng: np.random.Generator, metric: str, depth: float, normal: float
) -> None:
    case = _case(runner, _smooth(rng, 2, 16), metric=metric, depth=depth, normal=normal)
    taken, lights = _run(runner, case)
    assert taken == case.cut()
    assert lights.tobytes() == case.nodes[taken].tobytes()
    sizes = np.unique(lights["extent"] & 0xFFFF)
    assert len(sizes) > 1, "large and small ones"
    changed = dataclasses.replace(case, metric="range" if metric == "plane" else "plane")
    assert taken != changed.cut(), "the other metric is another cut"


def _covered(lights: NDArray[Any], maps: int, resolution: int) -> NDArray[np.int64]:
    """How many lights hold each texel."""
    owners = np.zeros((maps, resolution, resolution), int)
    for light in lights:
        x, y, width = light["block"] & 0xFFFF, light["block"] >> 16, light["extent"] & 0xFFFF
        owners[light["extent"] >> 16, y : y + width, x : x + width] += 1
    return owners


@pytest.mark.parametrize("depth", [0.0, 0.1, NEVER])
def test_every_texel_with_flux_is_in_one_cluster(
    runner: Runner, rng: np.random.Generator, depth: float
) -> None:
    texels = _smooth(rng, 2, 16)
    case = _case(runner, texels, depth=depth, area=(1, 4), spot=(0, 4))
    _, lights = _run(runner, case)
    owners = _covered(lights, 2, 16)
    lit = texels[..., 2, :3].sum(-1) > 0
    assert owners.max() == 1
    assert (owners[lit] == 1).all()
    for name, values, where in (
        ("flux", texels[..., 2, :3], lit),
        ("solid_angle", texels[..., 1, 3:], owners == 1),
    ):
        total = values[where].sum(0)
        sums = lights[name].astype(np.float64).reshape(len(lights), -1).sum(0)
        assert_within(sums, total, 20 * ULP * total, name)
        assert_not_within(sums, total * 1.00001, 20 * ULP * total)
    whole = lights["solid_angle"].astype(np.float64).sum() + texels[owners == 0][:, 1, 3].sum()
    assert_within(whole, texels[..., 1, 3].sum(), 20 * ULP * whole, "the frustum's solid angle")


def test_no_threshold_is_the_coarsest_and_zero_the_finest(runner: Runner, rng: np.random.Generator) -> None:
    texels = random_texels(rng, 2, 16, dark=0.3)
    for depth, normal, level in ((NEVER, NEVER, 0), (0.0, 0.0, 1)):
        case = _case(runner, texels, depth=depth, normal=normal)
        _, lights = _run(runner, case)
        widths = [lights["extent"][lights["extent"] >> 16 == m] & 0xFFFF for m in (0, 1)]
        assert set(widths[0]) == {16 >> case.area[level]}
        assert set(widths[1]) == {16 >> case.spot[level]}


@pytest.mark.parametrize("metric", ["plane", "range"])
def test_the_end_of_a_surface_splits(runner: Runner, rng: np.random.Generator, metric: str) -> None:
    """A flat wall is one cluster; with a texel that sees nothing, but not with one outside of the cone."""
    texels = random_texels(rng, 1, 16, dark=0.0)
    texels[..., 0, 2], texels[..., 1, :3], texels[..., 0, 3] = -1, (0, 0, 1), 1.5
    options: dict[str, Any] = {"metric": metric, "first_spot": 0, "spot": (0, 4)}
    assert len(_run(runner, _case(runner, texels, **options))[1]) == 1
    texels[0, 5, 5, 0], texels[0, 5, 5, 2] = (0, 0, 0, FAR), 0
    _, lights = _run(runner, _case(runner, texels, **options))
    assert len(lights) == 4 * 3, "three at each level on the way to it"
    texels[0, 5, 5, 1, 3] = 0
    assert len(_run(runner, _case(runner, texels, **options))[1]) == 1
