"""Virtual lights of reflective shadow maps in float64, texel by texel."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rsm import FAR
from .structs import VIRTUAL_LIGHT

Array = NDArray[np.float64]


def random_texels(rng: np.random.Generator, maps: int, resolution: int, dark: float = 0.3) -> Array:
    """Rows of texels (maps, row, column, 3, 4) of a bumpy ground; some see nothing or black."""
    shape = (maps, resolution, resolution)
    made = np.zeros((*shape, 3, 4))
    place = (np.arange(resolution) + 0.5) / resolution * 2 - 1
    made[..., 0, 0], made[..., 0, 1] = place, place[:, None]
    made[..., 0, 2] = -1 + 0.1 * rng.normal(size=shape)
    made[..., 0, :3] *= 1 + rng.uniform(0, 0.5, (maps, 1, 1, 1))
    made[..., 0, 3] = np.linalg.norm(made[..., 0, :3], axis=-1)
    normals = np.array([0, 0, 1]) + 0.4 * rng.normal(size=(*shape, 3))
    made[..., 1, :3] = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    made[..., 1, 3] = rng.uniform(0.5, 1, shape) / resolution**2
    made[..., 2, :3] = rng.uniform(0.01, 1, (*shape, 3)) ** 3 / resolution**2
    made[..., 2, 3] = 4 * rng.uniform(0.5, 2, shape) / resolution**2
    black = rng.uniform(size=shape) < dark
    made[black, 2, :3] = 0
    nothing = rng.uniform(size=shape) < dark
    made[nothing] = 0
    made[nothing, 0, 3] = FAR
    made[nothing, 1, 3] = 0.7 / resolution**2
    rounded: Array = made.astype(np.float32).astype(np.float64)
    return rounded


def block_light(block: Array, number: int, place: tuple[int, int]) -> NDArray[Any]:
    """The light of a block (rows, columns, 3, 4) of map `number` whose first column and row are `place`."""
    height, width = block.shape[:2]
    light = np.zeros((), WIDE)
    light["flux"], light["area"] = block[..., 2, :3].sum((0, 1)), block[..., 2, 3].sum()
    light["solid_angle"] = block[..., 1, 3].sum()
    light["normal"] = 0, 0, 1
    light["block"] = place[0] | place[1] << 16
    light["extent"] = (width if width == height else 0) | number << 16
    lit = block[..., 2, :3].sum(-1) > 0
    if not lit.any():
        return light
    y, x = np.indices(lit.shape)
    off = (2 * x + 1 - width) ** 2 + (2 * y + 1 - height) ** 2
    chosen = np.unravel_index(np.where(lit, off, 1 << 30).argmin(), lit.shape)
    light["position"], light["normal"] = block[chosen][0, :3], block[chosen][1, :3]
    texels = block[lit]
    away, diagonal = texels[:, 0, :3] - light["position"], np.sqrt(texels[:, 2, 3] / 2)
    turned = np.linalg.norm(texels[:, 1, :3] - light["normal"], axis=1)
    light["radius"] = (np.linalg.norm(away, axis=1) + diagonal).max()
    light["spread"] = turned.max()
    light["thickness"] = min((np.abs(away @ light["normal"]) + diagonal * turned).max(), light["radius"])
    return light


def grid_lights(texels: Array, across: int, first_map: int = 0) -> NDArray[Any]:
    """All lights of a grid of `across` × `across` over each map of `texels` (maps, row, column, 3, 4)."""
    edges = np.arange(across + 1) * texels.shape[1] // across
    lights = [
        block_light(map_[y0:y1, x0:x1], first_map + number, (int(x0), int(y0)))
        for number, map_ in enumerate(texels)
        for y0, y1 in pairwise(edges)
        for x0, x1 in pairwise(edges)
    ]
    return np.stack(lights)


WIDE = np.dtype(
    [
        (name, "<f8" if d[0].base.kind == "f" else "<u4", d[0].shape)
        for name, d in VIRTUAL_LIGHT.fields.items()
    ]
)
"""`VIRTUAL_LIGHT` with float64."""
