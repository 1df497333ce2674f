"""`gather_rays`: stratified cosine-weighted rays from the pixels' hemispheres, each worth π/N [WRC88]."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, random_gbuffer
from tests.passes.reference.hashing import random4
from tests.passes.reference.hemisphere import concentric, cosine_directions
from tests.passes.reference.image import pixel_numbers
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import GATHER_PATH, GATHER_WAVE, MISS, RAY, SURFACE, record

# Directions this close to the geometric horizon may be on either side of it.
EDGE_ON = 1e-5


def _run(runner: Runner, g: GBuffer, wave: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rays and paths, each (tiles, strata, 64)."""
    shape = (int(wave["tiles"][0]), int(wave["strata"][0]), 64)
    count = int(np.prod(shape))
    out = runner(
        "passes/indirect/gather_rays",
        count,
        wave=wave,
        rays=np.zeros(count, RAY),
        paths=np.zeros(count, GATHER_PATH),
        **g.rows(),
    )
    return read(out, "rays", RAY, *shape), read(out, "paths", GATHER_PATH, *shape)


def _wave(size: tuple[int, int], grid: tuple[int, int], **part: int) -> NDArray[Any]:
    tiles = len(pixel_numbers(*size)) // 64
    values = {"tiles": tiles, "strata": grid[0] * grid[1], "seed": 9, **part}
    return record(GATHER_WAVE, width=size[0], height=size[1], strata_u=grid[0], strata_v=grid[1], **values)


@pytest.mark.parametrize("size", [(33, 21), (1, 9), (5, 1)])
@pytest.mark.parametrize("grid", [(1, 1), (4, 4), (5, 3), (16, 16)])
def test_rays_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], grid: tuple[int, int]
) -> None:
    g = random_gbuffer(rng, size[0] * size[1])
    wave = _wave(size, grid)
    rays, paths = _run(runner, g, wave)
    pixels = np.broadcast_to(pixel_numbers(*size).reshape(-1, 1, 64), rays.shape)
    strata = np.broadcast_to(np.arange(grid[0] * grid[1])[:, None], rays.shape)
    assert (paths["stratum"] == strata).all()
    seen = (pixels >= 0) & (g.kind[pixels] == SURFACE)
    at, k = pixels[seen], strata[seen]
    square = (np.stack([k % grid[0], k // grid[0]], axis=-1) + random4(at, k, 0, 9)[:, :2]) / np.array(grid)
    expected = cosine_directions(g.normal[at], square)
    above = (expected * g.geometric[at]).sum(axis=1)
    clear = np.abs(above) > EDGE_ON
    up = clear & (above > 0)
    made = rays[seen]

    height = np.sqrt(np.clip(1 - (concentric(square) ** 2).sum(axis=1), 0, None))
    bound = (1e-6 + 4e-7 / np.maximum(height, 4e-4))[:, None]
    assert_within(made["direction"][up], expected[up], bound[up], "directions")
    assert_not_within(made["direction"][up], cosine_directions(g.geometric[at], square)[up], bound[up])
    assert_within(made["origin"][up], g.origin[at][up], 2 * ULP * np.abs(g.origin[at][up]), "origins")
    assert (made["t_min"][up] == 0).all()
    assert (made["t_max"][up] > 1e38).all()
    assert (paths["pixel"][seen][up] == at[up]).all()
    worth = np.pi / (grid[0] * grid[1])
    assert_within(paths["throughput"][seen][up], np.full((up.sum(), 3), worth), 2 * ULP * worth, "worth")

    none = ~seen
    none[seen] = clear & (above < 0)
    assert (rays["t_max"][none] < rays["t_min"][none]).all(), "inactive where nothing is seen or below"
    assert (paths["pixel"][none] == MISS).all()
    assert (paths["throughput"][none] == 0).all()
    assert (paths["pending"] == 0).all()


def test_waves_are_parts_of_the_whole(runner: Runner, rng: np.random.Generator) -> None:
    """A wave of some tiles and some strata has the very rays of the whole hemisphere."""
    size, grid = (30, 20), (6, 5)
    g = random_gbuffer(rng, 600)
    rays, paths = _run(runner, g, _wave(size, grid))
    for first_tile, tiles, first_stratum, strata in ((0, 2, 0, 30), (3, 4, 7, 11), (11, 1, 29, 1)):
        part = _wave(
            size, grid, first_tile=first_tile, tiles=tiles, first_stratum=first_stratum, strata=strata
        )
        some, states = _run(runner, g, part)
        window = np.s_[first_tile : first_tile + tiles, first_stratum : first_stratum + strata]
        assert (some == rays[window]).all()
        assert (states == paths[window]).all()


def test_a_white_sky_gives_every_flat_surface_pi(runner: Runner, rng: np.random.Generator) -> None:
    """Where both normals agree nothing is lost: the rays' worth adds up to ∫ cosθ dω = π."""
    g = random_gbuffer(rng, 256, tilt=0.0, surfaces=2.0)
    _, paths = _run(runner, g, _wave((16, 16), (8, 8)))
    total = np.zeros(256)
    np.add.at(total, paths["pixel"].ravel(), paths["throughput"][..., 0].astype(np.float64).ravel())
    assert_within(total, np.full(256, np.pi), 1e-5, "sums")
    tilted = random_gbuffer(rng, 256, tilt=0.5, surfaces=2.0)
    _, paths = _run(runner, tilted, _wave((16, 16), (8, 8)))
    assert (paths["pixel"] == MISS).any(), "tilted shading normals lose what lies below the surface"


def test_pixels_and_seeds_have_their_own_jitter(runner: Runner, rng: np.random.Generator) -> None:
    g = random_gbuffer(rng, 64, tilt=0.0, surfaces=2.0)
    g.normal[:] = g.geometric[:] = (0, 0, 1)
    first, _ = _run(runner, g, _wave((8, 8), (4, 4)))
    second, _ = _run(runner, g, _wave((8, 8), (4, 4), seed=10))
    assert len(np.unique(first["direction"].reshape(-1, 3), axis=0)) == 1024
    assert not (first["direction"] == second["direction"]).all(axis=-1).any()
