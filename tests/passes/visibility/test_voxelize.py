"""`voxelize`: which voxels triangles of any size fill, against clipped polygons in float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import rotation
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import VOXELIZE, record
from tests.passes.reference.surfaces import Placed, pack
from tests.passes.reference.voxels import Bits, Grid, fill, random_grid, unpack

BLOCK = 256
SLACK = 2e-3
"""Weights and slices within which rounding may decide."""


def _mesh(rng: np.random.Generator, grid: Grid, sizes: NDArray[np.float64]) -> Placed:
    """Triangles all over the view and around it, in a space of their own."""
    count = len(sizes)
    local = rng.uniform((-3, -3, -1.5), (3, 3, 8), (count, 3))
    corners = local[:, None] + sizes[:, None, None] * rng.normal(size=(count, 3, 3))
    scene = corners @ grid.axes + grid.eye
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(rng) * rng.uniform(0.3, 3)
    matrix[:3, 3] = rng.normal(size=3)
    own = (scene.reshape(-1, 3) - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    return Placed(own, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3), matrix, np.ones(3))


def _triangles(meshes: list[Placed]) -> NDArray[np.float64]:
    """All corners in scene space, from what the shader is given."""
    parts = []
    for mesh in meshes:
        points = mesh.positions @ mesh.scene_from_object[:3, :3].T + mesh.scene_from_object[:3, 3]
        parts.append(points[mesh.triangles])
    return np.concatenate(parts)


def _run(runner: Runner, grid: Grid, meshes: list[Placed], first: int = 0, count: int | None = None) -> Bits:
    sizes = [len(mesh.triangles) for mesh in meshes]
    count = sum(sizes) - first if count is None else count
    blocks = -(-count // BLOCK)
    params = record(VOXELIZE, first=first, triangles=count, instances=len(meshes), blocks=blocks)
    packed = pack(meshes)
    common = {
        "geometry": packed["geometry"],
        "instances": packed["instances"],
        "first_triangles": np.cumsum([0, *sizes[:-1]]).astype(np.uint32),
        "params": params,
        "voxels": grid.packed(),
    }
    lists = {
        "before": np.zeros(count, np.uint32),
        "totals": np.zeros(blocks + 1, np.uint32),
        "bits": np.zeros(grid.columns * grid.rows * grid.words, np.uint32),
    }
    stem = "passes/visibility/voxelize"
    out = runner(stem, count, entry="count", **common, **lists)
    scanned = runner(
        stem,
        1,
        entry="scan",
        groups=True,
        params=params,
        totals=out["totals"].view(np.uint32),
        arguments=np.zeros(4, np.uint32),
    )
    totals = read(scanned, "totals", np.uint32)
    assert (np.diff(totals.astype(np.int64)) >= 0).all()
    x, y, z = read(scanned, "arguments", np.uint32)[:3]
    assert x * y * z >= totals[-1]
    before = {"before": out["before"].view(np.uint32), "totals": totals, "bits": out["bits"].view(np.uint32)}
    if totals[-1] == 0:
        return unpack(grid, before["bits"])
    out = runner(stem, int(totals[-1]), entry="fill", groups=True, **common, **before)
    return unpack(grid, read(out, "bits", np.uint32))


@pytest.mark.parametrize("size", [0.03, 0.1, 0.5, 4.0, 60.0])
def test_triangles_of_any_size_fill_what_the_reference_says(
    runner: Runner, rng: np.random.Generator, size: float
) -> None:
    grid = random_grid(rng)
    count = 700 if size < 0.2 else 30
    meshes = [_mesh(rng, grid, size * rng.uniform(0.3, 1, n)) for n in (count, 1, count // 3)]
    found = _run(runner, grid, meshes)
    triangles = _triangles(meshes)
    least, most = fill(grid, triangles, -SLACK), fill(grid, triangles, SLACK)
    assert not (least & ~found).any()
    assert not (found & ~most).any()
    assert least.sum() >= 0.8 * most.sum()
    assert 0 < found.sum() < found.size
    # Negative control: bits one slice or one cell farther are others.
    for axis in range(3):
        assert (least & ~np.roll(found, 1, axis)).any()


def test_a_batch_leaves_out_the_triangles_before_it(runner: Runner, rng: np.random.Generator) -> None:
    grid = random_grid(rng)
    meshes = [_mesh(rng, grid, rng.uniform(0.02, 3, n)) for n in (300, 5, 260)]
    whole = _run(runner, grid, meshes)
    parts = [_run(runner, grid, meshes, first, count) for first, count in ((0, 302), (302, 263))]
    assert (whole == parts[0] | parts[1]).all()
    assert (whole != parts[0]).any()


def test_a_wall_before_the_camera_is_closed(runner: Runner, rng: np.random.Generator) -> None:
    """Two triangles over the whole view, cut by the near plane at no place: one slice in each cell."""
    grid = random_grid(rng, 70, 50, 4)
    depth = 3.0
    corners = depth * np.array([(-5, -5, 1), (5, -5, 1), (5, 5, 1), (-5, 5, 1)], float)
    mesh = Placed(
        corners @ grid.axes + grid.eye, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.eye(4), np.ones(3)
    )
    found = _run(runner, grid, [mesh])
    assert found.any(2).all()
    assert found.sum(2).max() <= 2
    near = np.argmax(found, 2) - (depth - grid.near) * grid.per_depth
    assert (np.abs(near) <= 1.01).all()


def test_a_floor_that_passes_under_the_camera_is_closed(runner: Runner, rng: np.random.Generator) -> None:
    """From behind the eye to beyond the last slice: in each cell that sees it, what it runs through."""
    grid = random_grid(rng, 64, 64, 4)
    corners = np.array([(-90, 1, -90), (90, 1, -90), (90, 1, 90), (-90, 1, 90)], float)
    mesh = Placed(
        corners @ grid.axes + grid.eye, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.eye(4), np.ones(3)
    )
    found = _run(runner, grid, [mesh])
    rows = np.arange(grid.rows) + 0.5
    depth = grid.scale[1] / np.maximum(rows - grid.center[1], 1e-9)
    sees = (depth > grid.near * 1.05) & (depth < grid.far * 0.95)
    assert sees.sum() > 10
    assert found[sees].any(2).all()
    # Neighbouring rows meet: no slice between them is left out.
    first, last = np.argmax(found[sees], 2), grid.slices - 1 - np.argmax(found[sees][..., ::-1], 2)
    assert (last[1:] >= first[:-1] - 1).all()
    assert (np.abs(last[1:] - first[:-1]) <= 1).all()


def test_five_runs_give_the_same_bits(runner: Runner, rng: np.random.Generator) -> None:
    grid = random_grid(rng)
    meshes = [_mesh(rng, grid, rng.uniform(0.02, 3, 400))]
    first = _run(runner, grid, meshes)
    assert all((_run(runner, grid, meshes) == first).all() for _ in range(4))
