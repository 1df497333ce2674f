"""Two-level trees as `common/bvh` reads them, and what rays meet in float64 without any tree."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.passes.reference.structs import MISS, NODE, PLACED, TRIANGLE, record

Array = NDArray[np.float64]


@dataclasses.dataclass
class Object:
    """Triangles (n, 3, 3) in object space, float32, and where they are: linear part and origin."""

    corners: NDArray[np.float32]
    linear: Array
    center: Array

    def placed(self) -> Array:
        """Corners in scene space."""
        points: Array = self.corners.astype(np.float64) @ self.linear.T + self.center
        return points


def random_objects(rng: np.random.Generator, count: int = 5, triangles: int = 30) -> list[Object]:
    """Soups of triangles, rotated, stretched, mirrored or plainly shifted."""
    objects = []
    for index in range(count):
        middle = rng.uniform(-1, 1, (triangles, 1, 3))
        corners = (middle + rng.uniform(-0.5, 0.5, (triangles, 3, 3))).astype(np.float32)
        linear = np.eye(3)
        if index > 0:
            linear, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            linear = linear * rng.uniform(0.3, 2, 3) * (-1.0 if index % 2 else 1.0)
        objects.append(Object(corners, linear, rng.uniform(-2, 2, 3).astype(np.float32).astype(np.float64)))
    return objects


def _tree(boxes: Array, most: int) -> tuple[NDArray[Any], NDArray[np.intp]]:
    """Nodes over `boxes` (n, 2, 3) and the box of each slot: halves at the median of the widest axis."""
    nodes = [np.zeros((), NODE)]
    order: list[int] = []
    todo = [(0, np.arange(len(boxes)))]
    while todo:
        at, part = todo.pop()
        node = nodes[at]
        node["lo"], node["hi"] = boxes[part, 0].min(0), boxes[part, 1].max(0)
        if len(part) <= most:
            node["first"], node["count"] = len(order), len(part)
            order += part.tolist()
            continue
        middles = boxes[part].mean(1)
        axis = np.ptp(middles, axis=0).argmax()
        part = part[np.argsort(middles[:, axis], kind="stable")]
        node["first"] = len(nodes)
        todo += [(len(nodes), part[: len(part) // 2]), (len(nodes) + 1, part[len(part) // 2 :])]
        nodes += [np.zeros((), NODE), np.zeros((), NODE)]
    return np.array(nodes, NODE), np.array(order)


def trees(objects: list[Object]) -> dict[str, NDArray[Any]]:
    """What the trace binds, apart from its lists."""
    nodes, triangles, placed = [], [], np.zeros(len(objects), PLACED)
    boxes = np.zeros((len(objects), 2, 3))
    for index, thing in enumerate(objects):
        corners = thing.corners.astype(np.float64)
        own, order = _tree(np.stack([corners.min(1), corners.max(1)], 1), 4)
        records = np.zeros(len(order), TRIANGLE)
        for vertex, name in enumerate("abc"):
            records[name] = thing.corners[order, vertex]
        records["id"] = order
        rows = np.linalg.inv(thing.linear)
        identity = bool((thing.linear == np.eye(3)).all())
        reach = float(np.abs(corners).max())
        placed[index]["row_x"], placed[index]["row_y"], placed[index]["row_z"] = rows
        placed[index]["center"], placed[index]["reach"] = thing.center, -reach if identity else reach
        placed[index]["node"] = sum(map(len, nodes))
        placed[index]["triangle"] = sum(map(len, triangles))
        placed[index]["id"] = index
        points = thing.placed().reshape(-1, 3)
        boxes[index] = points.min(0) - 1e-4, points.max(0) + 1e-4
        nodes.append(own)
        triangles.append(records)
    top, order = _tree(boxes, 1) if objects else (np.zeros(1, NODE), np.zeros(0, np.intp))
    return {
        "top_nodes": top,
        "instances": placed[order] if objects else np.zeros(1, PLACED),
        "mesh_nodes": np.concatenate(nodes) if objects else np.zeros(1, NODE),
        "triangles": np.concatenate(triangles) if objects else np.zeros(1, TRIANGLE),
        "top_level": record(np.dtype([("nodes", "<u4")]), nodes=len(top) if objects else 0),
    }


@dataclasses.dataclass
class Met:
    """What each ray meets first, and whether rounding may change that."""

    t: Array
    u: Array
    v: Array
    instance: NDArray[np.int64]
    triangle: NDArray[np.int64]
    doubtful: NDArray[np.bool_]

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Rays that meet something."""
        return self.instance != MISS


def meet(objects: list[Object], origin: Array, direction: Array, t_min: Array, t_max: Array) -> Met:
    """Solve o + t d = (1 − u − v) a + u b + v c for every ray and triangle (Cramer's rule)."""
    count = len(origin)
    nearest, second = np.full(count, np.inf), np.full(count, np.inf)
    found = Met(nearest, *np.zeros((2, count)), *np.full((2, count), MISS), np.zeros(count, bool))
    for index, thing in enumerate(objects):
        for number, (a, b, c) in enumerate(thing.placed()):
            normal = np.cross(b - a, c - a)
            det = -(direction @ normal)
            grazing = np.abs(det) < 1e-4 * np.linalg.norm(direction, axis=1) * np.linalg.norm(normal)
            with np.errstate(divide="ignore", invalid="ignore"):
                t = ((origin - a) @ normal) / det
                turned = np.cross(origin - a, direction)
                u, v = turned @ (c - a) / det, -(turned @ (b - a)) / det
            slack = np.minimum(np.minimum(u, v), 1 - u - v)
            inside = (slack >= 0) & (t > t_min) & (t < t_max)
            near_end = np.minimum(np.abs(t - t_min), np.abs(t - t_max)) < 1e-4
            unsure = (np.abs(slack) < 1e-3) | ((slack > -1e-3) & (near_end | grazing))
            found.doubtful |= unsure & (t > t_min - 1e-3) & (t < t_max + 1e-3) & (t < nearest + 1e-3)
            t = np.where(inside, t, np.inf)
            closer = t < nearest
            second = np.minimum(second, np.where(closer, nearest, t))
            nearest = np.minimum(nearest, t)
            new = {"t": t, "u": u, "v": v, "instance": index, "triangle": number}
            for field, value in new.items():
                setattr(found, field, np.where(closer, value, getattr(found, field)))
    with np.errstate(invalid="ignore"):
        found.doubtful |= (second - nearest) < 1e-4
    return found
