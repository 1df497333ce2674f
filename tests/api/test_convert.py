"""trimesh meshes, scenes and files: transforms, instances, materials, textures, colours, cameras."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import MultiMaterial, PBRMaterial, SimpleMaterial

import miplight as ml
from miplight import shapes
from miplight.convert import image_to_linear

CODES = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 64, 32]]], dtype=np.uint8)


def quad(material: Any = None, uv: bool = True) -> trimesh.Trimesh:
    mesh = shapes.quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    if material is not None:
        mesh.visual = TextureVisuals(uv=mesh.visual.uv if uv else None, material=material)
    return mesh


def only(source: Any, **more: Any) -> tuple[Any, tuple[str, ...]]:
    """The one mesh of a scene, and its notes."""
    scene = ml.Scene.from_trimesh(source, **more)
    (name,) = scene.meshes
    return scene.meshes[name], scene.report[name].notes


def test_pbr_factor_is_linear() -> None:
    mesh, notes = only(quad(PBRMaterial(baseColorFactor=[0.8, 0.4, 0.2, 1.0], metallicFactor=0.0)))
    np.testing.assert_allclose(mesh.material.albedo, np.array([204, 102, 51], np.float32) / 255, rtol=1e-6)
    assert notes == ()


def test_pbr_texture_is_srgb_times_linear_factor() -> None:
    image = Image.fromarray(CODES)
    mesh, _ = only(quad(PBRMaterial(baseColorTexture=image, baseColorFactor=[255, 51, 255, 255])))
    expected = ml.srgb_to_linear(CODES) * np.array([1.0, 0.2, 1.0], np.float32)
    np.testing.assert_allclose(mesh.material.albedo, expected, rtol=1e-6)
    # negative control: taken for linear, the mid grey would be another colour
    assert np.abs(CODES / 255.0 * (1.0, 0.2, 1.0) - expected).max() > 0.1


def test_simple_material() -> None:
    mesh, _ = only(quad(SimpleMaterial(diffuse=[204, 102, 51, 255])))
    np.testing.assert_allclose(mesh.material.albedo, np.array([204, 102, 51], np.float32) / 255, rtol=1e-6)
    mesh, _ = only(quad(SimpleMaterial(image=Image.fromarray(CODES), diffuse=[9, 9, 9, 255])))
    np.testing.assert_allclose(mesh.material.albedo, ml.srgb_to_linear(CODES))


def test_no_material_is_grey() -> None:
    for mesh in (trimesh.creation.box(), shapes.quad((0, 0, 0), (1, 0, 0), (0, 1, 0))):
        found, notes = only(mesh)
        assert found.material == ml.Material()
        assert notes == ()
    grey = np.full((2, 2, 4), 100, np.uint8)  # nearly trimesh's filler: a picture all the same
    found, _ = only(quad(SimpleMaterial(image=Image.fromarray(grey))))
    assert found.material.is_textured


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"emissiveFactor": [1.0, 0.5, 0.0]}, "emission"),
        ({"emissiveTexture": Image.fromarray(CODES)}, "emission"),
        ({"baseColorFactor": [1.0, 1.0, 1.0, 0.1]}, "alpha"),
        ({"alphaMode": "MASK"}, "alpha"),
        ({"metallicFactor": 1.0}, "metallic"),
        ({"normalTexture": Image.fromarray(CODES)}, "normalTexture"),
    ],
)
def test_what_is_not_lit_is_reported(changes: dict[str, Any], word: str) -> None:
    _, notes = only(quad(PBRMaterial(**changes)))
    assert len(notes) == 1
    assert word in notes[0]


def test_texture_without_uvs() -> None:
    material = PBRMaterial(baseColorTexture=Image.fromarray(CODES), baseColorFactor=[0.2, 0.2, 0.2, 1.0])
    mesh, notes = only(quad(material, uv=False))
    np.testing.assert_allclose(mesh.material.albedo, [0.2, 0.2, 0.2], rtol=1e-6)
    assert "without UVs" in notes[0]


def test_uvs_that_are_not_finite() -> None:
    mesh = quad(PBRMaterial())
    mesh.visual.uv[2] = np.nan
    found, notes = only(mesh)
    assert found.uvs[2].tolist() == [0.0, 0.0]
    assert "1 UVs" in notes[0]


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "L", "LA", "P", "1", "CMYK"])
def test_images_of_any_mode(mode: str) -> None:
    grey = np.repeat(np.array([[0, 255], [255, 0]], np.uint8)[:, :, None], 3, axis=2)
    image = Image.fromarray(grey).convert(mode)
    np.testing.assert_allclose(image_to_linear(image), grey / 255.0, atol=1e-6)


def test_images_of_sixteen_bits_floats_and_arrays() -> None:
    deep = np.array([[0, 65535], [32768, 1]], np.uint16)
    np.testing.assert_array_equal(image_to_linear(Image.fromarray(deep))[..., 0], ml.srgb_to_linear(deep))
    floats = np.array([[0.25, 2.0], [np.nan, -1.0]], np.float32)
    np.testing.assert_array_equal(image_to_linear(Image.fromarray(floats))[..., 1], [[0.25, 1.0], [0.0, 0.0]])
    np.testing.assert_array_equal(image_to_linear(CODES), ml.srgb_to_linear(CODES))
    np.testing.assert_array_equal(image_to_linear(CODES[..., 0])[..., 2], ml.srgb_to_linear(CODES[..., 0]))


def test_an_image_that_is_cut_short_is_an_error_with_the_mesh_name() -> None:
    file = io.BytesIO()
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    Image.fromarray(noise).save(file, "JPEG")
    broken = Image.open(io.BytesIO(file.getvalue()[: len(file.getvalue()) // 2]))
    with pytest.raises(ml.SceneError, match="mesh 'mesh_0': its image cannot be read"):
        ml.Scene.from_trimesh(quad(SimpleMaterial(image=broken)))


def test_vertex_colours_are_srgb_unless_they_come_from_gltf(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    codes = np.column_stack([np.arange(8) * 30, np.full(8, 128), np.full(8, 7), np.full(8, 255)]).astype(
        np.uint8
    )
    box.visual = ColorVisuals(box, vertex_colors=codes)
    mesh, _ = only(box)
    np.testing.assert_allclose(mesh.colors, ml.srgb_to_linear(codes[:, :3]))
    assert mesh.material.albedo.tolist() == [1.0, 1.0, 1.0]
    for suffix, expected in ((".ply", ml.srgb_to_linear(codes[:, :3])), (".glb", codes[:, :3] / 255.0)):
        path = tmp_path / f"box{suffix}"
        box.export(path)
        mesh, _ = only(path)
        np.testing.assert_allclose(mesh.colors, expected, rtol=1e-6)


def test_colours_beside_a_texture_multiply_it() -> None:
    mesh = quad(PBRMaterial(baseColorFactor=[0.4, 0.4, 0.4, 1.0]))
    mesh.visual.vertex_attributes["color"] = np.tile(np.array([65535, 32768, 0, 65535], np.uint16), (4, 1))
    found, notes = only(mesh)
    np.testing.assert_allclose(found.colors[0], [1.0, 32768 / 65535, 0.0], rtol=1e-6)
    np.testing.assert_allclose(found.material.albedo, [0.4, 0.4, 0.4], rtol=1e-6)
    assert notes == ()


@pytest.mark.parametrize("shading", ["smooth", "flat"])
def test_face_colours_split_the_mesh(shading: Any) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    codes = np.random.default_rng(1).integers(0, 256, (len(ball.faces), 4), dtype=np.uint8)
    codes[:, 3] = 255
    ball.visual = ColorVisuals(ball, face_colors=codes)
    mesh, _ = only(ball, shading=shading)
    assert len(mesh.positions) == 3 * len(ball.faces)
    np.testing.assert_allclose(mesh.colors, np.repeat(ml.srgb_to_linear(codes[:, :3]), 3, axis=0))
    np.testing.assert_array_equal(mesh.positions[mesh.triangles], ball.vertices[ball.faces])
    if shading == "smooth":  # split for its colours, smooth as before
        np.testing.assert_allclose(mesh.normals, ball.vertex_normals[ball.faces].reshape(-1, 3), atol=1e-6)
    else:
        assert mesh.normals is None


def test_a_material_per_face() -> None:
    mesh = quad()
    parts = [PBRMaterial(baseColorFactor=[1.0, 0.0, 0.0, 1.0]), SimpleMaterial(image=Image.fromarray(CODES))]
    mesh.visual = TextureVisuals(material=MultiMaterial(parts), face_materials=[0, 1])
    found, notes = only(mesh)
    np.testing.assert_allclose(found.colors[0], [1, 0, 0])
    np.testing.assert_allclose(found.colors[3], ml.srgb_to_linear(CODES).mean(axis=(0, 1)), rtol=1e-5)
    assert "mean colour" in notes[0]
    mesh.visual = TextureVisuals(material=MultiMaterial(parts))
    found, notes = only(mesh)
    assert found.material == ml.Material((1.0, 0.0, 0.0))
    assert "the first is used" in notes[0]


def test_a_material_of_your_own_replaces_the_visual() -> None:
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.full((8, 4), 99, np.uint8)
    scene = ml.Scene()
    scene.add_mesh(box, name="box", material=ml.Material((0.1, 0.2, 0.3)))
    assert scene.meshes["box"].colors is None
    assert scene.meshes["box"].material == ml.Material((0.1, 0.2, 0.3))
    textured = quad(PBRMaterial(emissiveFactor=[1, 1, 1]))
    scene.add_mesh(textured, name="quad", material=ml.Material(np.full((2, 2, 3), 0.5)))
    assert scene.meshes["quad"].uvs is not None
    assert scene.report["quad"].notes == ()


def test_normals_of_the_file_are_used_and_others_computed() -> None:
    tilted = np.tile([1.0, 0.0, 2.0], (4, 1))
    plain = quad()
    given = trimesh.Trimesh(plain.vertices, plain.faces, vertex_normals=tilted, process=False)
    mesh, _ = only(given)
    np.testing.assert_allclose(mesh.normals, tilted / np.sqrt(5.0), rtol=1e-6)
    mesh, _ = only(plain)
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (4, 1)), atol=1e-7)
    tilted = np.where(np.arange(4)[:, None] == 2, np.nan, tilted)
    broken = trimesh.Trimesh(plain.vertices, plain.faces, vertex_normals=tilted, process=False)
    mesh, notes = only(broken)
    np.testing.assert_allclose(mesh.normals[2], [0, 0, 1], atol=1e-7)
    assert "1 normals" in notes[0]


def test_scene_graphs_keep_transforms_and_share_instances() -> None:
    source = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(0.3, (1, 2, 3), (4, 5, 6))
    source.add_geometry(shapes.box(), geom_name="box", node_name="parent", transform=turn)
    move = np.diag([1.0, 2.0, -1.0, 1.0])
    source.graph.update("child", frame_from="parent", matrix=move, geometry="box")
    scene = ml.Scene.from_trimesh(source)
    assert list(scene.meshes) == ["parent", "child"]
    assert scene.meshes["parent"].geometry is scene.meshes["child"].geometry
    np.testing.assert_allclose(scene.meshes["child"].transform, turn @ move, atol=1e-12)
    singular = source.copy()
    singular.graph.update("child", frame_from="parent", matrix=np.diag([1.0, 0.0, 1.0, 1.0]), geometry="box")
    with pytest.raises(ml.SceneError, match="mesh 'child': transform is"):
        ml.Scene.from_trimesh(singular)


def test_meshes_with_one_image_share_one_texture() -> None:
    image = Image.fromarray(CODES)
    source = trimesh.Scene()
    for k in range(2):
        source.add_geometry(quad(PBRMaterial(baseColorTexture=image, name=str(k))), node_name=f"q{k}")
    source.add_geometry(
        quad(PBRMaterial(baseColorTexture=image, baseColorFactor=[9, 9, 9, 255])), node_name="q2"
    )
    scene = ml.Scene.from_trimesh(source)
    first, second, third = (scene.meshes[f"q{k}"].material for k in range(3))
    assert first is second
    assert third != first


def test_lists_and_names() -> None:
    named = shapes.box()
    named.metadata["name"] = "crate"
    source = trimesh.Scene()
    source.add_geometry(quad(), node_name="crate")
    scene = ml.Scene.from_trimesh([named, shapes.box((2, 1, 1)), source, shapes.box()])
    assert list(scene.meshes) == ["crate", "mesh_1", "crate_1", "mesh_3"]
    assert scene.meshes["crate"].geometry is scene.meshes["mesh_3"].geometry


def test_what_is_no_mesh_is_left_out_and_reported() -> None:
    source = trimesh.Scene([shapes.box()])
    source.add_geometry(trimesh.PointCloud(np.eye(3)), node_name="dots")
    scene = ml.Scene.from_trimesh(source)
    assert len(scene.meshes) == 1
    assert "dots (PointCloud)" in scene.report.notes[0]
    assert "dots" in repr(scene.report)
    assert len(ml.Scene.from_trimesh(trimesh.Scene()).meshes) == 0


def test_cameras_come_along() -> None:
    source = trimesh.Scene([shapes.box()])
    assert ml.Scene.from_trimesh(source).cameras == {}
    source.camera = trimesh.scene.Camera("eye", resolution=(640, 480), fov=(60, 45))
    pose = trimesh.transformations.rotation_matrix(0.4, (0, 1, 0))
    source.camera_transform = pose
    camera = ml.Scene.from_trimesh(source).cameras["eye"]
    assert (camera.width, camera.height) == (640, 480)
    assert camera.fov_y == pytest.approx(45.0)
    np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-12)
    source.camera = trimesh.scene.Camera("lens", resolution=(640, 480), focal=(500, 510))
    source.camera_transform = pose
    np.testing.assert_allclose(ml.Scene.from_trimesh(source).cameras["lens"].K[[0, 1], [0, 1]], [500, 510])


@pytest.mark.parametrize("source", [None, 3, ["a.obj"], [shapes.box(), None], np.zeros((3, 3))])
def test_bad_sources(source: Any) -> None:
    with pytest.raises(ml.SceneError, match="source"):
        ml.Scene.from_trimesh(source)
    with pytest.raises(ml.SceneError, match="shading"):
        ml.Scene.from_trimesh(shapes.box(), shading="phong")  # type: ignore[arg-type]


def test_files_that_are_missing_or_cut_short(tmp_path: Path) -> None:
    with pytest.raises(ml.SceneError, match="no such file"):
        ml.Scene.from_trimesh(tmp_path / "none.glb")
    whole = tmp_path / "whole.glb"
    shapes.room().export(whole)
    assert len(ml.Scene.from_trimesh(str(whole)).meshes) == 7
    broken = tmp_path / "broken.glb"
    broken.write_bytes(whole.read_bytes()[:900])
    with pytest.raises(ml.SceneError, match=r"broken\.glb.*cannot be read"):
        ml.Scene.from_trimesh(broken)
    strange = tmp_path / "strange.xyzzy"
    strange.write_text("hello")
    with pytest.raises(ml.SceneError, match="cannot be read"):
        ml.Scene.from_trimesh(strange)


@pytest.mark.scenes
@pytest.mark.parametrize(
    ("file", "meshes", "triangles", "textured"),
    [
        ("cornell_box/cornell_box.glb", 7, 36, 0),
        ("sponza_dabrovic/sponza.glb", 19, 66_445, 17),
        ("spot/spot.glb", 1, 5_856, 1),
        ("spot/spot_triangulated.obj", 1, 5_856, 0),
        ("meshes/bunny.ply", 1, 69_451, 0),
        ("meshes/suzanne.obj", 1, 968, 0),
    ],
)
def test_real_files(scenes_folder: Path, file: str, meshes: int, triangles: int, textured: int) -> None:
    scene = ml.Scene.from_trimesh(scenes_folder / file)
    assert len(scene.meshes) == meshes
    assert scene.report.triangles + scene.report.dropped == triangles
    assert sum(mesh.material.is_textured for mesh in scene.meshes.values()) == textured
    for mesh in scene.meshes.values():
        assert mesh.normals is not None
        assert np.isfinite(mesh.normals).all()


@pytest.mark.scenes
def test_glass_and_metal_of_a_real_scene_are_reported(scenes_folder: Path) -> None:
    scene = ml.Scene.from_trimesh(scenes_folder / "staircase/staircase.glb")
    notes = {name: report.notes for name, report in scene.report.items() if report.notes}
    assert set(notes) >= {"Glass", "Brass", "Gold"}
    assert "alpha" in notes["Glass"][0]
    assert "metallic" in notes["Brass"][0]
    assert "WhitePaint" not in notes
