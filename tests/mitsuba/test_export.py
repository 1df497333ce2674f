"""What `to_dict` hands to Mitsuba, held against formulas; each check also fails on a disturbed input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
import mitsuba
from tests.mitsuba.closed_forms import (
    floor_under,
    interpolate,
    light_patches,
    plane_hits,
    polygon_irradiance,
    view_down,
)

pytestmark = pytest.mark.mitsuba

CAMERAS = {
    "centred": ml.Camera.look_at((1, 2, 5), (0, 0.5, 0), fov_y=50, width=48, height=32),
    "tall": ml.Camera.look_at((-3, 1, 2), (0, 1, 0), fov_y=70, width=20, height=45),
    "shifted": ml.Camera.from_intrinsics(
        [[40.0, 0, 12.5], [0, 40.0, 20.25], [0, 0, 1]], np.eye(4), width=48, height=32
    ),
    "not square": ml.Camera.from_intrinsics([[40.0, 0, 12.5], [0, 55.0, 20], [0, 0, 1]], np.eye(4), 48, 32),
}
FLOOR_VIEW = view_down(up=2.0, fov_y=90)
ASYMMETRIC = np.array(
    [[(9, 1, 0), (1, 5, 2), (0, 1, 3)], [(1, 1, 1), (4, 0, 7), (2, 8, 1)]], dtype=np.float32
)


def picture(scene: ml.Scene, camera: ml.Camera, spp: int = 16, **options: Any) -> NDArray[np.float32]:
    return ml.mitsuba.reference(scene, camera, spp, cached=False, **options).mean


def relative_error(test: Any, truth: Any) -> float:
    return float(np.sqrt(np.mean((np.asarray(test) - truth) ** 2)) / np.mean(truth))


def area_light(**changes: Any) -> ml.AreaLight:
    options: dict[str, Any] = {"radiance": (4.0, 3.0, 2.0), **changes}
    edges = options.pop("edges", ((2.0, 0, 0), (0, 0, 1.5)))
    return ml.AreaLight((-1.2, 3.0, -0.5), *edges, **options)


# -- sensors


@pytest.mark.parametrize("name", ["centred", "tall", "shifted"])
def test_mitsubas_own_sensor_has_our_rays(mi: Any, name: str) -> None:
    camera, scene = CAMERAS[name], ml.Scene()
    floor_under(scene)
    sensor = mi.load_dict(ml.mitsuba.to_dict(scene, camera)).sensors()[0]
    assert "Perspective" in str(type(sensor).__name__) or "perspective" in str(sensor).lower()
    assert _ray_error(mi, sensor, camera) < 2e-6
    # negative control: a camera whose principal point is one pixel aside
    K = camera.K
    K[0, 2] += 1.0
    assert _ray_error(mi, sensor, camera.replace(K=K)) > 5e-3


@pytest.mark.parametrize("name", list(CAMERAS))
def test_our_sensor_goes_through_pixel_centres(mi: Any, name: str) -> None:
    camera, scene = CAMERAS[name], ml.Scene()
    floor_under(scene)
    sensor = mi.load_dict(ml.mitsuba.to_dict(scene, camera, pixel="center")).sensors()[0]
    for offset in ((0.5, 0.5), (0.01, 0.98)):
        assert _ray_error(mi, sensor, camera, offset) < 2e-6


def _ray_error(mi: Any, sensor: Any, camera: ml.Camera, offset: tuple[float, float] = (0.5, 0.5)) -> float:
    """Largest distance between unit directions of the sensor and of the camera; origins count, too."""
    row, column = np.mgrid[: camera.height, : camera.width]
    position = mi.Point2f(
        ((column.ravel() + offset[0]) / camera.width).astype(np.float32),
        ((row.ravel() + offset[1]) / camera.height).astype(np.float32),
    )
    ray, _ = sensor.sample_ray_differential(0.0, 0.5, position, mi.Point2f(0.5, 0.5))
    ours = camera.ray_directions().reshape(-1, 3)
    ours /= np.linalg.norm(ours, axis=1, keepdims=True)
    directions, origins = np.array(ray.d).T, np.array(ray.o).T
    along = (
        np.einsum("ij,ij->i", origins - camera.origin, ours)[:, None] * ours
    )  # near clip moves along the ray
    return float(max(np.abs(directions - ours).max(), np.abs(origins - camera.origin - along).max()))


def test_nothing_near_or_far_is_clipped(mi: Any) -> None:
    scene, camera = ml.Scene(), ml.Camera.look_at((0, 1, 0), (0, 1, -1), fov_y=40, width=8, height=8)
    floor_under(scene, size=2000.0)
    scene.add_light(ml.SpotLight((0, 5, 0), (0, 0, -2), intensity=(1.0, 1.0, 1.0), cutoff=80.0))
    node = ml.mitsuba.to_dict(scene, camera)["sensor"]
    assert node["near_clip"] < 0.05
    assert node["far_clip"] > 1000.0
    image = np.array(mi.render(mi.load_dict(ml.mitsuba.to_dict(scene, camera, spp=4))))
    assert image[-1].min() > 0.0


# -- pixels


def checkered_wall() -> tuple[ml.Scene, ml.Camera, NDArray[np.float64], NDArray[np.bool_]]:
    """Random texels that fill the view, what is seen at pixel centres, and where that is certain."""
    rng = np.random.default_rng(1)
    texels = rng.uniform(0.5, 2.0, (47, 61, 3)).astype(np.float32)
    scene = ml.Scene()
    scene.add_light(ml.AreaLight((-2, -2, 0), (4, 0, 0), (0, 4, 0), radiance=texels))
    camera = ml.Camera.look_at((0.3, 0.2, 2.5), (0.1, 0, 0), fov_y=40, width=45, height=31)
    hits = plane_hits(camera, (0, 0, 0), (0, 0, 1))
    x, y = (hits[..., 0] + 2) / 4 * 61, (2 - hits[..., 1]) / 4 * 47
    certain = (np.abs(x - np.rint(x)) > 1e-3) & (np.abs(y - np.rint(y)) > 1e-3)
    return scene, camera, texels[y.astype(int), x.astype(int)].astype(np.float64), certain


def test_centre_samples_all_meet_the_pixel_centre() -> None:
    scene, camera, expected, certain = checkered_wall()
    centre = ml.mitsuba.reference(scene, camera, 64, cached=False)
    assert certain.mean() > 0.98
    assert np.abs(centre.mean - expected)[certain].max() < 1e-5
    assert centre.variance.max() < 1e-10
    # negative control: spread over the pixel, texels mix
    box = ml.mitsuba.reference(scene, camera, 64, pixel="box", cached=False)
    assert np.abs(box.mean - expected)[certain].mean() > 0.05
    assert box.variance.mean() > 1e-4


def test_centre_sensor_renders_the_same(mi: Any) -> None:
    scene, camera, expected, certain = checkered_wall()
    loaded = mi.load_dict(ml.mitsuba.to_dict(scene, camera, pixel="center"))
    image = np.array(mi.render(loaded, spp=16))
    # a sample on a pixel's very border may round into the next: 1 in 1e5
    assert np.quantile(np.abs(image - expected)[certain], 0.99) < 1e-5


# -- area lights


@pytest.mark.parametrize("visible", [True, False])
@pytest.mark.parametrize("filter_name", ["constant", "nearest", "linear"])
@pytest.mark.parametrize("edges", ["rectangle", "sheared"])
def test_floor_under_an_area_light(visible: bool, filter_name: str, edges: str) -> None:
    shape = {
        "rectangle": ((2.0, 0, 0), (0, 0, 1.5)),
        "sheared": ((2.0, 0.3, 0.4), (0.9, -0.2, 1.2)),
    }[edges]
    options: dict[str, Any] = {"edges": shape, "visible": visible}
    if filter_name != "constant":
        options.update(radiance=ASYMMETRIC, filter=filter_name)
    light = area_light(**options)
    scene = ml.Scene()
    floor_under(scene)
    scene.add_light(light)
    truth = ml.mitsuba.reference(scene, FLOOR_VIEW, 4096, cached=False)
    formula = _lit_floor(light, fine=8 if filter_name == "linear" else 1)
    assert ml.metrics.relative_rmse(formula, truth) < 0.002
    # negative controls: a tenth of a unit aside, and the texture's rows the other way round
    aside = area_light(**options)
    aside.corner = aside.corner + np.array((0.1, 0, 0))
    assert ml.metrics.relative_rmse(_lit_floor(aside, fine=2), truth) > 0.01
    if filter_name != "constant":
        turned = area_light(**{**options, "radiance": ASYMMETRIC[::-1]})
        assert ml.metrics.relative_rmse(_lit_floor(turned, fine=2), truth) > 0.03


def _lit_floor(light: ml.AreaLight, fine: int) -> NDArray[np.float64]:
    hits = plane_hits(FLOOR_VIEW, (0, 0, 0), (0, 1, 0))
    total = np.zeros_like(hits)
    for corners, radiance in light_patches(light, fine):
        total += polygon_irradiance(hits, (0, 1, 0), corners)[..., None] * radiance
    return total * 0.5 / np.pi


@pytest.mark.parametrize("two_sided", [False, True])
def test_texture_is_upright_from_the_lit_side(two_sided: bool) -> None:
    scene = ml.Scene()
    scene.add_light(ml.AreaLight((-3, -2, 0), (6, 0, 0), (0, 4, 0), radiance=ASYMMETRIC, two_sided=two_sided))
    fov_y = 2 * np.degrees(np.arctan(2 / 6))
    front = ml.Camera.look_at((0, 0, 6), (0, 0, 0), fov_y=fov_y, width=3, height=2)
    back = ml.Camera.look_at((0, 0, -6), (0, 0, 0), fov_y=front.fov_y, width=3, height=2)
    np.testing.assert_allclose(picture(scene, front), ASYMMETRIC, rtol=1e-5)
    expected = ASYMMETRIC[:, ::-1] if two_sided else np.zeros_like(ASYMMETRIC)
    np.testing.assert_allclose(picture(scene, back), expected, rtol=1e-5)
    assert not np.allclose(ASYMMETRIC, ASYMMETRIC[::-1])  # negative control: rows matter


def test_two_sided_light_lights_both_ways() -> None:
    scene, camera = ml.Scene(), FLOOR_VIEW
    floor_under(scene)
    light = area_light(two_sided=True)
    light.set_geometry(edge_u=light.edge_v, edge_v=light.edge_u)  # the front now faces away from the floor
    scene.add_light(light)
    assert relative_error(picture(scene, camera, 1024), _lit_floor(area_light(), 1)) < 0.003
    light.two_sided = False
    assert picture(scene, camera).max() == 0.0  # negative control


def test_invisible_light_is_no_surface() -> None:
    scene, camera = ml.Scene(), view_down(up=5.0, fov_y=60)  # looks through where the light is
    floor_under(scene)
    scene.add_light(area_light(visible=False), name="low")
    spot = ml.SpotLight((0, 8, 0), (0, 0, 0), intensity=(40.0, 40.0, 40.0), cutoff=60)
    alone = picture(scene, camera, 256)
    scene.add_light(spot, name="spot")
    both = picture(scene, camera, 256)
    hits = plane_hits(camera, (0, 0, 0), (0, 1, 0))
    expected = _spot_radiance(hits, spot)
    assert relative_error(both - alone, expected) < 0.01  # the spot shines through the invisible light
    scene.lights["low"].visible = True  # type: ignore[union-attr]
    assert relative_error(picture(scene, camera, 256) - alone, expected) > 0.1  # negative control


@pytest.mark.parametrize("visible", [True, False])
def test_furnace(visible: bool) -> None:
    """A convex body in a box whose six walls shine with radiance 1 has the radiance of its albedo."""
    scene = ml.Scene()
    ball = ml.shapes.displaced_sphere(2000, radius=0.7, amplitude=0.0)
    scene.add_mesh(ball, material=ml.Material((0.8, 0.5, 0.2)))
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corner, u, v = np.full(3, -2.0), np.zeros(3), np.zeros(3)
            corner[axis] = 2.0 * sign
            u[(axis + 1) % 3] = v[(axis + 2) % 3] = 4.0
            u, v = (u, v) if sign < 0 else (v, u)
            scene.add_light(ml.AreaLight(corner, u, v, radiance=(1.0, 1.0, 1.0), visible=visible))
    camera = ml.Camera.look_at((0, 0, 1.9), (0, 0, 0), fov_y=20, width=16, height=16)
    image = picture(scene, camera, 4096)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), (0.8, 0.5, 0.2), rtol=3e-3)
    np.testing.assert_allclose(image, np.broadcast_to((0.8, 0.5, 0.2), image.shape), rtol=0.03)


# -- spot lights


def _spot_radiance(hits: NDArray[np.float64], spot: ml.SpotLight) -> NDArray[np.float64]:
    offset = spot.position - hits
    distance = np.linalg.norm(offset, axis=-1)
    inside = -(offset @ spot.direction) / distance > np.cos(np.radians(spot.cutoff))
    value = 0.5 / np.pi * inside * offset[..., 1] / distance**3
    return value[..., None] * spot.intensity.astype(np.float64)


@pytest.mark.parametrize("cutoff", [10.0, 30.0, 80.0])
def test_spot_is_even_with_a_hard_edge(cutoff: float) -> None:
    spot = ml.SpotLight((0.4, 3, 0.2), (0.1, 0, -0.3), intensity=(50.0, 20.0, 5.0), cutoff=cutoff)
    scene, camera = ml.Scene(), view_down(64, 64)
    floor_under(scene)
    scene.add_light(spot)
    hits = plane_hits(camera, (0, 0, 0), (0, 1, 0))
    offset = hits - spot.position
    angle = np.degrees(np.arccos(offset @ spot.direction / np.linalg.norm(offset, axis=-1)))
    certain = np.abs(angle - cutoff) > 1e-3
    image, expected = picture(scene, camera), _spot_radiance(hits, spot)
    np.testing.assert_allclose(image[certain], expected[certain], rtol=2e-4, atol=1e-6)
    wider = _spot_radiance(hits, ml.SpotLight(spot.position, spot.target, spot.intensity, cutoff * 0.9))
    assert cutoff == 80.0 or not np.allclose(image[certain], wider[certain], rtol=2e-4)  # negative control


# -- meshes


def lit_triangle(**mesh: Any) -> tuple[ml.Scene, ml.Camera, NDArray[np.float64], ml.SpotLight]:
    """One large triangle below a spot, a view that it fills, and the barycentrics of the pixels."""
    corners = np.array([(-8.0, 0, 6.0), (9.0, 0, 7.0), (0.5, 0, -11.0)])
    scene, camera = ml.Scene(), view_down(24, 20, up=5.0)
    spot = ml.SpotLight((1.0, 4.0, 0.5), (0, 0, 0), intensity=(30.0, 30.0, 30.0), cutoff=70)
    transform = mesh.pop("transform", np.eye(4))
    inverse = np.linalg.inv(transform)
    scene.add_arrays(corners @ inverse[:3, :3].T + inverse[:3, 3], [(0, 1, 2)], transform=transform, **mesh)
    scene.add_light(spot)
    hits = plane_hits(camera, (0, 0, 0), (0, 1, 0))
    weights = np.linalg.solve(
        np.vstack([corners[:, [0, 2]].T, np.ones(3)]),
        np.dstack([hits[..., [0, 2]], np.ones(hits.shape[:2])]).reshape(-1, 3).T,
    )
    return scene, camera, weights.T.reshape(*hits.shape[:2], 3), spot


def _reflected(camera: ml.Camera, spot: ml.SpotLight, normals: Any, albedo: Any) -> NDArray[np.float64]:
    hits = plane_hits(camera, (0, 0, 0), (0, 1, 0))
    offset = spot.position - hits
    distance = np.linalg.norm(offset, axis=-1)
    cosine = (offset * normals).sum(axis=-1) / distance
    value = cosine / distance**2 / np.pi * 30.0
    return value[..., None] * np.asarray(albedo)


@pytest.mark.parametrize("stretched", [False, True])
def test_smooth_and_flat_normals(stretched: bool) -> None:
    given = np.array([(0.3, 1.0, 0.1), (-0.2, 1.0, 0.2), (0.1, 1.0, -0.4)])
    matrix = np.diag([2.0, 0.5, -3.0, 1.0]) if stretched else np.eye(4)
    world = given @ np.linalg.inv(matrix[:3, :3])
    world /= np.linalg.norm(world, axis=1, keepdims=True)
    expected = {}
    for shading in ("smooth", "flat"):
        scene, camera, weights, spot = lit_triangle(
            normals=given if shading == "smooth" else None, shading=shading, transform=matrix
        )
        normals = weights @ world if shading == "smooth" else np.broadcast_to((0.0, 1.0, 0.0), weights.shape)
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        expected[shading] = _reflected(camera, spot, normals, (0.5, 0.5, 0.5))
        np.testing.assert_allclose(picture(scene, camera), expected[shading], rtol=5e-4)
    assert relative_error(expected["smooth"], expected["flat"]) > 0.01  # negative control


@pytest.mark.parametrize("colored", [False, True])
@pytest.mark.parametrize("textured", [False, True])
def test_albedo_is_image_times_vertex_colour(colored: bool, textured: bool) -> None:
    rng = np.random.default_rng(3)
    texels = rng.uniform(0.1, 1.0, (5, 7, 3)).astype(np.float32)
    uvs = np.array([(-0.7, 0.2), (2.4, 0.1), (0.8, 1.9)])
    colors = rng.uniform(0.1, 1.0, (3, 3)) if colored else None
    albedo: Any = texels if textured else np.array([0.9, 0.6, 0.3], np.float32)
    scene, camera, weights, spot = lit_triangle(
        uvs=uvs, colors=colors, material=ml.Material(albedo), shading="flat"
    )
    uv = weights @ uvs
    value: Any = (
        interpolate(texels.astype(np.float64), uv[..., 0], 1.0 - uv[..., 1], repeat=True)
        if textured
        else albedo
    )
    if colors is not None:
        value = value * (weights @ colors)
    expected = _reflected(camera, spot, (0.0, 1.0, 0.0), value)
    np.testing.assert_allclose(picture(scene, camera), expected, rtol=2e-3)
    if textured:  # negative control: the image upside down
        upset = interpolate(texels.astype(np.float64), uv[..., 0], uv[..., 1], repeat=True)
        assert relative_error(_reflected(camera, spot, (0.0, 1.0, 0.0), upset), expected) > 0.1


def test_surfaces_reflect_on_both_sides() -> None:
    scene, camera = lit_triangle(shading="flat")[:2]
    turned = lit_triangle(shading="flat")[0]
    mesh = turned.meshes["mesh_0"]
    turned.remove("mesh_0")
    turned.add_arrays(mesh.positions, mesh.triangles[:, ::-1], shading="flat")
    np.testing.assert_allclose(picture(scene, camera), picture(turned, camera), rtol=1e-5)
    assert picture(turned, camera).min() > 0.0


def test_triangles_that_are_not_finite_are_left_out(mi: Any) -> None:
    scene = ml.Scene()
    positions = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (np.nan, 0, 0)]
    scene.add_arrays(positions, [(0, 1, 2), (1, 2, 3)], name="a.b/c", shading="flat")
    (key,) = (name for name in ml.mitsuba.to_dict(scene) if name.startswith("mesh"))
    mesh = mi.load_dict(ml.mitsuba.to_dict(scene)).shapes()[0]
    assert "." not in key
    assert "/" not in key
    assert (mesh.face_count(), mesh.vertex_count()) == (1, 3)


def test_anchor_moves_everything(mi: Any) -> None:
    scene = ml.Scene()
    floor_under(scene)
    scene.add_light(area_light())
    scene.add_light(area_light(visible=False))
    scene.add_light(ml.SpotLight((1, 2, 3), (0, 0, 0)))
    far = np.array([1e6, -2e6, 3e6])
    moved = mi.load_dict(ml.mitsuba.to_dict(scene, view_down(), anchor=-far)).bbox()
    plain = mi.load_dict(ml.mitsuba.to_dict(scene, view_down())).bbox()
    np.testing.assert_allclose(np.array(moved.min) - far, np.array(plain.min), atol=0.5)


# -- refusals


def test_variants_that_are_not_rgb_are_refused() -> None:
    before = mitsuba.variant()
    mitsuba.set_variant("scalar_spectral")
    try:
        with pytest.raises(ml.SceneError, match=r"variant is 'scalar_spectral'; allowed: llvm_ad_rgb"):
            ml.mitsuba.to_dict(ml.Scene())
    finally:
        if before is not None:
            mitsuba.set_variant(before)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pixel": "centre"}, r"pixel is 'centre'; allowed: 'box', 'center'"),
        ({"max_depth": 1}, r"max_depth is 1; allowed: a whole number, 2 or more"),
        ({"spp": 0}, r"spp is 0"),
        ({"anchor": (0, 1)}, r"anchor is \(0, 1\); allowed: 3 finite numbers"),
    ],
)
def test_bad_arguments(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ml.SceneError, match=message):
        ml.mitsuba.to_dict(ml.Scene(), view_down(), **options)


def test_an_empty_scene_is_black() -> None:
    assert picture(ml.Scene(), view_down()).max() == 0.0
