"""`gbuffer`: from the hits of primary rays to position, normals, albedo and what is seen, in image order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.image import pixel_numbers, random_view, tile_order, view_directions
from tests.passes.reference.lights import random_area
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import FIRST_LIGHT, MISS, NOTHING, SURFACE, floats
from tests.passes.reference.surfaces import (
    ORIGIN_ERROR,
    Placed,
    Surface,
    light_quad,
    pack,
    random_hits,
    random_mesh,
    surfaces,
)

ROWS = ("g_position", "g_normal", "g_geometric", "g_albedo")
# Hits whose normal is this close to a right angle with the ray may be turned either way.
EDGE_ON = 1e-4


def _run(
    runner: Runner, view: NDArray[Any], hits: NDArray[Any], meshes: list[Placed]
) -> dict[str, NDArray[np.uint32]]:
    pixels = int(view["width"][0]) * int(view["height"][0])
    # a pattern that shows what was not written
    rows = {name: np.full((pixels, 4), 0xABABABAB, np.uint32) for name in ROWS}
    out = runner("passes/geometry/gbuffer", len(hits), view=view, hits=hits, **pack(meshes), **rows)
    return {name: read(out, name, np.uint32, pixels, 4) for name in ROWS}


def _scene(rng: np.random.Generator) -> list[Placed]:
    plain = {"uvs": None, "texture": None, "colors": None}
    return [
        random_mesh(rng, "rigid"),
        random_mesh(rng, "mirrored"),
        random_mesh(rng, "stretched", colors=None),
        random_mesh(rng, "far", **plain),
        random_mesh(rng, "rigid", smooth=False, normals=None, colors=None),
        random_mesh(rng, "mirrored", smooth=False, normals=None, **plain),
    ]


def _expected(
    view: NDArray[Any], hits: NDArray[Any], meshes: list[Placed]
) -> tuple[NDArray[np.int64], NDArray[Any], Surface]:
    """Pixels that see a surface, their hits and surfaces."""
    width, height = int(view["width"][0]), int(view["height"][0])
    pixels = pixel_numbers(width, height)
    seen = (pixels >= 0) & (hits["instance"] != MISS)
    directions = view_directions(view, tile_order(width, height))[seen]
    return pixels[seen], hits[seen], surfaces(meshes, hits[seen], directions)


@pytest.mark.parametrize(("width", "height"), [(333, 217), (1, 9), (5, 1)])
def test_surfaces_agree_with_the_reference(
    runner: Runner, rng: np.random.Generator, width: int, height: int
) -> None:
    meshes, view = _scene(rng), random_view(rng, width, height)
    hits = random_hits(rng, meshes, int(view["tiled"][0]), misses=0.2)
    out = _run(runner, view, hits, meshes)
    pixels, seen, expected = _expected(view, hits, meshes)
    rows = {name: words[pixels] for name, words in out.items()}

    bound = rows["g_position"][:, 3].view(np.float32).astype(np.float64)
    assert_within(floats(rows["g_position"]), expected.position, bound[:, None] / 2, "positions")
    assert_within(bound, ORIGIN_ERROR * expected.reach, 2.0**-40 * expected.reach, "bounds of their error")
    # the worst stretch squeezes triangles 15 : 1, which magnifies the rounding of their edges
    turned = expected.facing > EDGE_ON
    assert turned.mean() > 0.99
    geometric, normal = floats(rows["g_geometric"])[turned], floats(rows["g_normal"])[turned]
    assert_within(geometric, expected.normal_geo[turned], 1e-5, "geometric normals")
    assert_within(normal, expected.normal_shade[turned], 1e-5, "shading normals")
    assert_within(floats(rows["g_albedo"]), expected.albedo, 2e-5, "albedo")
    assert (rows["g_normal"][:, 3] == SURFACE).all()
    assert (rows["g_geometric"][:, 3] == seen["triangle"]).all()
    assert (rows["g_albedo"][:, 3] == seen["instance"]).all()

    nothing = np.setdiff1d(np.arange(width * height), pixels)
    for name in ROWS:
        assert (out[name][nothing, :3] == 0).all(), "misses are zeros"
    assert (out["g_normal"][nothing, 3] == NOTHING).all()
    assert (out["g_geometric"][nothing, 3] == MISS).all()
    assert (out["g_albedo"][nothing, 3] == MISS).all()

    moved = seen.copy()
    moved["u"] *= 1 - 1e-4
    at = view_directions(view, tile_order(width, height))[pixel_numbers(width, height) >= 0]
    control = surfaces(meshes, moved, at[: len(moved)])
    assert_not_within(floats(rows["g_position"]), control.position, bound[:, None])
    assert_not_within(floats(rows["g_albedo"]), expected.albedo * (1 + 1e-3), 2e-5)
    assert_not_within(geometric, -expected.normal_geo[turned], 1e-5)


def test_normals_are_unit_and_face_the_viewer(runner: Runner, rng: np.random.Generator) -> None:
    meshes, view = _scene(rng), random_view(rng, 200, 100)
    hits = random_hits(rng, meshes, int(view["tiled"][0]))
    out = _run(runner, view, hits, meshes)
    at = np.stack(np.divmod(np.arange(20_000), 200)[::-1], axis=-1)
    directions = view_directions(view, at)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for name in ("g_normal", "g_geometric"):
        n = floats(out[name]).astype(np.float64)
        assert_within(np.linalg.norm(n, axis=1), np.ones(len(n)), 3e-7, "lengths")
        assert ((n * directions).sum(axis=1) <= 1e-6).all()


def test_lights_show_where_on_them_and_which_side(runner: Runner, rng: np.random.Generator) -> None:
    """The kind names the light; in place of an albedo lie a, b of corner + a·u + b·v, 1 on the lit side."""
    lights = [random_area(rng) for _ in range(5)]
    meshes = [random_mesh(rng, "rigid"), *(light_quad(light, k) for k, light in enumerate(lights))]
    view = random_view(rng, 64, 48)
    hits = random_hits(rng, meshes, int(view["tiled"][0]), misses=0.1)
    out = _run(runner, view, hits, meshes)
    pixels, seen, expected = _expected(view, hits, meshes)
    number = seen["instance"].astype(int) - 1
    kinds = np.where(number < 0, SURFACE, FIRST_LIGHT + number)
    assert (out["g_normal"][pixels, 3] == kinds).all()
    sides: set[float] = set()
    for k, light in enumerate(lights):
        mine = number == k
        shown = floats(out["g_albedo"][pixels[mine]])
        # where the point lies in the frame of the light's edges
        frame = np.stack([light.u, light.v], axis=-1)
        ab = np.linalg.lstsq(frame, (expected.position[mine] - light.corner).T, rcond=None)[0].T
        assert_within(shown[:, :2], ab, 2e-6, "places on the light")
        assert_not_within(shown[:, :2], ab[:, ::-1], 2e-6)
        at = view_directions(view, np.stack(np.divmod(pixels[mine], 64)[::-1], axis=-1))
        facing = at @ light.normal
        clear = np.abs(facing) > EDGE_ON
        assert (shown[clear, 2] == (facing < 0)[clear]).all()
        sides |= set(shown[:, 2].tolist())
    assert sides == {0.0, 1.0}, "both sides were seen"


def test_a_part_of_the_image_writes_its_pixels_only(runner: Runner, rng: np.random.Generator) -> None:
    """A list of hits may begin anywhere in the tile order."""
    meshes, view = _scene(rng), random_view(rng, 50, 40)
    hits = random_hits(rng, meshes, int(view["tiled"][0]), misses=0.2)
    whole = _run(runner, view, hits, meshes)
    first, count = 192, 448
    view["first"] = first
    part = _run(runner, view, hits[first : first + count], meshes)
    mine = pixel_numbers(50, 40)[first : first + count]
    others = np.setdiff1d(np.arange(50 * 40), mine)
    for name in ROWS:
        assert (part[name][mine[mine >= 0]] == whole[name][mine[mine >= 0]]).all()
        assert (part[name][others] == 0xABABABAB).all()
