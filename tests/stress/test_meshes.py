"""Triangles as files have them: without area, needles, doubled, turned over, cracked, beyond the scene."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml
from tests.analytic.closed_forms import floor_scene, view_down
from tests.stress.common import (
    ALBEDO,
    PRESETS,
    Array,
    assert_sound,
    floor_light,
    lamp,
    quick,
    sized,
    variants,
    worst,
)

Soup = tuple[Array, NDArray[np.int64]]
HALF = 4.0  # of the floor's side


def _grid(columns: int, rows: int) -> Soup:
    """The floor as columns × rows rectangles of two triangles each, which face up."""
    x, z = np.linspace(-HALF, HALF, columns + 1), np.linspace(-HALF, HALF, rows + 1)
    points = np.stack([a.ravel() for a in np.broadcast_arrays(x[:, None], 0.0, z[None])], axis=-1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    a, b = i * (rows + 1) + j, (i + 1) * (rows + 1) + j
    return points, np.concatenate([np.stack([a, a + 1, b + 1], -1), np.stack([a, b + 1, b], -1)])


def _without_area() -> Soup:
    """Among good triangles: corners that are one, corners on a line, and one that repeats an index."""
    points, faces = _grid(3, 3)
    extra = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0.0]])
    n = len(points)
    bad = np.array([[n, n + 1, n + 2], [n + 3, n + 4, n + 5], [0, 0, 5]])
    return np.concatenate([points, extra]), np.concatenate([bad[:2], faces, bad[2:]])


def _needles() -> Soup:
    """Strips a millionth as wide as long, between wide ones."""
    points, faces = _grid(8, 1)
    at = np.sort(np.concatenate([np.linspace(-HALF, HALF, 5), np.linspace(-3, 3, 4) + 8e-6]))
    points[:, 0] = at.repeat(2)
    return points, faces


def _doubled() -> Soup:
    points, faces = _grid(4, 4)
    return points, np.concatenate([faces, faces, np.roll(faces, 1, axis=1)])


def _turned_over() -> Soup:
    points, faces = _grid(5, 4)
    return points, np.where((np.arange(len(faces)) % 3 == 0)[:, None], faces[:, ::-1], faces)


def _fins() -> Soup:
    """Three triangles on each of some edges: fins below the floor share its edges."""
    points, faces = _grid(4, 4)
    below = points.mean(axis=0) - np.array([0, 2, 0])
    fins = np.stack([faces[::3, 0], faces[::3, 1], np.full(len(faces[::3]), len(points))], -1)
    return np.concatenate([points, below[None]]), np.concatenate([faces, fins])


def _junctions() -> Soup:
    """T-junctions: 7 columns meet 3 along a line; places along it are no corners of the other side."""
    (left, one), (right, two) = _grid(3, 7), _grid(2, 3)
    left[:, 0], right[:, 0] = (left[:, 0] - HALF) / 2, (right[:, 0] + HALF) / 2
    return np.concatenate([left, right]), np.concatenate([one, two + len(left)])


def _dust() -> Soup:
    """Hundreds of triangles in each pixel."""
    n = sized(120, 500)
    return _grid(n, n)


def _beyond() -> Soup:
    """One triangle a thousand times as large as what is seen."""
    far = 1000 * HALF
    return np.array([[-far, 0, far], [far, 0, far], [0, 0, -2 * far]]), np.array([[0, 1, 2]])


SOUPS: dict[str, Callable[[], Soup]] = {
    "without area": _without_area,
    "needles": _needles,
    "doubled": _doubled,
    "turned over": _turned_over,
    "fins": _fins,
    "junctions": _junctions,
    "dust": _dust,
    "beyond": _beyond,
}


def _under(light: ml.AreaLight, soup: Soup) -> ml.Scene:
    scene = ml.Scene()
    scene.add_arrays(*soup, name="floor", material=ml.Material(ALBEDO), shading="flat")
    scene.add_light(light)
    return scene


@pytest.mark.parametrize("name", SOUPS)
@pytest.mark.parametrize("preset", PRESETS)
def test_a_floor_of_odd_triangles_is_a_floor(renderer: ml.Renderer, preset: str, name: str) -> None:
    """All of it lies at y = 0: the light is Lambert's, and what two clean triangles show."""
    light, camera, settings = lamp(), view_down(32, 24), quick(preset, coarsest_level=2)
    soup = SOUPS[name]()
    frame = renderer.render(_under(light, soup), camera, settings)
    assert frame.surface_mask.all(), "no ray falls through"
    assert_sound(frame)
    # a place on a triangle is known to an ulp of its size, and what starts rays to a few
    ulp = np.ptp(soup[0]) * 2.0**-23
    clean = renderer.render(_under(light, _grid(1, 1)), camera, settings).direct
    assert worst(frame.direct, clean) < 1e-5 + (ulp if preset == "default" else 10 * ulp)
    expected = floor_light(light, camera)
    bound = 1e-4 + ulp if preset == "default" else 0.15 if preset == "area-2016" else 0.03
    assert worst(frame.direct, expected) < bound
    assert worst(frame.direct, 1.2 * expected) > bound, "negative control"


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-3])
def test_a_crack_shows_what_is_behind(renderer: ml.Renderer, gap: float) -> None:
    """Half a floor beside another, seen edge to edge: the void is as wide as the crack, and no wider."""
    scene = ml.Scene()
    for x in (-HALF - gap / 2, gap / 2):
        corner = np.array([x, 0, HALF])
        points = corner + np.array([(0, 0, 0), (HALF, 0, 0), (HALF, 0, -2 * HALF), (0, 0, -2 * HALF)])
        scene.add_arrays(points, [(0, 1, 2), (0, 2, 3)], shading="flat")
    width = sized(257, 1025)
    camera = view_down(width, 5, up=1.0, fov_y=0.1)  # pixels are 3.5e-4 wide; the middle one looks at x = 0
    seen = renderer.render(scene, camera, quick("brute-force", direct="off")).surface_mask
    pixel = 2 * np.tan(np.radians(0.05)) / 5
    void = np.count_nonzero(~seen[2]) * pixel
    assert abs(void - gap) <= pixel
    assert (void == 0) == (gap == 0), "negative control: a crack is seen where there is one"


NORMALS: dict[str, Callable[[Array], Array]] = {
    "zero": lambda n: 0 * n,
    "opposite": lambda n: -n,
    "some zero": lambda n: n * (np.arange(len(n)) % 3 > 0)[:, None],
    "some opposite": lambda n: n * np.where(np.arange(len(n)) % 2, 1, -1)[:, None],
    "long": lambda n: 1e6 * n,
    "short": lambda n: 1e-6 * n,
    "tangent": lambda n: np.roll(n, 1, axis=1),
}


@pytest.mark.parametrize("name", NORMALS)
@pytest.mark.parametrize("variant", variants())
def test_any_vertex_normals_give_sound_images(renderer: ml.Renderer, variant: str, name: str) -> None:
    ball = trimesh.creation.icosphere(2, 0.6)
    ball.apply_translation((0, 0.7, 0))
    scene = floor_scene(lamp())
    normals = NORMALS[name](np.array(ball.vertex_normals))
    scene.add_arrays(ball.vertices, ball.faces, normals=normals, name="ball")
    camera = ml.Camera.look_at((0, 1.8, 3), (0, 0.4, 0), fov_y=40, width=28, height=24)
    frame = renderer.render(scene, camera, variants()[variant])
    # no surface reflects more radiance than all lights have, which is more than one bounce adds
    assert_sound(frame, most=10.0)
    seen = frame.surface_mask
    assert np.abs(np.linalg.norm(frame.normal[seen], axis=-1) - 1).max() < 1e-5
    view = frame.position[seen] - camera.origin
    assert ((view * frame.normal[seen]).sum(axis=-1) < 1e-5).all(), "normals look at the viewer"


@pytest.mark.parametrize("name", ["long", "short", "opposite", "zero"])
def test_length_and_sign_of_normals_do_not_matter(renderer: ml.Renderer, name: str) -> None:
    """Shading normals are turned to the viewer; those without a direction are computed anew."""
    ball, camera = trimesh.creation.icosphere(3, 0.8), view_down(32, 24, up=2.5)
    normals = np.array(ball.vertex_normals)
    images = []
    for given in (normals, NORMALS[name](normals), np.roll(normals, 1, axis=1)):
        scene = floor_scene(lamp())
        scene.add_arrays(ball.vertices, ball.faces, normals=given, name="ball")
        images.append(renderer.render(scene, camera, quick("default")).image)
    # normals of an icosphere computed anew are those of a sphere to a hundredth
    bound = 0.02 if name == "zero" else 1e-5
    assert worst(images[1], images[0]) < bound
    assert worst(images[2], images[0]) > bound, "negative control"


@pytest.mark.parametrize("variant", variants())
def test_meshes_that_touch_or_pass_through_each_other(renderer: ml.Renderer, variant: str) -> None:
    """Boxes that stand on the floor, share a face, lie in one another or in the floor: sound, and lit."""
    scene = floor_scene(lamp(height=2.5))
    for k, at in enumerate([(0, 0.25, 0), (0.5, 0.25, 0), (0.25, 0.4, 0.2), (0, 0, -0.8), (0, 0.25, 0)]):
        box = trimesh.creation.box((0.5, 0.5, 0.5)).apply_translation(at)
        scene.add_mesh(box, name=f"box {k}", shading="flat")
    camera = ml.Camera.look_at((1.0, 2, 3), (0.2, 0.2, 0), fov_y=36, width=36, height=28)
    frame = renderer.render(scene, camera, variants()[variant])
    assert_sound(frame, most=10.0)
    tops = frame.surface_mask & (frame.position[..., 1] > 0.499) & (frame.normal[..., 1] > 0.9)
    assert tops.sum() > 10
    assert (frame.direct[tops].max(axis=-1) > 0.05).all()
