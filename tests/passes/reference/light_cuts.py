"""Cuts through a tree of virtual lights, in float64 and one node at a time."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from .light_trees import morton
from .structs import VIRTUAL_LIGHT

Array = NDArray[np.float64]


@dataclasses.dataclass
class Tree:
    """Nodes in the order of the flat buffer, of one map, with their ranges."""

    nodes: NDArray[Any]
    ranges: NDArray[np.float32]
    finest: int

    @staticmethod
    def first(level: int) -> int:
        """Number of the first node of a level."""
        return int((4**level - 1) // 3)


def emission(x: Any, alike: Any) -> Any:
    """Mean clamped cosine of normals whose mean has the cosine `x` and the length `alike`.

    The cosine's Legendre series [RH01], of its bands what heat on the sphere leaves; beyond the fourth as of
    the sixth.
    """
    series = np.array([1 / 4, 1 / 2, 5 / 16, 0, -3 / 32])
    band = np.arange(5)
    faint = series * np.asarray(alike)[..., None] ** (band * (band + 1) / 2)
    polynomials = legvander(np.asarray(x), 4)
    rest = np.maximum(x, 0) - polynomials @ series
    return np.maximum((polynomials * faint).sum(-1) + np.asarray(alike) ** 21 * rest, 0)


def unit_normal(node: Any) -> Array:
    """Direction of the mean normal."""
    normal: Array = node["normal"].astype(np.float64)
    return normal / np.linalg.norm(normal) if normal.any() else normal


def _parent(children: NDArray[Any]) -> Any:
    """The node above four; bounds as loose as they are simple."""
    node = np.zeros((), VIRTUAL_LIGHT)
    weight = children["flux"].sum(axis=1)
    for name in ("area", "solid_angle", "flux"):
        node[name] = children[name].sum(axis=0)
    if weight.sum() == 0:
        return node
    lit = children[weight > 0]
    share = (weight[weight > 0] / weight.sum())[:, None]
    node["position"] = (share * lit["position"]).sum(axis=0)
    node["normal"] = (share * lit["normal"]).sum(axis=0)
    unit = unit_normal(node)
    apart = np.linalg.norm(lit["position"] - node["position"], axis=1)
    turned = np.linalg.norm([unit_normal(child) - unit for child in lit], axis=1)
    off = np.abs((lit["position"] - node["position"]) @ unit)
    node["radius"] = (apart + lit["radius"]).max() * (1 + 1e-6)
    node["spread"] = (turned + lit["spread"]).max() + 1e-6
    node["thickness"] = min((off + lit["thickness"] + turned * lit["radius"]).max() + 1e-6, node["radius"])
    return node


def random_tree(rng: np.random.Generator, finest: int) -> Tree:
    """Points of a bumpy surface about z = 0 that looks up, an eighth of them dark; each leaf a small disc."""
    side = 2**finest
    leaves = np.zeros(4**finest, VIRTUAL_LIGHT)
    x, y = ((morton(side) + 0.5) / side - 0.5).T
    bump = 0.02 * np.sin(9 * x) * np.cos(7 * y)
    leaves["position"] = np.stack([x, y, bump], axis=1)
    normal = np.stack(
        [-0.18 * np.cos(9 * x) * np.cos(7 * y), 0.14 * np.sin(9 * x) * np.sin(7 * y), 1 + 0 * x], 1
    )
    leaves["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    leaves["area"] = 1 / side**2
    leaves["radius"] = 1e-6
    leaves["flux"] = rng.uniform(0.1, 1, (4**finest, 3)) * (rng.uniform(size=4**finest) > 0.125)[:, None]
    leaves["solid_angle"] = rng.uniform(0.5, 1, 4**finest) / side**2
    depths = rng.uniform(1, 2, 4**finest)
    levels, spans = [leaves], [np.stack([depths, depths], axis=1)]
    for _ in range(finest):
        levels.insert(0, np.array([_parent(four) for four in levels[0].reshape(-1, 4)]))
        four_spans = spans[0].reshape(-1, 4, 2)
        spans.insert(0, np.stack([four_spans[..., 0].min(axis=1), four_spans[..., 1].max(axis=1)], axis=1))
    span = np.concatenate(spans)
    ranges = np.zeros((len(span), 2, 4), np.float32)
    ranges[:, 0, 3], ranges[:, 1, 3] = span[:, 0], span[:, 1]
    return Tree(np.concatenate(levels), ranges.reshape(-1, 4), finest)


def disc(receiver: Any, node: Any, disc: bool = True) -> Array:
    """Irradiance of one node as a disc, or as a point: flux cos cos / (π d² + A)."""
    d = node["position"].astype(np.float64) - receiver["origin"]
    far = np.linalg.norm(d)
    w = d / far
    cosines = [
        receiver["normal_shade"] @ w,
        receiver["normal_geo"] @ w,
    ]
    alike = float(np.linalg.norm(node["normal"].astype(np.float64)))
    leaves = -unit_normal(node) @ w
    leaves = max(leaves, 0.0) if alike > 0.99999 else emission(leaves, alike).item()
    if min(cosines) <= 0 or leaves <= 0:
        return np.zeros(3)
    area = float(node["area"]) if disc else 0.0
    light: Array = node["flux"].astype(np.float64) * cosines[0] * leaves / (np.pi * far**2 + area)
    return light


def bounds(receiver: Any, node: Any) -> tuple[float, float]:
    """Least and largest irradiance a unit of flux that points of the node may give."""
    n, facing = receiver["normal_shade"].astype(np.float64), unit_normal(node)
    d = node["position"].astype(np.float64) - receiver["origin"]
    far, radius, thickness = float(np.linalg.norm(d)), float(node["radius"]), float(node["thickness"])
    near: float = max(far - radius, 0.0)
    outermost = far + radius
    turned = float(n @ facing)
    along = min(radius, radius * np.sqrt(max(1 - turned**2, 0)) + thickness * abs(turned))
    height, behind = float(n @ d), float(-facing @ d)

    def ratio(over: float, under: float) -> float:
        return 1.0 if over >= under else max(over / under, 0.0)

    least = ratio(max(height - along, 0), outermost)
    least *= max(ratio(max(behind - thickness, 0), outermost) - float(node["spread"]), 0)
    if height + along <= 0:
        return 0.0, 0.0
    across = behind + thickness
    leaves = across / outermost if across < 0 else ratio(across, near)
    most = ratio(height + along, near) * min(max(leaves + float(node["spread"]), 0), 1)
    most /= max(np.pi * near**2, 1e-37)
    return min(least / (np.pi * outermost**2 + float(node["area"])), most), most


def cut(
    tree: Tree,
    receiver: Any,
    levels: tuple[int, int],
    bound: str,
    threshold: float,
    roots: Sequence[int] | None = None,
) -> tuple[Array, int, float]:
    """Irradiance of one receiver, nodes that give it, and how near the nearest decision was: |ratio − 1|.

    `roots`: of these nodes of the coarsest level alone.
    """
    coarsest, finest = levels
    estimate = coarsest if coarsest < 3 else 3
    first = tree.first(estimate)
    scale = sum(disc(receiver, node).mean() for node in tree.nodes[first : first + 4**estimate])
    closest = np.inf
    total, count = np.zeros(3), 0
    stack = [(coarsest, number) for number in (range(4**coarsest) if roots is None else roots)]
    while stack:
        level, number = stack.pop()
        at = tree.first(level) + number
        node = tree.nodes[at]
        power = float(node["flux"].astype(np.float64).mean())
        least, most = bounds(receiver, node)
        if bound == "paper":
            d = node["position"].astype(np.float64) - receiver["origin"]
            projected = float(node["solid_angle"]) * float(tree.ranges[2 * at + 1, 3]) ** 2
            value, limit = power, threshold * (np.pi * (d @ d) + projected)
        else:
            value, limit = power * (most - (least if bound == "error" else 0)), threshold * scale
        if level < finest and power > 0:
            if limit > 0:
                closest = min(closest, abs(value / limit - 1))
            if value > limit:
                stack += [(level + 1, 4 * number + k) for k in range(4)]
                continue
        total += np.minimum(disc(receiver, node), most * node["flux"].astype(np.float64))
        count += 1
    return total, count, closest
