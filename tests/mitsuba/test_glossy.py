"""Glossy scenes in references and in Mitsuba's dictionaries, held against float64 quadrature."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight.mitsuba import plugins
from tests.mitsuba.closed_forms import (
    floor_under,
    glossy_radiance,
    interpolate,
    phong,
    plane_hits,
    view_down,
)
from tests.mitsuba.reference_scenes import glossy_floor, load

pytestmark = pytest.mark.mitsuba


# -- pictures


@pytest.mark.parametrize("n", [10.0, 200.0])
def test_a_rectangle_in_a_glossy_floor(n: float) -> None:
    scene, camera, light = ml.Scene(), *_view_and_rectangle()
    material = ml.Material((0.1, 0.15, 0.2), specular=(0.6, 0.5, 0.4), shininess=n)
    floor_under(scene)
    scene.set_material("floor", material)
    scene.add_light(light)
    points = plane_hits(camera, (0, 0, 0), (0, 1, 0)).reshape(-1, 3)
    truth = glossy_radiance(camera, points, material, light, 48).reshape(12, 16, 3)
    result = ml.mitsuba.reference(scene, camera, 16384, part="direct", cached=False)
    assert result.relative_noise < 0.01
    for picture in (result.mean, *result.halves):
        assert ml.metrics.relative_rmse(picture, truth) < 2.5 * result.relative_noise + 1e-3
        assert abs(picture.mean() / truth.mean() - 1.0) < 0.003
    assert not np.array_equal(*result.halves)
    # the noise that is told is the noise that is there
    z = (result.mean - truth) / np.sqrt(result.variance + (1e-4 * truth) ** 2)
    assert 0.7 < z.std() < 1.3
    # negative control: a tenth more shininess
    other = glossy_radiance(camera, points, material.replace(shininess=1.1 * n), light, 48)
    assert ml.metrics.relative_rmse(result.mean, other.reshape(12, 16, 3)) > 0.015


def _view_and_rectangle() -> tuple[ml.Camera, ml.AreaLight]:
    camera = ml.Camera.look_at((0.0, 1.5, 3.0), (0.0, 0.0, 1.0), fov_y=34, width=16, height=12)
    return camera, ml.AreaLight((-0.8, 0.4, -1.6), (1.5, 0, 0), (0, 1.0, 0), radiance=(4.0, 5.0, 6.0))


@pytest.mark.parametrize("n", [10, 1000])
def test_the_stored_floor_without_shadows(n: int) -> None:
    """What the renderer is held against, from its texels: every 7th pixel of the floor."""
    stored = load(f"glossy_floor_{n}")
    scene, camera = glossy_floor(n)
    (light,) = scene.lights.values()
    points = plane_hits(camera, (0, 0, 0), (0, 1, 0))
    rows, columns = (axis.ravel() for axis in np.mgrid[40:96:7, 3:96:7])
    points = points[rows, columns]
    assert (np.abs(points[:, 0]) < 2.5).all()
    truth = glossy_radiance(camera, points, scene.meshes["floor"].material, light, 3)
    seen = stored.mean[rows, columns]
    assert np.sqrt(np.mean((seen - truth) ** 2)) < 0.015 * truth.mean()
    assert abs(seen.mean() / truth.mean() - 1.0) < 0.003
    assert np.sqrt(np.mean((seen - truth[::-1]) ** 2)) > 0.3 * truth.mean()  # negative control


@pytest.mark.parametrize("colored", [False, True])
def test_albedo_images_and_vertex_colours_count(colored: bool) -> None:
    """Under a spot there is no noise: the picture is the formula."""
    texels = np.random.default_rng(3).uniform(0.1, 0.7, (5, 7, 3)).astype(np.float32)
    lobe = {"specular": (0.3, 0.2, 0.1), "shininess": 25.0}
    camera, scene = view_down(16, 12, up=3.0), ml.Scene()
    floor_under(scene, size=4.0)
    scene.set_material("floor", ml.Material(texels, **lobe))
    floor = scene.meshes["floor"]
    tint = np.array((0.9, 0.5, 0.2)) if colored else np.ones(3)
    if colored:
        colors = np.broadcast_to(tint, (4, 3)).astype(np.float32)
        scene.remove("floor")
        scene.add_arrays(
            floor.positions,
            floor.triangles,
            uvs=floor.uvs,
            colors=colors,
            material=ml.Material(texels, **lobe),
            shading="flat",
        )
    spot = ml.SpotLight((0.5, 2.0, 0.3), (0.0, 0.0, 0.0), intensity=(9.0, 8.0, 7.0), cutoff=70.0)
    scene.add_light(spot)
    points = plane_hits(camera, (0, 0, 0), (0, 1, 0))
    albedo = interpolate(
        texels.astype(np.float64), points[..., 0] / 4 + 0.5, points[..., 2] / 4 + 0.5, repeat=True
    )
    truth = _under_spot(camera, points, albedo * tint, spot, **lobe)
    seen = ml.mitsuba.reference(scene, camera, 4, cached=False).mean
    np.testing.assert_allclose(seen, truth, rtol=2e-3)
    flat = _under_spot(camera, points, texels.mean(axis=(0, 1)) * tint, spot, **lobe)
    assert np.abs(seen / flat - 1.0).max() > 0.1  # negative control: one albedo everywhere


def _under_spot(
    camera: ml.Camera, points: Any, albedo: Any, spot: ml.SpotLight, specular: Any, shininess: float
) -> Any:
    view, to_light = camera.origin - points, spot.position - points
    distance2 = (to_light**2).sum(axis=-1)
    wi, wo = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (view, to_light))
    f = phong(wi, wo, (0, 1, 0), albedo, specular, shininess)
    return f * (wo[..., 1] / distance2)[..., None] * np.array(spot.intensity)


def _floor_and_wall(wall: ml.Material) -> tuple[ml.Scene, ml.Camera]:
    """A diffuse floor, all that is seen, lit by a light that lies low before a wall aside."""
    scene = ml.Scene()
    floor_under(scene, (0.8, 0.8, 0.8), size=4.0)
    corners = [(-2, 0, -2), (-2, 0, 2), (-2, 3, 2), (-2, 3, -2)]
    scene.add_arrays(corners, [(0, 2, 1), (0, 3, 2)], name="wall", material=wall, shading="flat")
    scene.add_light(ml.AreaLight((1.0, 1.8, -0.5), (0, 0, 1), (0, 0.8, 0), radiance=(9.0, 9.0, 9.0)))
    return scene, ml.Camera.look_at((-0.5, 3.5, 0), (-0.5, 0, 0), (0, 0, -1), fov_y=30, width=8, height=8)


SHINY = ml.Material((0.3, 0.3, 0.3), specular=(0.7, 0.6, 0.5), shininess=60.0)


def test_hits_of_indirect_rays_reflect_diffusely_unless_asked() -> None:
    scene, camera = _floor_and_wall(SHINY)
    dull, _ = _floor_and_wall(ml.Material(SHINY.albedo))

    def shot(place: ml.Scene, part: Any = "indirect", **options: Any) -> ml.mitsuba.Reference:
        return ml.mitsuba.reference(place, camera, 1024, 3, part, cached=False, **options)

    default, plain = shot(scene), shot(dull, seed=1)
    assert default.info["glossy_bounces"] is False
    assert "glossy_bounces" not in plain.info
    spread = np.sqrt(default.variance + plain.variance)
    assert abs(((default.mean - plain.mean) / spread).mean()) < 0.3
    glossy = shot(scene, glossy_bounces=True)
    assert glossy.mean.mean() > 1.3 * default.mean.mean()  # negative control: the lobe is seen
    # parts add up either way
    direct = ml.mitsuba.reference(scene, camera, 1024, part="direct", seed=2, cached=False).mean
    for indirect, option in ((default, False), (glossy, True)):
        total = shot(scene, "total", glossy_bounces=option, seed=3).mean
        assert total.mean() == pytest.approx(direct.mean() + indirect.mean.mean(), rel=0.01)


def test_the_first_surface_reflects_indirect_light_by_its_lobe() -> None:
    scene, camera = _floor_and_wall(ml.Material((0.6, 0.6, 0.6)))
    options: dict[str, Any] = {"max_depth": 3, "part": "indirect", "cached": False}
    dull = ml.mitsuba.reference(scene, camera, 256, **options).mean
    scene.set_material("floor", ml.Material((0.1, 0.1, 0.1), specular=(0.7, 0.7, 0.7), shininess=5.0))
    glossy = ml.mitsuba.reference(scene, camera, 256, **options).mean
    assert glossy.mean() > 0.4 * dull.mean()  # an eighth of it by its diffuse part alone


# -- dictionaries


def test_what_to_dict_writes(mi: Any) -> None:
    scene, camera = _floor_and_wall(SHINY)

    def kinds(**options: Any) -> tuple[str, int]:
        node = ml.mitsuba.to_dict(scene, camera, **options)
        (wall,) = (str(shape.bsdf()) for name, shape in node.items() if name.endswith("_wall"))
        return wall, node["integrator"].get("bsdf_samples")

    text, samples = kinds()
    assert "Phong[" in text
    assert "shininess=60.0" in text
    assert samples == 1  # light samples alone would be noise where the lobe is narrow
    text, samples = kinds(specular=False)
    assert "Phong[" not in text
    assert samples == 0
    assert kinds(max_depth=3)[1] is None
    with pytest.raises(ml.SceneError, match="specular is 2"):
        ml.mitsuba.to_dict(scene, specular=2)
    with pytest.raises(ml.SettingsError, match="glossy_bounces is 2"):
        ml.mitsuba.reference(scene, camera, 1, 3, glossy_bounces=2)


def test_mitsubas_own_sensor_and_integrator_agree(mi: Any) -> None:
    scene, camera = glossy_floor(50, size=24)
    ours = ml.mitsuba.reference(scene, camera, 1024, pixel="box", cached=False).mean
    node = ml.mitsuba.to_dict(scene, camera, spp=4096, sampler="multijitter")
    theirs = np.array(mi.render(mi.load_dict(node), seed=3))
    assert ml.metrics.relative_rmse(theirs, ours, noise_free=False) < 0.03
    dull = mi.load_dict(ml.mitsuba.to_dict(scene, camera, spp=64, specular=False))
    assert ml.metrics.relative_rmse(np.array(mi.render(dull)), ours) > 0.1  # negative control


def test_the_scalar_variant_agrees() -> None:
    scene, camera = glossy_floor(50, size=6)
    options: dict[str, Any] = {"part": "direct", "cached": False}
    scalar = ml.mitsuba.reference(scene, camera, 512, variant="scalar_rgb", **options)
    fast = ml.mitsuba.reference(scene, camera, 4096, **options)
    noise = np.sqrt((scalar.variance + fast.variance).sum())
    assert abs((scalar.mean - fast.mean).sum()) < 3.0 * noise
    assert noise < 0.05 * fast.mean.sum()


@pytest.mark.parametrize("two_sided", [False, True])
def test_it_comes_back_as_a_material(two_sided: bool) -> None:
    node: dict[str, Any] = {
        "type": plugins.PHONG,
        "diffuse_reflectance": {"type": "rgb", "value": [0.1, 0.2, 0.3]},
        "specular_reflectance": {"type": "rgb", "value": [0.6, 0.5, 0.4]},
        "shininess": 50.0,
    }
    bsdf = {"type": "twosided", "inner": node} if two_sided else node
    scene = ml.Scene.from_mitsuba({"type": "scene", "a": {"type": "cube", "bsdf": bsdf}})
    assert scene.meshes["a"].material == ml.Material((0.1, 0.2, 0.3), (0.6, 0.5, 0.4), 50.0)
    assert len(scene.report.notes) == (0 if two_sided else 1)
    node["specular_reflectance"] = {"type": "checkerboard"}
    with pytest.raises(ml.SceneError, match="specular_reflectance of 'miplight_phong' is a texture"):
        ml.Scene.from_mitsuba({"type": "scene", "a": {"type": "cube", "bsdf": bsdf}})
    node["shininess"] = -1.0
    with pytest.raises(ml.SceneError, match=r"shininess is -1\.0; allowed: 0 or more"):
        ml.Scene.from_mitsuba({"type": "scene", "a": {"type": "cube", "bsdf": bsdf}})
