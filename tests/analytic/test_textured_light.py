"""Lights that show a picture: which way up it is, and that the floor gets each texel's share."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
from tests.analytic.closed_forms import (
    add_quad,
    floor_points,
    floor_scene,
    light_irradiance,
    relative,
    view_down,
)

ALBEDO = np.array([0.8, 0.6, 0.4])
UP = np.array([0.0, 1, 0])


def picture(rows: int = 3, columns: int = 4) -> NDArray[np.float32]:
    """No symmetry: each texel has its own colour, the top left one is bright."""
    texels = np.random.default_rng(3).uniform(0, 2, (rows, columns, 3))
    texels[0, 0] = 20
    return texels.astype(np.float32)


def lamp(radiance: NDArray[np.float32], **options: bool) -> ml.AreaLight:
    """A light just above the floor that looks down."""
    return ml.AreaLight((-0.6, 0.5, -0.4), (1.2, 0, 0), (0, 0, 0.9), radiance, visible=False, **options)


def test_the_floor_sees_each_texel_where_it_is(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """Against one polygon a texel; a picture upside down, mirrored or turned does not pass."""
    camera = view_down(up=0.45, fov_y=110)
    texels = picture()
    frame = renderer.render(floor_scene(lamp(texels)), camera, grid)
    points = floor_points(camera)
    normals = np.tile(UP, (len(points), 1))
    found = frame.image.reshape(-1, 3)

    def expected(radiance: NDArray[np.float32]) -> NDArray[np.float64]:
        return ALBEDO / np.pi * light_irradiance(lamp(radiance), points, normals)

    # 24 or 32 strata cut the patches unevenly: each has its patches' mean at its own middle
    assert relative(found, expected(texels)).max() < 4e-3
    for wrong in (texels[::-1], texels[:, ::-1], texels[::-1, ::-1]):
        assert relative(found, expected(np.ascontiguousarray(wrong))).max() > 0.1


def test_seen_from_its_lit_side_a_picture_is_upright(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """With edge_u to the right and edge_v up: the pixels are the texels."""
    texels = picture()
    light = ml.AreaLight((-2, -1.5, 0), (4, 0, 0), (0, 3, 0), texels)
    scene = ml.Scene()
    scene.add_light(light, name="tv")
    camera = ml.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=2 * np.degrees(np.arctan(0.5)), width=4, height=3)
    assert light.normal[2] > 0
    frame = renderer.render(scene, camera, grid)
    assert (frame.image == texels).all()
    assert not (frame.image == texels[::-1]).all()
    assert not (frame.image == texels[:, ::-1]).all()

    behind = ml.Camera.look_at((0, 0, -3), (0, 0, 0), fov_y=camera.fov_y, width=4, height=3)
    assert not renderer.render(scene, behind, grid).image.any()
    light.two_sided = True
    mirrored = renderer.render(scene, behind, grid).image
    assert (mirrored == texels[:, ::-1]).all(), "from behind it is seen through"


def test_linear_pictures_are_smooth_and_as_bright(renderer: ml.Renderer, grid: ml.Settings) -> None:
    texels = picture()
    nearest, linear = (ml.AreaLight((-2, -1.5, 0), (4, 0, 0), (0, 3, 0), texels, filter=f) for f in FILTERS)
    camera = ml.Camera.look_at(
        (0, 0, 3), (0, 0, 0), fov_y=2 * np.degrees(np.arctan(0.5)), width=80, height=60
    )
    images = []
    for light in (nearest, linear):
        scene = ml.Scene()
        scene.add_light(light)
        images.append(renderer.render(scene, camera, grid).image)
    assert (images[0] == np.repeat(np.repeat(texels, 20, axis=0), 20, axis=1)).all()
    # halfway between two texels' middles lies their mean: columns 19 | 20 straddle it by half a pixel
    between = (images[1][10, 19] + images[1][10, 20]) / 2
    rows = (texels[0] * 0.5 + texels[0] * 0.5) if False else texels[0]
    middle = (rows[0] + rows[1]) / 2
    below = (texels[1, 0] + texels[1, 1]) / 2
    share = 0.5 / 20  # row 10 lies half a pixel below the first texels' middles
    assert np.allclose(between, (1 - share) * middle + share * below, rtol=1e-5)
    assert np.allclose(images[1].mean(axis=(0, 1)), texels.mean(axis=(0, 1)), rtol=1e-3)


FILTERS: tuple[ml.light.Filter, ...] = ("nearest", "linear")


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (48, 64), (300, 200)])
def test_pictures_send_their_mean_far_away(
    renderer: ml.Renderer, grid: ml.Settings, size: tuple[int, int]
) -> None:
    """Ten sizes away the floor cannot tell a picture from its mean, whatever its texels."""
    texels = np.random.default_rng(4).uniform(0, 4, (*size, 3)).astype(np.float32)
    light = ml.AreaLight((-0.05, 1, -0.05), (0.1, 0, 0), (0, 0, 0.1), texels, visible=False)
    plain = light.copy()
    plain.radiance = texels.mean(axis=(0, 1))
    settings = grid.replace(light_samples=256)
    images = [renderer.render(floor_scene(one), view_down(8, 6), settings).image for one in (light, plain)]
    assert relative(images[0], images[1]).max() < 2e-2
    # straight below, the first moments cancel
    assert relative(images[0].mean(axis=(0, 1)), images[1].mean(axis=(0, 1))).max() < 2e-3


def test_a_near_wall_tells_left_from_right(renderer: ml.Renderer, grid: ml.Settings) -> None:
    """A picture whose left half is red and right half green, over the wall in its middle."""
    texels = np.zeros((1, 2, 3), np.float32)
    texels[0, 0, 0] = texels[0, 1, 1] = 5
    light = ml.AreaLight((-1, -1, 0), (2, 0, 0), (0, 2, 0), texels)
    scene = ml.Scene()
    scene.add_light(light)
    add_quad(scene, (0, -1, 0), (0, 2, 0), (0, 0, 1), albedo=(1, 1, 1))
    left = ml.Camera.look_at((-3, 0, 1), (0, 0, 0.5), fov_y=30, width=9, height=9)
    right = ml.Camera.look_at((3, 0, 1), (0, 0, 0.5), fov_y=30, width=9, height=9)
    red = renderer.render(scene, left, grid)
    assert red.direct[red.surface_mask][:, 0].max() > 0.1
    assert not red.direct[red.surface_mask][:, 1].any()
    green = renderer.render(scene, right, grid)
    assert green.direct[green.surface_mask][:, 1].max() > 0.1
    assert not green.direct[green.surface_mask][:, 0].any()
