"""Mitsuba scenes as ours: geometry, materials, lights and cameras, and what is refused or reported."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight.from_mitsuba import load
from tests.mitsuba.xml_scenes import scene_of, write

pytestmark = pytest.mark.mitsuba


def rendered(mi: Any, description: Any, spp: int = 256) -> Any:
    """Mitsuba's own picture of its own scene, direct light alone."""
    integrator = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 0})
    return np.array(mi.render(mi.load_dict(description), integrator=integrator, spp=spp, seed=3))


def small_scene(mi: Any, **light: Any) -> dict[str, Any]:
    T = mi.ScalarTransform4f
    film = {"type": "hdrfilm", "width": 40, "height": 30, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    return {
        "type": "scene",
        "eye": {
            "type": "perspective",
            "fov": 50,
            "to_world": T().look_at(origin=[1, 2, 6], target=[0, 1, 0], up=[0, 1, 0]),
            "film": film,
        },
        "floor": {
            "type": "rectangle",
            "to_world": T().rotate([1, 0, 0], -90).scale(4),
            "bsdf": {
                "type": "twosided",
                "b": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.5, 0.4]}},
            },
        },
        "box": {
            "type": "cube",
            "to_world": T().translate([0.3, 0.8, 0]).rotate([0, 1, 0], 30).scale([0.5, 0.8, 0.4]),
        },
        "lamp": {
            "type": "rectangle",
            "to_world": T().translate([0, 4, 1]).rotate([1, 0, 0], 80).scale([0.8, 0.5, 1]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [9, 8, 7]}},
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            **light,
        },
    }


# -- whole scenes: Mitsuba's picture of its own scene against its picture of ours


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_dict_scene_comes_back_the_same(mi: Any, mirrored: bool) -> None:
    T = mi.ScalarTransform4f
    texels = np.random.default_rng(0).uniform(0, 5, (3, 5, 3)).astype(np.float32)
    texels[0, 0] *= 30.0  # one bright corner
    radiance = {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True, "filter_type": "nearest"}
    changes: dict[str, Any] = {"emitter": {"type": "area", "radiance": radiance}}
    if mirrored:
        changes["to_world"] = T().translate([0, 4, 1]).rotate([1, 0, 0], 80).scale([-0.8, 0.5, 1])
    description = small_scene(mi, **changes)
    theirs = rendered(mi, description, 4096)
    scene = load(description)
    ours = ml.mitsuba.reference(scene, scene.cameras["eye"], 4096, pixel="box", cached=False)
    assert theirs.mean() > 0.01
    assert ml.metrics.relative_rmse(theirs, ours, trim=0.01) < 0.02
    assert abs(theirs.mean() / ours.mean.mean() - 1.0) < 0.003
    # negative control: the texture's columns the other way round
    lamp = scene.lights["lamp"]
    assert isinstance(lamp, ml.AreaLight)
    lamp.radiance = lamp.radiance[:, ::-1]
    turned = ml.mitsuba.reference(scene, scene.cameras["eye"], 1024, pixel="box", cached=False)
    assert ml.metrics.relative_rmse(theirs, turned, trim=0.01) > 0.025


def test_our_export_comes_back_as_lights_and_camera(mi: Any) -> None:
    scene, camera = (
        ml.Scene(),
        ml.Camera.from_intrinsics(
            [[40.0, 0, 12.5], [0, 40.0, 20.25], [0, 0, 1]],
            ml.Camera.look_at((1, 2, 3), (0, 0.5, 0)).world_from_camera,
            width=48,
            height=32,
        ),
    )
    texels = np.arange(18, dtype=np.float32).reshape(2, 3, 3)
    scene.add_light(ml.AreaLight((-1, 3, -1), (2, 0.1, 0), (0, 0, 2), radiance=texels), name="tv")
    scene.add_light(ml.SpotLight((0, 3, 0), (0.5, 0, 0), intensity=(5.0, 4.0, 3.0), cutoff=30.0), name="lamp")
    back = load(ml.mitsuba.to_dict(scene, camera))
    tv, lamp = back.lights["light0_tv"], back.lights["light1_lamp"]
    assert isinstance(tv, ml.AreaLight)
    assert isinstance(lamp, ml.SpotLight)
    np.testing.assert_allclose(
        [tv.corner, tv.edge_u, tv.edge_v], [(-1, 3, -1), (2, 0.1, 0), (0, 0, 2)], atol=1e-6
    )
    np.testing.assert_array_equal(tv.radiance, texels)
    np.testing.assert_allclose(lamp.direction, scene.lights["lamp"].direction, atol=1e-6)  # type: ignore[union-attr]
    np.testing.assert_allclose(back.cameras["sensor"].K, camera.K, rtol=1e-6)
    np.testing.assert_allclose(back.cameras["sensor"].world_from_camera, camera.world_from_camera, atol=1e-6)
    assert not back.report.notes


# -- sensors


@pytest.mark.parametrize(
    ("options", "size"),
    list(
        itertools.product(
            [
                {"fov": 40.0},
                {"fov": 40.0, "fov_axis": "y"},
                {"fov": 40.0, "fov_axis": "smaller"},
                {"fov": 40.0, "fov_axis": "larger"},
                {"fov": 40.0, "fov_axis": "diagonal"},
                {"focal_length": "35mm"},
                {},
                {"fov": 40.0, "principal_point_offset_x": 0.1, "principal_point_offset_y": -0.2},
                {"fov": 40.0, "crop": True},
            ],
            [(24, 16), (16, 24)],
        )
    ),
)
def test_sensors(mi: Any, options: dict[str, Any], size: tuple[int, int]) -> None:
    film: dict[str, Any] = {"type": "hdrfilm", "width": size[0], "height": size[1]}
    options = dict(options)
    if options.pop("crop", False):
        film.update(crop_width=10, crop_height=7, crop_offset_x=5, crop_offset_y=3)
    pose = mi.ScalarTransform4f().look_at(origin=[1, 2, 6], target=[0, 1, 0], up=[0.1, 1, 0])
    node = {"type": "perspective", "to_world": pose, "film": film, **options}
    camera = load({"type": "scene", "s": node}).cameras["s"]
    sensor = mi.load_dict(node)
    row, column = np.mgrid[: camera.height, : camera.width]
    position = mi.Point2f(
        ((column.ravel() + 0.5) / camera.width).astype(np.float32),
        ((row.ravel() + 0.5) / camera.height).astype(np.float32),
    )
    ray, _ = sensor.sample_ray(0.0, 0.5, position, mi.Point2f(0.5, 0.5))
    ours = camera.ray_directions().reshape(-1, 3)
    ours /= np.linalg.norm(ours, axis=1, keepdims=True)
    np.testing.assert_allclose(ours, np.array(ray.d).T, atol=2e-6)
    aside = camera.replace(fov_y=camera.fov_y * 1.01).ray_directions().reshape(-1, 3)  # negative control
    assert np.abs(aside / np.linalg.norm(aside, axis=1, keepdims=True) - np.array(ray.d).T).max() > 1e-4


# -- files


def test_parameters_includes_references(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(
        scene_of('<bsdf type="diffuse" id="red"><rgb name="reflectance" value="0.8, 0.1, $blue"/></bsdf>')
    )
    path = write(
        tmp_path,
        '<default name="blue" value="0.2"/><include filename="part.xml"/>',
        '<shape type="cube" id="a"><ref id="red"/></shape>',
        '<shape type="cube"><ref id="red"/><transform name="to_world"><translate x="3"/></transform></shape>',
    )
    scene = ml.Scene.from_mitsuba(path)
    np.testing.assert_allclose(scene.meshes["a"].material.albedo, (0.8, 0.1, 0.2), rtol=1e-6)
    assert list(scene.meshes) == ["a", "cube"]
    assert scene.meshes["a"].geometry is scene.meshes["cube"].geometry
    np.testing.assert_allclose(scene.meshes["cube"].bounds, [(2, -1, -1), (4, 1, 1)])
    np.testing.assert_allclose(load(path, blue=0.5).meshes["a"].material.albedo, (0.8, 0.1, 0.5), rtol=1e-6)


def test_obj_with_uvs_and_an_8_bit_image(tmp_path: Path) -> None:
    from PIL import Image

    pixels = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (128, 128, 128)]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "image.png")
    (tmp_path / "quad.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    texture = (
        '<texture name="reflectance" type="bitmap"><string name="filename" value="image.png"/></texture>'
    )
    bsdf = f'<bsdf type="twosided"><bsdf type="diffuse">{texture}</bsdf></bsdf>'
    flat = '<boolean name="face_normals" value="true"/>'
    body = f'<shape type="obj"><string name="filename" value="quad.obj"/>{flat}{bsdf}</shape>'
    scene = load(write(tmp_path, body))
    quad = scene.meshes["quad"]
    np.testing.assert_allclose(quad.material.albedo, ml.srgb_to_linear(pixels), atol=2e-3)
    assert quad.uvs is not None
    # an OBJ's v = 0 is at the bottom, and so is ours
    np.testing.assert_allclose(quad.uvs, quad.positions[:, :2], atol=1e-6)
    assert quad.shading == "flat"
    assert not scene.report.notes


def test_the_same_triangles_uvs_and_normals_as_mitsuba(mi: Any, tmp_path: Path) -> None:
    """A round trip through Mitsuba's shapes: nothing is lost, mirrored or smoothed."""
    ball = ml.shapes.displaced_sphere(500, radius=1.0)
    ball.export(tmp_path / "ball.ply")
    matrix = '<transform name="to_world"><scale x="2" y="-0.5" z="1"/><translate y="1"/></transform>'
    body = f'<shape type="ply"><string name="filename" value="ball.ply"/>{matrix}</shape>'
    mesh = load(write(tmp_path, body)).meshes["ball"]
    theirs = mi.traverse(mi.load_file(str(tmp_path / "scene.xml")).shapes()[0])
    world = mesh.positions @ mesh.transform[:3, :3].T + mesh.transform[:3, 3]
    np.testing.assert_allclose(world.ravel(), np.array(theirs["vertex_positions"]), atol=1e-6)
    np.testing.assert_array_equal(mesh.triangles.ravel(), np.array(theirs["faces"]))
    assert mesh.normals is not None
    normals = mesh.normals @ np.linalg.inv(mesh.transform[:3, :3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = np.abs((normals * np.array(theirs["vertex_normals"]).reshape(-1, 3)).sum(axis=1))
    assert np.quantile(facing, 0.01) > 0.99


# -- the scenes of others


@pytest.mark.scenes
@pytest.mark.parametrize(
    ("file", "meshes", "triangles", "notes"),
    [
        ("cornell_box/cbox-rgb.xml", 7, 36, 2),
        ("sponza_dabrovic/sponza.xml", 19, 66_445, 0),
        ("staircase/staircase.xml", 23, 249_786, 4),
    ],
)
def test_the_shared_scenes(scenes_folder: Path, file: str, meshes: int, triangles: int, notes: int) -> None:
    scene = ml.Scene.from_mitsuba(scenes_folder / file)
    assert (len(scene.meshes), scene.report.triangles) == (meshes, triangles)
    assert (len(scene.lights), len(scene.cameras)) == (1, 1)
    assert len(scene.report.notes) == notes


@pytest.mark.scenes
def test_cornell_matches_mitsubas_own_picture(mi: Any, scenes_folder: Path) -> None:
    path = scenes_folder / "cornell_box" / "cbox-rgb.xml"
    scene = load(path, res=48)
    loaded = mi.load_file(str(path), res="48")
    integrator = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 0})
    theirs = np.array(mi.render(loaded, integrator=integrator, spp=1024))
    (camera,) = scene.cameras.values()
    ours = ml.mitsuba.reference(scene, camera, 1024, pixel="box", cached=False)
    # where its luminaire reflects, ours is black: those pixels see the light
    seen = theirs.max(axis=-1) < 2.0
    assert ml.metrics.relative_rmse(theirs, ours, mask=seen, trim=0.005) < 0.03
    assert abs(theirs[seen].mean() / ours.mean[seen].mean() - 1.0) < 0.003
