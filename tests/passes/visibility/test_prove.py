"""`prove` in its WGSL form: tiles proven lit or dark, against rays and separating planes in float64."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import LIGHT_FRAME, PROVE, TILE_BOUNDS, bits, record, row
from tests.passes.reference.trees import Object, meet, random_objects, trees

Array = NDArray[np.float64]
FACING, BACK, MIXED, LIT, DARK = 1, 4, 8, 256, 512
WIDE, HIGH = 9, 7
END = 0.9999


@dataclasses.dataclass
class Light:
    """The parallelogram corner + a u + b v; a spot has no edges."""

    corner: Array
    u: Array
    v: Array
    normal: Array
    two_sided: bool = False

    @property
    def points(self) -> Array:
        """Corners."""
        return self.corner + np.array([0 * self.u, self.u, self.u + self.v, self.v])

    @property
    def rows(self) -> Array:
        """Rows that take q = p − corner to a, b, h."""
        if not self.u.any():
            x = np.cross(self.normal, [0.3, 0.2, 1.0])
            x /= np.linalg.norm(x)
            return np.array([x, np.cross(self.normal, x), self.normal])
        return np.linalg.inv(np.column_stack([self.u, self.v, self.normal]))


def _lights() -> dict[str, Light]:
    down = np.array([0.0, -1.0, 0.0])
    u, v = np.array([1.0, 0.4, 0.2]), np.array([-0.3, 0.1, 1.2])
    n = np.cross(v, u)
    return {
        "ceiling": Light(np.array([-0.5, 4.0, -0.5]), np.eye(3)[0], np.eye(3)[2], down),
        "slanted": Light(np.array([0.5, 2.0, -0.5]), u, v, n / np.linalg.norm(n), True),
        "spot": Light(np.array([0.2, 3.5, 0.1]), np.zeros(3), np.zeros(3), down),
    }


@dataclasses.dataclass
class Tiles:
    """Flat patches that float in the scene, one a tile: ray origins (tiles, 64, 3) and what they face."""

    origin: Array
    normal: Array
    facing: NDArray[np.bool_]
    place: Array
    flags: NDArray[np.uint32]


def _tiles(rng: np.random.Generator, light: Light) -> Tiles:
    """Random patches; normals lean towards the light."""
    count = WIDE * HIGH
    middle = rng.uniform((-3, -3, -3), (3, 2, 3), (count, 3))
    to_light = light.points.mean(0) - middle
    normal = to_light / np.linalg.norm(to_light, axis=1, keepdims=True) + rng.normal(size=(count, 3)) * 0.4
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross(normal, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(normal, across)
    j, i = np.divmod(np.arange(64), 8)
    step = rng.uniform(0.005, 0.05, (count, 1, 1))
    across, up = (i - 3.5)[:, None] * across[:, None], (j - 3.5)[:, None] * up[:, None]
    origin = middle[:, None] + step * (across + up)
    origin = origin.astype(np.float32).astype(np.float64)
    normal = normal.astype(np.float32).astype(np.float64)
    place = (origin - light.corner) @ light.rows.T
    top = ((light.points[None, None] - origin[:, :, None]) * normal[:, None, None]).sum(-1).max(-1)
    facing = (top > 0) & ((place[..., 2] > 0) | light.two_sided)
    back = facing & (place[..., 2] < 0)
    flags = np.where(facing.any(1), FACING, 0) | np.where(back.any(1), BACK, 0)
    flags |= np.where(back.any(1) & (facing & ~back).any(1), MIXED, 0)
    return Tiles(origin, normal, facing, place, flags.astype(np.uint32))


def _run(runner: Runner, light: Light, tiles: Tiles, objects: list[Object]) -> NDArray[np.uint32]:
    """Flags afterwards."""
    bounds = np.zeros(len(tiles.flags), TILE_BOUNDS)
    place = tiles.place.copy()
    place[(tiles.flags & BACK) != 0, :, 2] *= -1
    masked = np.where(tiles.facing[..., None], place, np.nan)
    some = tiles.facing.any(1)
    bounds["lo"][some], bounds["hi"][some] = np.nanmin(masked[some], 1), np.nanmax(masked[some], 1)
    bounds["facing"] = tiles.facing.sum(1)
    tile, within = np.divmod(np.arange(64 * len(tiles.flags)), 64)
    at = (tile // WIDE * 8 + within // 8) * WIDE * 8 + tile % WIDE * 8 + within % 8
    rows = np.zeros((2, len(at), 4), np.uint32)
    rows[0, at] = row(tiles.origin.reshape(-1, 3), bits(np.zeros(len(at))))
    rows[1, at] = row(np.repeat(tiles.normal, 64, axis=0), 7)
    extent = 1.0 if light.u.any() else 0.0
    frame = record(
        LIGHT_FRAME,
        corner=light.corner,
        dual_u=light.rows[0],
        dual_v=light.rows[1],
        normal=light.normal,
        extent_a=extent,
        extent_b=extent,
        two_sided=light.two_sided,
    )
    out = runner(
        "passes/visibility/prove",
        64 * len(tiles.flags),
        params=record(PROVE, width=8 * WIDE, height=8 * HIGH),
        frame=frame,
        tile_bounds=bounds,
        tile_flags=tiles.flags,
        g_position=rows[0],
        g_geometric=rows[1],
        **trees(objects),
    )
    return read(out, "tile_flags", np.uint32)


def _rays(
    rng: np.random.Generator, light: Light, tiles: Tiles, objects: list[Object]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of some rays of each tile: blocked for sure, free for sure; (tiles, rays)."""
    count, rays = len(tiles.flags), 96
    ab = rng.uniform(size=(count, rays, 2))
    ab[:, :32] = np.round(ab[:, :32])
    target = light.corner + ab[..., :1] * light.u + ab[..., 1:] * light.v
    pixel = np.array([rng.choice(np.flatnonzero(f) if f.any() else [0], rays) for f in tiles.facing])
    origin = np.take_along_axis(tiles.origin, pixel[..., None], axis=1)
    d = target - origin
    end = np.full(count * rays, END)
    met = meet(objects, origin.reshape(-1, 3), d.reshape(-1, 3), np.zeros(count * rays), end)
    sure = ~met.doubtful.reshape(count, rays) & ((d * tiles.normal[:, None]).sum(-1) > 1e-4)
    hit = met.hit.reshape(count, rays)
    return hit & sure, ~hit & sure


def _separated(light: Light, tiles: Tiles, objects: list[Object], margin: float) -> NDArray[np.bool_]:
    """Tiles of which every pixel has a plane, by `margin`, between each triangle and its way to the light."""
    clear = np.ones(tiles.facing.shape, bool)
    turn = np.where((tiles.flags & BACK) != 0, -1.0, 1.0)[:, None]
    a, b, h = np.moveaxis(tiles.place, -1, 0)
    h = h * turn
    extent = 1.0 if light.u.any() else 0.0
    for corners in np.concatenate([thing.placed() for thing in objects]):
        n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        n /= np.linalg.norm(n)
        here, there = (tiles.origin - corners[0]) @ n, (light.points - corners[0]) @ n
        plane = (np.minimum(here, there.min()) > margin) | (np.maximum(here, there.max()) < -margin)
        over = ((corners[:, None, None] - tiles.origin) * tiles.normal[:, None]).sum(-1)
        t = (corners - light.corner) @ light.rows.T
        t_h = t[:, 2][:, None, None] * turn
        left = [t[:, k][:, None, None] * h - x * t_h for k, x in ((0, a), (1, b))]
        beside = [np.maximum(x.max(0) + margin, 0) == 0 for x in left]
        beside += [(extent * (h - t_h) - x).max(0) < -margin for x in left]
        outside = (t_h.min(0) > h + margin) | (t_h.max(0) < (1 - END) * h - margin)
        clear &= plane | (over.max(0) < -margin) | outside | np.logical_or.reduce(beside)
    return np.asarray((clear | ~tiles.facing).all(axis=1))


def _scene(rng: np.random.Generator) -> list[Object]:
    """Loose triangles in every kind of transform, and one large one that hides much."""
    large = Object(np.array([[[-9, 0, -9], [9, 0, -9], [0, 0, 14]]], np.float32), np.eye(3), np.zeros(3))
    large.center = np.array([0.0, 0.25, 6.0])
    return [*random_objects(rng, 4, 4), large]


@pytest.mark.parametrize("name", ["ceiling", "slanted", "spot"])
def test_proofs_hold_and_are_found(runner: Runner, rng: np.random.Generator, name: str) -> None:
    light, totals = _lights()[name], np.zeros(4, int)
    for _ in range(4):
        tiles, objects = _tiles(rng, light), _scene(rng)
        flags = _run(runner, light, tiles, objects)
        assert (flags & 255 == tiles.flags).all(), "other flags stay"
        lit, dark = (flags & LIT) != 0, (flags & DARK) != 0
        open_tiles = (tiles.flags & (FACING | MIXED)) == FACING
        assert not (lit | dark)[~open_tiles].any()
        assert not (lit & dark).any()
        blocked, free = _rays(rng, light, tiles, objects)
        assert not blocked[lit].any(), "a lit tile has a blocked ray"
        assert not free[dark].any(), "a dark tile has a free ray"
        expected = open_tiles & _separated(light, tiles, objects, 1e-3)
        assert lit[expected].all(), "a separated tile is not proven"
        totals += lit.sum(), dark.sum(), expected.sum(), (open_tiles & ~lit & ~dark).sum()
        # Negative control: the rays tell lit tiles from others.
        assert blocked[open_tiles & ~lit].any()
    assert (totals[:3] > 10).all(), f"lit, dark, separated and open tiles: {totals}"


def test_one_triangle_undoes_a_proof(runner: Runner, rng: np.random.Generator) -> None:
    """Negative control: without triangles all is lit; a sliver over one tile leaves that one open."""
    light = _lights()["ceiling"]
    tiles = _tiles(rng, light)
    assert ((_run(runner, light, tiles, []) & LIT != 0) == ((tiles.flags & FACING) != 0)).all()
    index = int(np.flatnonzero(tiles.facing.all(1))[0])
    middle = 0.5 * (tiles.origin[index].mean(0) + light.points.mean(0))
    sliver = (middle + np.array([[[-0.01, 0, 0], [0.01, 0, 0], [0, 0, 0.002]]])).astype(np.float32)
    flags = _run(runner, light, tiles, [Object(sliver, np.eye(3), np.zeros(3))])
    assert flags[index] & (LIT | DARK) == 0
    assert (flags & LIT != 0).sum() > 10
