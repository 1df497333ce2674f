"""What a scene says is what is rendered: textures upright, colours linear, normals and transforms as given.

Looks at the G-buffer images alone, against values computed here from API.md's words.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

import miplight as ml
from miplight import shapes

WIDTH, HEIGHT = 32, 24
HALF = 6e-4  # texels of a material are kept as half floats, which round by up to 2^-11


def square_on() -> ml.Camera:
    """A camera that sees the rectangle [0, 4] × [0, 3] of the plane z = 0, edge to edge."""
    fov_y = 2 * np.degrees(np.arctan(1.5 / 5.0))
    return ml.Camera.look_at((2, 1.5, 5), (2, 1.5, 0), fov_y=fov_y, width=WIDTH, height=HEIGHT)


def look(renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, quick: ml.Settings) -> ml.Frame:
    return renderer.render(scene, camera, quick)


def bilinear(image: NDArray[np.float32], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate between texel centres, repeated; row 0 of the image is at v = 1."""
    wide = image.astype(np.float64)
    height, width, _ = wide.shape
    x, y = uv[..., 0] * width - 0.5, (1.0 - uv[..., 1]) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = (x - left)[..., None], (y - top)[..., None]

    def texel(dx: int, dy: int) -> NDArray[np.float64]:
        found: NDArray[np.float64] = wide[(top + dy) % height, (left + dx) % width]
        return found

    upper = (1 - a) * texel(0, 0) + a * texel(1, 0)
    result: NDArray[np.float64] = (1 - b) * upper + b * ((1 - a) * texel(0, 1) + a * texel(1, 1))
    return result


def pixel_uv() -> NDArray[np.float64]:
    u = (np.arange(WIDTH) + 0.5) / WIDTH
    v = 1.0 - (np.arange(HEIGHT) + 0.5) / HEIGHT
    return np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)


@pytest.mark.parametrize("repeat", [1.0, 2.5])
def test_textures_are_upright_bilinear_and_repeat(
    renderer: ml.Renderer, quick: ml.Settings, rng: np.random.Generator, repeat: float
) -> None:
    image = rng.uniform(0, 1, (5, 7, 3))
    quad = shapes.quad((0, 0, 0), (4, 0, 0), (0, 3, 0))
    quad.visual.uv = quad.visual.uv * repeat - 0.25
    scene = ml.Scene()
    scene.add_mesh(quad, material=ml.Material(image))
    albedo = look(renderer, scene, square_on(), quick).albedo
    expected = bilinear(image.astype(np.float32), pixel_uv() * repeat - 0.25)
    np.testing.assert_allclose(albedo, expected, rtol=HALF)
    # negative control: upside down or mirrored it is another picture
    assert np.abs(albedo[::-1] - expected).max() > 0.1
    assert np.abs(albedo[:, ::-1] - expected).max() > 0.1


def test_a_texture_of_a_file_is_decoded(renderer: ml.Renderer, quick: ml.Settings) -> None:
    codes = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 64, 32]]], dtype=np.uint8)
    quad = shapes.quad((0, 0, 0), (4, 0, 0), (0, 3, 0))
    material = PBRMaterial(baseColorTexture=Image.fromarray(codes), baseColorFactor=[255, 51, 255, 255])
    quad.visual = TextureVisuals(uv=quad.visual.uv, material=material)
    albedo = look(renderer, ml.Scene.from_trimesh(quad), square_on(), quick).albedo
    linear = ml.srgb_to_linear(codes) * np.array([1.0, 0.2, 1.0], np.float32)
    np.testing.assert_allclose(albedo, bilinear(linear, pixel_uv()), rtol=HALF, atol=1e-7)


def test_vertex_colours_are_interpolated_and_multiply(renderer: ml.Renderer, quick: ml.Settings) -> None:
    corners = np.array([[0.1, 0.2, 0.3], [0.9, 0.2, 0.3], [0.1, 0.8, 0.3], [0.9, 0.8, 0.3]])
    quad = shapes.quad((0, 0, 0), (4, 0, 0), (0, 3, 0))
    scene = ml.Scene()
    scene.add_arrays(quad.vertices, quad.faces, colors=corners, material=ml.Material((0.5, 1.0, 0.25)))
    albedo = look(renderer, scene, square_on(), quick).albedo
    uv = pixel_uv()
    expected = np.stack(
        [0.1 + 0.8 * uv[..., 0], 0.2 + 0.6 * uv[..., 1], np.full_like(uv[..., 0], 0.3)], axis=-1
    )
    np.testing.assert_allclose(albedo, expected * (0.5, 1.0, 0.25), atol=1e-4)


@pytest.mark.parametrize("shading", ["smooth", "flat"])
def test_normals_of_a_moved_and_stretched_sphere(
    renderer: ml.Renderer, quick: ml.Settings, shading: Any
) -> None:
    matrix = trimesh.transformations.rotation_matrix(0.5, (1, 1, 0)) @ np.diag([1.4, 0.7, -1.0, 1.0])
    matrix[:3, 3] = (2, 1.5, 0)
    scene = ml.Scene()
    scene.add_mesh(shapes.displaced_sphere(20_000, amplitude=0.0), transform=matrix, shading=shading)
    frame = look(renderer, scene, square_on(), quick)
    seen = frame.surface_mask
    assert 0.1 < seen.mean() < 0.9
    local = (frame.position[seen] - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    assert np.linalg.norm(local, axis=1) == pytest.approx(1.0, abs=2e-3)
    expected = local @ np.linalg.inv(matrix[:3, :3])  # normals move with the inverse transpose
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    error = np.linalg.norm(frame.normal[seen] - expected, axis=1)
    # facets of a sphere of 20,000 triangles lean by up to a hundredth or two from the sphere itself
    assert np.median(error) < (2e-3 if shading == "smooth" else 2e-2)
    if shading == "flat":
        assert np.median(error) > 3e-3


def test_hundreds_of_instances_of_one_mesh(renderer: ml.Renderer, quick: ml.Settings) -> None:
    ball = shapes.displaced_sphere(80, radius=0.09, amplitude=0.0)
    scene = ml.Scene()
    for k in range(192):
        move = np.eye(4)
        move[:2, 3] = (0.125 + 0.25 * (k % 16), 0.125 + 0.25 * (k // 16))
        shade = (0.1 + 0.8 * k / 191, 0.5, 0.9 - 0.8 * k / 191)
        scene.add_mesh(ball, transform=move, material=ml.Material(shade))
    assert len({mesh.geometry for mesh in scene.meshes.values()}) == 1
    camera = square_on().replace(width=16, height=12)
    albedo = look(renderer, scene, camera, quick).albedo[::-1].reshape(-1, 3)
    np.testing.assert_allclose(albedo[:, 0], 0.1 + 0.8 * np.arange(192) / 191, atol=1e-5)


def test_updates_are_seen_and_nothing_else_changes(renderer: ml.Renderer, quick: ml.Settings) -> None:
    scene = ml.Scene()
    scene.add_mesh(
        shapes.quad((0, 0, 0), (2, 0, 0), (0, 3, 0)), name="left", material=ml.Material((0.2,) * 3)
    )
    scene.add_mesh(
        shapes.quad((2, 0, 0), (2, 0, 0), (0, 3, 0)), name="right", material=ml.Material((0.7,) * 3)
    )
    camera = square_on()
    before = look(renderer, scene, camera, quick)
    albedo, depth = before.albedo.copy(), before.depth.copy()
    np.testing.assert_allclose(albedo[:, :16], 0.2, rtol=1e-6)
    np.testing.assert_allclose(depth, 5.0, rtol=1e-5)
    back = np.eye(4)
    back[2, 3] = -1.0
    scene.set_transform("right", back)
    scene.set_vertices("left", scene.meshes["left"].positions + np.array([0, 0, 1.0]))
    scene.set_material("left", ml.Material((0.4, 0.4, 0.4)))
    after = look(renderer, scene, camera, quick)
    np.testing.assert_allclose(after.depth[:, :14], 4.0, rtol=1e-5)
    np.testing.assert_allclose(after.depth[3:-3, 18:28], 6.0, rtol=1e-5)
    np.testing.assert_allclose(after.albedo[:, :14], 0.4, rtol=1e-6)
    scene.remove("left")
    gone = look(renderer, scene, camera, quick)
    assert np.isinf(gone.depth[:, :14]).all()
    assert not gone.surface_mask[:, :14].any()
