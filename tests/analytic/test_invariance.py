"""What must not change the picture: where the scene lies, how large it is, how the image is cut."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray

import miplight as ml
from tests.analytic.closed_forms import relative

Array = NDArray[np.float64]
FACES = np.array([(0, 1, 2), (0, 2, 3)])


def moved(points: ArrayLike, matrix: Array, w: float = 1.0) -> Array:
    """Points (w = 1) or directions (w = 0) under a transform."""
    p: Array = np.asarray(points, np.float64) @ matrix[:3, :3].T + w * matrix[:3, 3]
    return p


def room(matrix: Array, scale: float = 1.0) -> ml.Scene:
    """A floor, a ball (smooth), a box as an instance, two area lights and a spot, all under `matrix`."""
    scene = ml.Scene()
    floor = [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]
    scene.add_arrays(
        moved(floor, matrix), FACES, name="floor", material=ml.Material((0.7, 0.6, 0.5)), shading="flat"
    )
    ball = trimesh.creation.icosphere(2, 0.4)
    ball.apply_translation((0.5, 0.4, 0.2))
    normals = np.asarray(ball.vertex_normals) @ np.linalg.inv(matrix[:3, :3])
    scene.add_arrays(moved(ball.vertices, matrix), ball.faces, normals=normals, name="ball")
    lift = np.eye(4)
    lift[:3, 3] = (-0.7, 0.25, -0.2)
    scene.add_mesh(trimesh.creation.box((0.5, 0.5, 0.5)), name="box", transform=matrix @ lift, shading="flat")
    flips = np.linalg.det(matrix[:3, :3]) < 0
    for corner, u, v, radiance in (
        ((-0.5, 2, -0.5), (1, 0, 0), (0, 0, 1), (6, 5, 4)),
        ((-2, 0.5, 0.4), (0, 0.8, 0), (0, 0, -0.8), (3, 5, 9)),
    ):
        edges = (
            [moved(v, matrix, 0), moved(u, matrix, 0)]
            if flips
            else [moved(u, matrix, 0), moved(v, matrix, 0)]
        )
        scene.add_light(ml.AreaLight(moved(corner, matrix), *edges, radiance))
    # intensity is flux a steradian: it grows with the square of the size
    intensity = np.array([4.0, 3, 2]) * scale**2
    scene.add_light(ml.SpotLight(moved((1.5, 1.5, 1.5), matrix), moved((0, 0, 0), matrix), intensity, 35))
    return scene


def view(matrix: Array, scale: float = 1.0, width: int = 40, height: int = 32) -> ml.Camera:
    """The room from the front; `matrix` must not mirror."""
    origin, target = moved((0.3, 1.4, 4), matrix), moved((0, 0.6, 0), matrix)
    return ml.Camera.look_at(origin, target, moved((0, 1, 0), matrix, 0), 42, width, height)


@pytest.fixture
def settings() -> ml.Settings:
    """Direct light, and some indirect."""
    return ml.Settings.preset("brute-force").replace(
        light_samples=64, light_pattern="grid", indirect="final-gather", gather_rays=16, bounces=2
    )


@pytest.fixture
def plain(renderer: ml.Renderer, settings: ml.Settings) -> ml.Frame:
    """The room where it is."""
    return renderer.render(room(np.eye(4)), view(np.eye(4)), settings, outputs=("image", "depth", "normal"))


def _share_off(found: Array, expected: Array, bound: float = 1e-3) -> float:
    """Share of pixels that are off by more than `bound` of the brightest."""
    return float((relative(found, expected).max(axis=-1) > bound).mean())


def test_a_million_units_away_it_looks_the_same(
    renderer: ml.Renderer, settings: ml.Settings, plain: ml.Frame
) -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = (1e6, -2e6, 5e5)
    camera = view(matrix)
    far = renderer.render(room(matrix), camera, settings, outputs=("image", "depth"))
    # float64 rounds the scene itself by 2e-10; a gather ray at the edge of a thing may go past it
    assert _share_off(far.image, plain.image) < 0.005
    assert abs(far.image.mean() / plain.image.mean() - 1) < 1e-4
    seen = np.isfinite(plain.depth)
    assert (np.isfinite(far.depth) == seen).all()
    assert np.abs(far.depth[seen] - plain.depth[seen]).max() < 1e-5
    matrix[0, 3] += 0.05
    elsewhere = renderer.render(room(matrix), camera, settings)
    assert _share_off(elsewhere.image, plain.image) > 0.1


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 37.0, 1e5])
def test_size_does_not_matter(
    renderer: ml.Renderer, settings: ml.Settings, plain: ml.Frame, scale: float
) -> None:
    """Radiance does not depend on the size; a spot's intensity goes with its square."""
    matrix = np.diag([scale, scale, scale, 1.0])
    frame = renderer.render(room(matrix, scale), view(matrix), settings, outputs=("image", "depth"))
    assert _share_off(frame.image, plain.image) < 0.005
    assert abs(frame.image.mean() / plain.image.mean() - 1) < 1e-3
    seen = np.isfinite(plain.depth)
    assert np.abs(frame.depth[seen] / scale - plain.depth[seen]).max() < 1e-4
    without = renderer.render(room(matrix, 1.0), view(matrix), settings).image
    assert _share_off(without, plain.image) > 0.05


def test_a_power_of_two_changes_no_bit(renderer: ml.Renderer, settings: ml.Settings, plain: ml.Frame) -> None:
    matrix = np.diag([1024.0, 1024, 1024, 1])
    frame = renderer.render(room(matrix, 1024), view(matrix), settings)
    assert (frame.image == plain.image).all()


def test_turned_scenes_look_the_same(
    renderer: ml.Renderer, settings: ml.Settings, plain: ml.Frame, rng: np.random.Generator
) -> None:
    """The jitter of gather rays turns with the tangent frame, so that only direct light stays as it is."""
    matrix = trimesh.transformations.random_rotation_matrix(rng.uniform(size=3))
    settings = settings.replace(gather_rays=144)
    turned = renderer.render(room(matrix), view(matrix), settings, outputs=("image", "direct", "indirect"))
    same = renderer.render(room(np.eye(4)), view(np.eye(4)), settings, outputs=("direct", "indirect"))
    assert _share_off(turned.direct, same.direct) < 0.01
    assert abs(turned.indirect.mean() / same.indirect.mean() - 1) < 0.03
    assert (turned.image != plain.image).any()


def test_a_mirrored_scene_is_a_mirrored_picture(renderer: ml.Renderer, settings: ml.Settings) -> None:
    mirror, settings = np.diag([-1.0, 1, 1, 1]), settings.replace(gather_rays=144)
    straight = ml.Camera.look_at((0, 1.4, 4), (0, 0.6, 0), fov_y=42, width=40, height=32)
    outputs = ("image", "direct", "indirect", "normal", "depth")
    one = renderer.render(room(np.eye(4)), straight, settings, outputs=outputs)
    two = renderer.render(room(mirror), straight, settings, outputs=outputs)
    assert _share_off(two.direct[:, ::-1], one.direct) < 0.01
    assert _share_off(two.direct, one.direct) > 0.1
    assert abs(two.indirect.mean() / one.indirect.mean() - 1) < 0.03
    assert np.abs(two.normal[:, ::-1] * [-1, 1, 1] - one.normal).max() < 1e-3
    hit = np.isfinite(one.depth)
    assert np.abs(two.depth[:, ::-1][hit] - one.depth[hit]).max() < 1e-4


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 64), (64, 1), (333, 217), (9, 7)])
def test_a_part_of_the_picture_is_that_part(renderer: ml.Renderer, width: int, height: int) -> None:
    """An image of any size, cut out of a larger one by its intrinsics, has the same pixels."""
    settings = ml.Settings.preset("brute-force").replace(light_samples=16, light_pattern="grid")
    whole = view(np.eye(4), width=400, height=300)
    k = whole.K.copy()
    column, row = (60, 80) if width > 100 else (190, 200)
    k[0, 2] -= column
    k[1, 2] -= row
    part = ml.Camera.from_intrinsics(k, whole.world_from_camera, width, height)
    scene = room(np.eye(4))
    large = renderer.render(scene, whole, settings).image
    small = renderer.render(scene, part, settings)
    assert small.image.shape == (height, width, 3)
    window = large[row : row + height, column : column + width]
    # the principal point is rounded: rays differ in their last bits, and so may what lies at an edge
    assert (relative(small.image, window).max(axis=-1) > 1e-4).sum() <= 0.002 * width * height
    if width * height > 64:
        beside = large[row + 1 : row + 1 + height, column : column + width]
        assert (relative(small.image, beside).max(axis=-1) > 1e-4).mean() > 0.1


@pytest.mark.parametrize("factor", [2, 4])
@pytest.mark.parametrize("pattern", ["grid", "jittered"])
def test_supersampling_is_the_mean_of_the_larger_image(
    renderer: ml.Renderer, settings: ml.Settings, factor: int, pattern: str
) -> None:
    scene, camera = room(np.eye(4)), view(np.eye(4), width=21, height=13)
    settings = settings.replace(light_pattern=pattern)
    outputs = ("image", "direct", "indirect", "fragments")
    small = renderer.render(scene, camera, settings.replace(supersample=factor), outputs=outputs)
    large_camera = view(np.eye(4), width=21 * factor, height=13 * factor)
    large = renderer.render(scene, large_camera, settings, outputs=outputs)
    for name in outputs[:3]:
        blocks = large[name].astype(np.float64).reshape(13, factor, 21, factor, 3).mean(axis=(1, 3))
        assert relative(small[name], blocks).max() < 1e-6, name
        assert relative(small[name], blocks[:, ::-1]).max() > 1e-2
    assert small.fragments.level_map.shape == (13 * factor, 21 * factor)


def test_seeds_differ_and_agree_on_the_mean(renderer: ml.Renderer, settings: ml.Settings) -> None:
    scene, camera = room(np.eye(4)), view(np.eye(4))
    settings = settings.replace(light_pattern="jittered")
    images = [renderer.render(scene, camera, settings.replace(seed=seed)).image for seed in (0, 1, 2**32 - 1)]
    for other in images[1:]:
        assert (other != images[0]).any(axis=-1).mean() > 0.4
        assert abs(other.mean() / images[0].mean() - 1) < 0.01
    assert (renderer.render(scene, camera, settings.replace(seed=0)).image == images[0]).all()


def test_the_same_again_has_the_same_bits(renderer: ml.Renderer, adapter: str, settings: ml.Settings) -> None:
    """Five times, with other work in between, and on a second renderer."""
    scene, camera = room(np.eye(4)), view(np.eye(4))
    settings = settings.replace(light_pattern="jittered")
    first = renderer.render(scene, camera, settings).image
    for width in (5, 70, 33, 1):
        renderer.render(scene, view(np.eye(4), width=width), settings)
        assert (renderer.render(scene, camera, settings).image == first).all()
    with ml.Renderer(adapter) as second:
        assert (second.render(scene, camera, settings).image == first).all()


def test_both_forms_of_the_trace_show_the_same(adapter: str, settings: ml.Settings) -> None:
    """Rays answered on the host and on the device: they may differ at edges only."""
    scene, camera = room(np.eye(4)), view(np.eye(4))
    outputs = ("image", "direct", "indirect", "depth")
    frames = []
    for form in ("native", "wgsl"):
        with ml.Renderer(adapter, trace=form) as renderer:
            assert renderer.adapter["trace"] == form
            frames.append(renderer.render(scene, camera, settings, outputs=outputs))
    native, wgsl = frames
    assert _share_off(wgsl.direct, native.direct) < 0.005
    assert _share_off(wgsl.indirect, native.indirect) < 0.02
    assert abs(wgsl.image.mean() / native.image.mean() - 1) < 1e-3
    seen = np.isfinite(native.depth)
    assert (np.isfinite(wgsl.depth) == seen).mean() > 0.995
    both = seen & np.isfinite(wgsl.depth)
    assert np.median(np.abs(wgsl.depth[both] - native.depth[both])) < 1e-6
    assert native.stats.rays == pytest.approx(wgsl.stats.rays, rel=1e-3)
