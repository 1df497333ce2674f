"""Rays start off their own surface and no further: no wall shades itself, no wall lets light through."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml

SIZE = 8.0
PLACES = {
    "plain": (1.0, (1, 1, 1)),
    "turned": (1.0, (1, 1, 1)),
    "stretched": (1.0, (4, 0.4, 1)),
    "small": (1e-3, (1, 1, 1)),
    "big": (1e4, (1, 1, 1)),
}


def _needles(count: int = 300) -> trimesh.Trimesh:
    """A box whose walls are strips a three-hundredth as wide as long."""
    half = SIZE / 2
    edges = np.linspace(-half, half, count + 1)
    vertices: list[NDArray[np.float64]] = []
    for axis in range(3):
        for side in (-half, half):
            for lo, hi in itertools.pairwise(edges):
                flat = np.array([(lo, -half), (hi, -half), (hi, half), (lo, half)])
                vertices.append(np.insert(flat, axis, side, axis=1))
    first = 4 * np.arange(len(vertices))[:, None]
    faces = np.concatenate([first + np.array(corners) for corners in ((0, 1, 2), (0, 2, 3))])
    return trimesh.Trimesh(np.concatenate(vertices), faces, process=False)


def _shell(kind: str) -> trimesh.Trimesh:
    if kind == "ball":
        return trimesh.creation.icosphere(3, SIZE / 2)
    return _needles() if kind == "needles" else trimesh.creation.box((SIZE, SIZE, SIZE))


def _transform(place: str, rng: np.random.Generator) -> NDArray[np.float64]:
    scale, stretch = PLACES[place]
    made = np.eye(4)
    if place != "plain":
        turns = [
            trimesh.transformations.random_rotation_matrix(rng.uniform(size=3))[:3, :3] for _ in range(2)
        ]
        made[:3, :3] = turns[0] @ np.diag(stretch) @ turns[1] * scale
    return made


def _scene(kind: str, place: str, rng: np.random.Generator) -> tuple[ml.Scene, float]:
    scene, matrix = ml.Scene(), _transform(place, rng)
    scene.add_mesh(_shell(kind), name="shell", transform=matrix, shading="flat")
    return scene, float(np.linalg.svd(matrix[:3, :3])[1].min())


@pytest.mark.parametrize("kind", ["box", "needles", "ball"])
@pytest.mark.parametrize("place", list(PLACES))
def test_a_convex_room_does_not_shade_itself(
    renderer: ml.Renderer, rng: np.random.Generator, kind: str, place: str
) -> None:
    """Every point of the walls sees all of a light inside: with and without rays, the same bits."""
    scene, unit = _scene(kind, place, rng)
    edges = trimesh.transformations.random_rotation_matrix(rng.uniform(size=3))[:2, :3] * unit
    middle = rng.uniform(-0.3, 0.3, 3) * unit
    scene.add_light(ml.AreaLight(middle, edges[0], edges[1], (1, 1, 1), two_sided=True, visible=False))
    settings = ml.Settings.preset("brute-force")
    eye = middle + 0.1 * unit
    for target in np.concatenate([np.eye(3), -np.eye(3)])[:: 5 if place == "plain" else 3]:
        camera = ml.Camera.look_at(eye, eye + target, (0.3, 0.5, 0.8), 100, 48, 48)
        traced = renderer.render(scene, camera, settings).image
        free = renderer.render(scene, camera, settings.replace(visibility="none")).image
        assert (traced == free).all(), f"{(traced != free).any(axis=-1).sum()} pixels shade themselves"
        assert (traced > 0).all()


def test_something_in_the_room_is_seen_by_the_same_test(
    renderer: ml.Renderer, rng: np.random.Generator
) -> None:
    scene, _ = _scene("box", "plain", rng)
    scene.add_light(ml.AreaLight((0, 1, 0), (1, 0, 0), (0, 0, 1), two_sided=True, visible=False))
    scene.add_mesh(trimesh.creation.box((0.2, 0.2, 0.2)), name="crumb", shading="flat")
    camera = ml.Camera.look_at((0, 2, 0), (0, -4, 0), (0, 0, 1), 100, 48, 48)
    settings = ml.Settings.preset("brute-force")
    traced = renderer.render(scene, camera, settings).image
    assert (traced != renderer.render(scene, camera, settings.replace(visibility="none")).image).any()


@pytest.mark.parametrize("kind", ["box", "needles", "ball"])
def test_no_light_gets_into_a_closed_room(renderer: ml.Renderer, rng: np.random.Generator, kind: str) -> None:
    """Bright lights all around outside: inside it is black, directly and after three bounces."""
    scene, _ = _scene(kind, "turned", rng)
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        side = np.roll(axis, 1)
        other = np.cross(axis, side)
        corner = axis * SIZE * 1.2 - 5 * side - 5 * other
        light = ml.AreaLight(corner, 10 * side, 10 * other, (1e6, 1e6, 1e6), two_sided=True, visible=False)
        scene.add_light(light)
    settings = ml.Settings.preset("brute-force").replace(
        light_samples=64, indirect="final-gather", gather_rays=64, bounces=3
    )
    camera = ml.Camera.look_at((0.1, 0.2, 0.3), (1, 1, 1), fov_y=110, width=32, height=32)
    assert not renderer.render(scene, camera, settings).image.any()
    outside = ml.Camera.look_at((SIZE, SIZE, SIZE), (0, 0, 0), fov_y=60, width=16, height=16)
    assert renderer.render(scene, outside, settings.replace(gather_rays=4)).image.any()
