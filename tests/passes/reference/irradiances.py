"""Pixels about a light in tiles of one kind each, and how `irradiance` is run on them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer
from .image import tile_order
from .lights import Area, Light, Spot, single
from .run import Runner, read
from .structs import IRRADIANCE, NOTHING, SURFACE, record

Array = NDArray[np.float64]

FACING, ON_SURFACE, CLIPPED, NEAR, FAR, LIT, DARK = 1, 2, 16, 32, 64, 256, 512
NONE, CELL_LIT, CELL_DARK, CELL_ZONE = range(4)
KINDS = ("near", "far", "clipped", "any_kind")
MOST_ROWS = 64
NO_TILE = 0xFFFFFFFF


@dataclasses.dataclass
class Scene:
    """An image of pixels about a light, with what the passes before have found out of it."""

    light: Light
    size: tuple[int, int]
    gbuffer: GBuffer
    flags: NDArray[np.uint32]
    cells: NDArray[np.uint32]
    share: NDArray[np.float32]

    @property
    def tile_of(self) -> NDArray[np.int64]:
        """Tile of each pixel, in image order."""
        x, y = np.meshgrid(np.arange(self.size[0]), np.arange(self.size[1]))
        return np.asarray((y // 8) * (-(-self.size[0] // 8)) + x // 8).ravel()

    @property
    def cell_of(self) -> NDArray[np.int64]:
        """Cell of each pixel, in image order."""
        x, y = np.meshgrid(np.arange(self.size[0]), np.arange(self.size[1]))
        return np.asarray((y // 2) * (-(-self.size[0] // 2)) + x // 2).ravel()

    @property
    def seen(self) -> Array:
        """Share a pixel, (n, 3)."""
        state, flags = self.cells[self.cell_of] & 3, self.flags[self.tile_of]
        share = np.where((state == CELL_ZONE)[:, None], self.share[:, :3], (state == CELL_LIT)[:, None] * 1.0)
        share[(flags & DARK) != 0] = 0
        share[(flags & LIT) != 0] = 1
        return share


def corners_from(light: Area, positions: Array) -> Array:
    """The light's corners as seen from (n, 3) positions, (n, 4, 3)."""
    ab = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)])
    return np.asarray(light.point(ab)[None] - positions[:, None])


def pixel_flags(light: Area, g: GBuffer) -> NDArray[np.uint32]:
    """What each pixel alone would make of its tile's flags."""
    corners = corners_from(light, g.position)
    heights = np.stack([np.einsum("ncx,nx->nc", corners, n) for n in (g.normal, g.geometric)])
    emits = light.two_sided | (corners[:, 0] @ light.normal < 0)
    surface = g.kind == SURFACE
    facing = surface & emits & (heights > 0).any(axis=2).all(axis=0)
    size = max(np.linalg.norm(light.u), np.linalg.norm(light.v))
    far = np.linalg.norm(corners.mean(axis=1), axis=1) > 5 * size
    cut = (heights < 0).any(axis=(0, 2))
    flags = surface * ON_SURFACE | facing * (FACING | cut * CLIPPED | np.where(far, FAR, NEAR))
    return flags.astype(np.uint32)


def pool(rng: np.random.Generator, light: Area, count: int) -> GBuffer:
    """Surfaces from contact to 10⁴ sizes away, anywhere about a light, many of them turned to it."""
    size = max(np.linalg.norm(light.u), np.linalg.norm(light.v))
    out = rng.normal(size=(count, 3))
    out *= (size * 10 ** rng.uniform(-3, 4, count) / np.linalg.norm(out, axis=1))[:, None]
    aim = light.point(rng.uniform(size=(count, 2)))
    position = single(aim + out)
    toward = -out / np.linalg.norm(out, axis=1, keepdims=True)
    normals = rng.normal(size=(2, count, 3))
    normals[0] = (
        normals[0] / np.linalg.norm(normals[0], axis=1, keepdims=True)
        + rng.choice([0, 1.5], (count, 1)) * toward
    )
    # flat, shaded smoothly, and smooth where the surface is all but flat
    normals[1] = normals[0] + rng.choice([0, 0.3, 1e-7], (count, 1)) * normals[1]
    normals = single(normals / np.linalg.norm(normals, axis=-1, keepdims=True))
    kind = np.where(rng.uniform(size=count) < 0.95, SURFACE, NOTHING)
    return GBuffer(position, np.full(count, 1e-6), normals[0], normals[1], kind)


def scene(rng: np.random.Generator, light: Area, size: tuple[int, int] = (150, 92)) -> Scene:
    """Tiles of each kind, of several, and of pixels that do not face the light."""
    g = pool(rng, light, 60_000)
    own = pixel_flags(light, g)
    need = own & (FACING | CLIPPED | NEAR | FAR)
    away = np.flatnonzero((own & FACING) == 0)
    groups = [np.flatnonzero(need == (FACING | k)) for k in (NEAR, FAR, NEAR | CLIPPED, FAR | CLIPPED)]
    groups += [np.arange(len(need)), away]
    tile = tile_order(*size)
    chosen = np.zeros(size[0] * size[1], int)
    for t in range(len(tile) // 64):
        x, y = tile[64 * t : 64 * t + 64].T
        inside = (x < size[0]) & (y < size[1])
        members = groups[t % 6]
        picked = np.where(rng.uniform(size=64) < 0.9, rng.choice(members, 64), rng.choice(away, 64))
        chosen[(y * size[0] + x)[inside]] = picked[inside]
    made = GBuffer(*(getattr(g, f.name)[chosen] for f in dataclasses.fields(GBuffer)))
    return classed(rng, light, size, made, own[chosen])


def classed(
    rng: np.random.Generator, light: Light, size: tuple[int, int], g: GBuffer, own: NDArray[np.uint32]
) -> Scene:
    """Flags of tiles from those of their pixels, and random classes and shares."""
    tiles = -(-size[0] // 8) * -(-size[1] // 8)
    cells = rng.integers(0, 4, -(-size[0] // 2) * -(-size[1] // 2)).astype(np.uint32)
    share = rng.uniform(size=(len(own), 4)).astype(np.float32)
    made = Scene(light, size, g, np.zeros(tiles, np.uint32), cells, share)
    np.bitwise_or.at(made.flags, made.tile_of, own)
    proven = rng.uniform(size=tiles)
    made.flags |= np.where(proven < 0.3, LIT, np.where(proven < 0.4, DARK, 0)).astype(np.uint32)
    # the upper bits of a cell's word are somebody else's
    made.cells |= rng.integers(0, 2**30, len(cells)).astype(np.uint32) << np.uint32(2)
    return made


def params(scene: Scene, **more: int) -> NDArray[Any]:
    """The light in its own axes."""
    light, (width, height) = scene.light, scene.size
    common = {"width": width, "height": height, "tiles": len(scene.flags), **more}
    if isinstance(light, Spot):
        x = np.cross(light.axis, np.eye(3)[np.abs(light.axis).argmin()])
        x /= np.linalg.norm(x)
        return record(
            IRRADIANCE, corner=light.position, axis_x=x, axis_y=np.cross(light.axis, x), axis_z=light.axis,
            two_sided=1, radiance=light.intensity, size=1, cos_cutoff=light.cos_cutoff, **common,
        )  # fmt: skip
    lengths = np.linalg.norm([light.u, light.v], axis=1)
    x = light.u / lengths[0]
    y = np.cross(light.normal, x)
    across = np.array([light.v @ x, light.v @ y])
    return record(
        IRRADIANCE, corner=light.corner, axis_x=x, axis_y=y, axis_z=light.normal, two_sided=light.two_sided,
        radiance=light.mean, edge=np.array([lengths[0], *across, lengths[1]]) / lengths.max(),
        along_v=across / lengths[1], size=lengths.max(), cos_cutoff=-2, **common,
    )  # fmt: skip


def sort(runner: Runner, scene: Scene) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Lists of tiles by kind, (4, tiles + 64), and their dispatch arguments, (8, 4)."""
    tiles = len(scene.flags)
    out = runner(
        "passes/gather/irradiance", 1, entry="sort", groups=True, params=params(scene),
        tile_flags=scene.flags, tile_lists=np.zeros(4 * (tiles + MOST_ROWS), np.uint32), arguments=np.zeros(32, np.uint32),
    )  # fmt: skip
    return read(out, "tile_lists", np.uint32, 4, tiles + MOST_ROWS), read(out, "arguments", np.uint32, 8, 4)


def shared_inputs(scene: Scene, lists: NDArray[np.uint32], **more: int) -> dict[str, NDArray[Any]]:
    """What `common/light_pixel.wgsl` binds."""
    return {
        "params": params(scene, **more), "tile_flags": scene.flags, "cell_state": scene.cells,
        "tile_list": lists, **scene.gbuffer.rows(),
    }  # fmt: skip


def irradiance(
    runner: Runner,
    scene: Scene,
    before: NDArray[np.float32],
    textured: int = 0,
    share: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """The whole pass: sorted, then each kind; (n, 4)."""
    lists, arguments = sort(runner, scene)
    entries = ("spot",) if isinstance(scene.light, Spot) else KINDS
    sums = before
    for kind, entry in enumerate(entries):
        if arguments[kind, 3] == 0:
            continue
        # one workgroup more than there are tiles: the end of a folded dispatch
        groups = int(arguments[kind, 3]) + 1
        out = runner(
            "passes/gather/irradiance", groups, entry=entry, groups=True, direct_irradiance=sums,
            share=scene.share if share is None else share,
            **shared_inputs(scene, lists, kind=kind, textured=textured),
        )  # fmt: skip
        sums = read(out, "direct_irradiance", np.float32, -1, 4)
    return sums
