"""Work that does not fit into one piece: large images, many hemisphere rays, many samples."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml
from tests.analytic.closed_forms import floor_scene, relative


def _scene() -> ml.Scene:
    scene = floor_scene(ml.AreaLight((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), (6, 5, 4)))
    scene.add_mesh(trimesh.creation.icosphere(2, 0.6), name="ball")
    return scene


def test_a_large_image_has_the_pixels_of_a_small_one(renderer: ml.Renderer) -> None:
    """Primary rays, receivers and gather waves are worked on in pieces; the first rows have the same bits.

    Both images have the same columns and begin at the same row, so that each pixel has the same number, and
    with it the same jitter.
    """
    width, rows, height = 512, 24, 1300
    whole = ml.Camera.look_at((0, 1.5, 4), (0, 0.4, 0), fov_y=60, width=width, height=height)
    k = whole.K.copy()
    k[1, 2] -= 900  # begin with row 900, which sees the ball
    settings = ml.Settings.preset("brute-force").replace(
        light_samples=8, indirect="final-gather", gather_rays=4, bounces=1
    )
    images = [
        renderer.render(
            _scene(),
            ml.Camera.from_intrinsics(k, whole.world_from_camera, width, size),
            settings,
            outputs=("image", "direct", "indirect", "depth", "statistics"),
        )
        for size in (rows, height)
    ]
    assert np.isfinite(images[0].depth).any()
    for name in ("image", "direct", "indirect", "depth"):
        assert (images[1][name][:rows] == images[0][name]).all(), name
    assert images[0].indirect.any()
    assert not (images[1].image[rows : 2 * rows] == images[0].image).all()
    assert images[1].stats.light_evaluations > 50 * images[0].stats.light_evaluations / 24


def test_more_hemisphere_rays_than_a_wave_holds(renderer: ml.Renderer) -> None:
    """A wave holds 4,096 rays for each pixel of a tile; more go in several, and none of them is lost.

    Inside a sphere the indirect light of a spot in its middle is ρΦ/4πr² everywhere.
    """
    ball = trimesh.creation.icosphere(5, 2.0)
    scene = ml.Scene()
    scene.add_mesh(ball, name="sphere", material=ml.Material((0.5, 0.5, 0.5)), shading="flat")
    scene.add_light(ml.SpotLight((0, 0, 0), (1, 0, 0), (8, 8, 8), 60))
    flux = 2 * np.pi * (1 - np.cos(np.radians(60))) * 8
    expected = 0.5 / np.pi * 0.5 * flux / ball.area
    # away from the cone's edge, where the facets on either side are lit or not
    camera = ml.Camera.look_at((0, 0, 0), (-1, 0.2, 0.3), fov_y=60, width=3, height=2)
    settings = ml.Settings.preset("brute-force").replace(
        direct="off", indirect="final-gather", gather_rays=20_000
    )
    image = renderer.render(scene, camera, settings).image
    assert relative(image, np.full(image.shape, expected)).max() < 5e-3
    assert relative(image, np.full(image.shape, expected * 20_000 / 16_384)).max() > 5e-3


@pytest.mark.parametrize("samples", [4096, 4093, 65])
def test_every_count_of_samples_has_the_same_mean(renderer: ml.Renderer, samples: int) -> None:
    """Whole words of visibility or not, a prime or a square."""
    camera = ml.Camera.look_at((0, 1.5, 4), (0, 0.4, 0), fov_y=50, width=40, height=30)
    settings = ml.Settings.preset("brute-force").replace(light_pattern="grid")
    many = renderer.render(_scene(), camera, settings.replace(light_samples=1024)).image
    image = renderer.render(_scene(), camera, settings.replace(light_samples=samples)).image
    seen = many.max(axis=-1) > 0
    # a prime makes strips as long as the light
    assert abs(image[seen].mean() / many[seen].mean() - 1) < (1e-3 if samples == 4096 else 1e-2)
    assert not (image == many).all()
