"""The grid of voxels in float64: where points lie in it, what a triangle fills, and what a segment meets."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .image import rotation
from .structs import VOXELS, record

Array = NDArray[np.float64]
Bits = NDArray[np.bool_]

LEAVE = 2.0
"""Voxels within which a ray may leave what it starts in."""
THICK, THICKEST = 0.5, 1.0
"""Slices that a step looks ahead, for each cell that it leaves out, and at most."""
DEEP = 4.0
"""Slices that a step looks through at most, where there are steps enough."""
BLOCK, RING = 4, 4
"""Cells along an edge of a block, and around it."""


@dataclasses.dataclass
class Grid:
    """Columns × rows × slices before an eye; `axes` are the rows right, down, and depth."""

    eye: Array
    axes: Array
    columns: int
    rows: int
    words: int
    near: float
    far: float
    scale: Array
    center: Array
    bias: float = 1.0
    steps: int = 16

    def packed(self) -> NDArray[Any]:
        """As the shaders read it."""
        right, down, depth = self.axes
        return record(
            VOXELS,
            eye=self.eye,
            right=right,
            up=-down,
            backward=-depth,
            columns=self.columns,
            rows=self.rows,
            words=self.words,
            near=self.near,
            far=self.far,
            scale=self.scale,
            center=self.center,
            slices_per_depth=self.per_depth,
            bias=self.bias,
            steps=self.steps,
        )

    @property
    def slices(self) -> int:
        """Slices of a cell."""
        return 32 * self.words

    @property
    def per_depth(self) -> float:
        """Slices for each unit of depth."""
        return self.slices / (self.far - self.near)

    def local(self, points: Array) -> Array:
        """Points along the axes."""
        found: Array = (points - self.eye) @ self.axes.T
        return found

    def place(self, local: Array) -> Array:
        """Columns and rows, fractions included."""
        found: Array = self.center + self.scale * local[..., :2] / local[..., 2:]
        return found

    def slice_of(self, depth: Array) -> NDArray[np.int64]:
        """Slices of depths, or the nearest ones."""
        return np.clip(np.floor((depth - self.near) * self.per_depth), 0, self.slices - 1).astype(np.int64)

    def width(self, local: Array, n: Array) -> Array:
        """Width of a voxel at a point along a direction, both along the axes: its box's support."""
        depth = np.maximum(local[..., 2], self.near)
        ray = np.concatenate([local[..., :2] / depth[..., None], np.ones((*depth.shape, 1))], -1)
        across = np.abs(n[..., 0]) / self.scale[0] + np.abs(n[..., 1]) / self.scale[1]
        found: Array = np.abs((n * ray).sum(-1)) / self.per_depth + depth * across
        return found


def random_grid(rng: np.random.Generator, columns: int = 24, rows: int = 17, words: int = 2) -> Grid:
    """A view into any direction, its axis off the middle."""
    single = [
        rng.normal(size=3),
        rotation(rng),
        rng.uniform(12, 20, 2),
        np.array([0.55 * columns, 0.4 * rows]),
    ]
    eye, axes, scale, center = (a.astype(np.float32).astype(np.float64) for a in single)
    return Grid(eye, axes, columns, rows, words, 0.75, 6.5, scale, center)


def unpack(grid: Grid, bits: NDArray[np.uint32]) -> Bits:
    """(rows, columns, slices) from words."""
    flags = np.unpackbits(np.ascontiguousarray(bits).view(np.uint8), bitorder="little")
    return flags.reshape(grid.rows, grid.columns, grid.slices).astype(bool)


def pack_bits(filled: Bits) -> NDArray[np.uint32]:
    """Words from (rows, columns, slices)."""
    return np.packbits(filled.reshape(-1), bitorder="little").view(np.uint32)


def blocks_of(filled: Bits) -> Bits:
    """(rows, columns, slices) of blocks: whether any cell of one or of the ring around it is filled."""
    rows, columns, slices = filled.shape
    counts = -(-rows // BLOCK), -(-columns // BLOCK)
    found = np.zeros((*counts, slices), bool)
    for r, c in itertools.product(*map(range, counts)):
        lo, hi = (max(BLOCK * r - RING, 0), max(BLOCK * c - RING, 0)), BLOCK + RING
        found[r, c] = filled[lo[0] : BLOCK * r + hi, lo[1] : BLOCK * c + hi].any(axis=(0, 1))
    return found


def packed_grid(filled: Bits) -> NDArray[np.uint32]:
    """Words of the cells, and behind them those of the blocks."""
    return np.concatenate([pack_bits(filled), pack_bits(blocks_of(filled))])


def fill(grid: Grid, triangles: Array, slack: float) -> Bits:
    """Voxels of triangles (n, 3, 3): in cells whose middle one covers, the slices of its plane.

    These go no farther than the triangle. `slack` widens triangles (in weights of their corners) and
    depths (in slices), or shrinks them below 0.
    """
    filled = np.zeros((grid.rows, grid.columns, grid.slices), bool)
    for corners in grid.local(triangles):
        if abs(np.linalg.det(corners)) < 1e-12:
            continue
        least, most = corners[:, 2].min(), corners[:, 2].max()
        # the plane along a ray of depth 1 has the depth n · corner / n · ray
        n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        offset = n @ corners[0]
        weights, depth = _at(grid, corners, n, offset, 0.5, 0.5)
        covered = (depth > 0) & (weights.min(-1) >= -slack)
        lo = hi = np.clip(depth, least, most)
        for x, y in ((0, 0), (0, 1), (1, 0), (1, 1)):
            _, depth = _at(grid, corners, n, offset, x, y)
            depth = np.clip(np.where(depth > 0, depth, most), least, most)
            lo, hi = np.minimum(lo, depth), np.maximum(hi, depth)
        first = np.floor((lo - grid.near) * grid.per_depth - slack)
        last = np.floor((hi - grid.near) * grid.per_depth + slack)
        covered &= (last >= 0) & (first < grid.slices)
        k = np.arange(grid.slices)
        filled |= covered[..., None] & (k >= np.maximum(first, 0)[..., None]) & (k <= last[..., None])
    return filled


def _at(grid: Grid, corners: Array, n: Array, offset: float, x: float, y: float) -> tuple[Array, Array]:
    """Corner weights and depth of a triangle's plane at the place (x, y) of every cell, both in [0, 1]."""
    column, row = np.meshgrid(np.arange(grid.columns) + x, np.arange(grid.rows) + y)
    place = (np.stack([column, row], -1) - grid.center) / grid.scale
    rays = np.concatenate([place, np.ones((grid.rows, grid.columns, 1))], -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = offset / (rays @ n)
        weights = (rays * depth[..., None]) @ np.linalg.inv(corners)
    return weights, depth


@dataclasses.dataclass
class Segments:
    """Start and direction along the axes, the part of t that lies in the grid, and the surfaces; n rows.

    `planes` are normal and offset of the surface at either end, (n, 2, 4).
    """

    start: Array
    along: Array
    range: Array
    planes: Array


def segments(grid: Grid, origin: Array, n: Array, point: Array, m: Array) -> Segments:
    """From receivers to samples, both ends moved off surfaces with unit normals n and m."""
    foot, tip = grid.local(origin), grid.local(point)
    n_eye, m_eye = n @ grid.axes.T, m @ grid.axes.T
    start = foot + n_eye * (grid.bias * grid.width(foot, n_eye))[:, None]
    along = tip + m_eye * (grid.bias * grid.width(tip, m_eye))[:, None] - start
    (sx, sy), (cx, cy) = grid.scale, grid.center
    planes = [
        ([0, 0, 1], -grid.near),
        ([0, 0, -1], grid.far),
        ([sx, 0, cx], 0),
        ([-sx, 0, grid.columns - cx], 0),
        ([0, sy, cy], 0),
        ([0, -sy, grid.rows - cy], 0),
    ]
    low, high = np.zeros(len(start)), np.ones(len(start))
    for normal, offset in planes:
        at, slope = start @ np.array(normal, float) + offset, along @ np.array(normal, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -at / slope
        low = np.where(slope > 0, np.maximum(low, t), low)
        high = np.where(slope < 0, np.minimum(high, t), high)
        high = np.where((slope == 0) & (at < 0), -1.0, high)
    gone = (along * (tip - foot)).sum(-1) <= 0
    ends = [np.concatenate([a, (a * p).sum(-1, keepdims=True)], -1) for a, p in ((n_eye, foot), (m_eye, tip))]
    low, high = np.where(gone, 1.0, low), np.where(gone, 0.0, high)
    return Segments(start, along, np.stack([low, high], -1), np.stack(ends, 1))


def _above(grid: Grid, planes: Array, ray: Array, z0: float, z1: float) -> tuple[float, float]:
    """The part of z0..z1 along an eye ray, of depth 1, that lies above both surfaces.

    By a voxel's width in the middle of z0..z1.
    """
    middle = 0.5 * (z0 + z1) * ray
    for plane in planes:
        slope = plane[:3] @ ray
        level = plane[3] + grid.bias * float(grid.width(middle, plane[:3]))
        if slope > 0:
            z0 = max(z0, level / slope)
        elif slope < 0:
            z1 = min(z1, level / slope)
    return z0, z1


def _full(grid: Grid, filled: Bits, place: Array, z0: float, z1: float) -> bool:
    c, r = np.clip(np.floor(place), 0, (grid.columns - 1, grid.rows - 1)).astype(int)
    first, last = grid.slice_of(np.array([z0, z1]))
    return bool(filled[r, c, first : last + 1].any())


def meets(grid: Grid, filled: Bits, s: Segments, dda: bool) -> Bits:
    """Whether each segment meets a filled voxel after it has left those that it starts in."""
    answers = np.zeros(len(s.start), bool)
    for i, (start, along, (low, high)) in enumerate(zip(s.start, s.along, s.range, strict=True)):
        if low >= high:
            continue
        far = float(np.linalg.norm(along))
        leave = LEAVE * float(grid.width(start, along / far)) / far
        if dda:
            looks = _each_voxel(grid, start, along, low, high, leave)
        else:
            looks = _equal_steps(grid, start, along, low, high, s.planes[i])
        leaving = True
        for at, place, z0, z1 in looks:
            if z0 > z1 or not _full(grid, filled, place, z0, z1):
                leaving = False
            elif not leaving or (at >= leave if dda else at > leave):
                answers[i] = True
                break
    return answers


Look = tuple[float, Array, float, float]
"""Where on the segment, which place of the grid, and from which depth to which."""


def _each_voxel(
    grid: Grid, start: Array, along: Array, low: float, high: float, leave: float
) -> Iterator[Look]:
    for a, b in itertools.pairwise(_crossings(grid, start, along, low, high, leave)):
        z0, z1 = sorted((float(start[2] + a * along[2]), float(start[2] + b * along[2])))
        yield a, grid.place(start + 0.5 * (a + b) * along), z0, z1


def _equal_steps(
    grid: Grid, start: Array, along: Array, low: float, high: float, planes: Array
) -> Iterator[Look]:
    """Steps that are equal on the image, where 1 / depth is linear."""
    ends = np.stack([start + low * along, start + high * along])
    places, near = grid.place(ends), 1 / ends[:, 2]
    cells = float(np.abs(places[1] - places[0]).max())
    wanted = max(cells, abs(ends[1, 2] - ends[0, 2]) * grid.per_depth / DEEP)
    steps = int(np.clip(np.ceil(wanted), 1, grid.steps))
    thick = np.clip(THICK * (cells / steps - 1), 0, THICKEST) / grid.per_depth
    rays = ends * near[:, None]
    for k in range(steps):
        middle = (k + 0.5) / steps
        z0, z1 = sorted(
            float(1 / (near[0] + share * (near[1] - near[0]))) for share in (k / steps, (k + 1) / steps)
        )
        if along[2] > 0:
            z1 += thick
        else:
            z0 -= thick
        z0, z1 = _above(grid, planes, rays[0] + middle * (rays[1] - rays[0]), z0, z1)
        # the middle on the image, as a share of the segment
        at = middle * near[1] / (middle * near[1] + (1 - middle) * near[0])
        yield low + at * (high - low), places[0] + middle * (places[1] - places[0]), z0, z1


def _crossings(grid: Grid, start: Array, along: Array, low: float, high: float, leave: float) -> Array:
    """Every t at which the segment crosses the side of a cell, `leave` and both ends, in order."""
    cuts = [low, high, *([leave] if low < leave < high else [])]
    for axis, count in enumerate((grid.columns, grid.rows)):
        at = grid.scale[axis] * start[axis] + grid.center[axis] * start[2]
        slope = grid.scale[axis] * along[axis] + grid.center[axis] * along[2]
        for side in range(count + 1):
            steep = slope - side * along[2]
            t = (side * start[2] - at) / steep if steep else np.inf
            if low < t < high:
                cuts.append(float(t))
    return np.array(sorted(cuts))
