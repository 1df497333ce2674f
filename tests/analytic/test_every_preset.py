"""Every preset with every kind of light and material renders or says why not, and runs what is needed."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml

CAMERA = ml.Camera.look_at((0, 2.2, 3.2), (0, 0.3, 0), fov_y=50, width=33, height=26)
CORNER, U, V = (-0.6, 2, -0.4), (1.2, 0, 0), (0, 0, 0.8)


def _picture() -> NDArray[np.float32]:
    picture = np.full((6, 5, 3), 0.5, np.float32)
    picture[1, 3] = (40, 20, 10)
    return picture


def _area(radiance: object = (5.0, 3.0, 1.0), **more: object) -> ml.AreaLight:
    return ml.AreaLight(CORNER, U, V, radiance, **more)  # type: ignore[arg-type]


LIGHTS: dict[str, list[ml.AreaLight | ml.SpotLight]] = {
    "none": [],
    "area": [_area()],
    "hidden": [_area(visible=False)],
    "two-sided": [_area(two_sided=True)],
    "picture": [_area(_picture())],
    "smooth picture": [_area(_picture(), filter="linear")],
    "spot": [ml.SpotLight((1, 2, 1), (0, 0, 0), (9, 8, 7), cutoff=30)],
    "all": [_area(_picture()), _area(two_sided=True), ml.SpotLight((1, 2, 1), (0, 0, 0), (9, 8, 7))],
}
MATERIALS = {
    "diffuse": ml.Material((0.6, 0.5, 0.4)),
    "black": ml.Material((0, 0, 0)),
    "glossy": ml.Material((0.3, 0.3, 0.3), specular=(0.5, 0.5, 0.5), shininess=40),
    "flat lobe": ml.Material((0.3, 0.3, 0.3), specular=(0.5, 0.5, 0.5), shininess=0),
    "nearly a mirror": ml.Material((0, 0, 0), specular=(1, 1, 1), shininess=10_000),
}
INDIRECT = ("splatting-2009", "radiosity-2009", "hierarchical-2009", "area-2016")
LOBES = ("lobe", "specular")
SMALL_VOLUME = {"lpv_samples": 512, "lpv_rays": 4, "lpv_resolution": 16, "lpv_iterations": 8}
PRESETS = sorted(name for name, preset in ml.presets().items() if preset is not None)


def _scene(lights: list[ml.AreaLight | ml.SpotLight], material: ml.Material) -> ml.Scene:
    scene = ml.Scene()
    scene.add_mesh(trimesh.creation.box((4, 0.1, 4)), name="floor", shading="flat", material=material)
    ball = trimesh.creation.icosphere(2, 0.4)
    scene.add_mesh(
        ball,
        name="ball",
        transform=trimesh.transformations.translation_matrix((0, 0.6, 0)),
        material=material,
    )
    for light in lights:
        scene.add_light(light)
    return scene


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("visibility", ["ray", "voxel", "shadow-map", "none"])
@pytest.mark.parametrize("light", LIGHTS)
def test_the_matrix(renderer: ml.Renderer, preset: str, visibility: str, light: str) -> None:
    settings = ml.Settings.preset(preset).replace(visibility=visibility, light_samples=16, **SMALL_VOLUME)
    refused = preset == "default" and visibility in ("voxel", "shadow-map")
    for material in MATERIALS:
        scene = _scene(LIGHTS[light], MATERIALS[material])
        if refused:
            with pytest.raises(ml.SettingsError, match="allowed: visibility"):
                renderer.render(scene, CAMERA, settings)
            continue
        frame = renderer.render(scene, CAMERA, settings)
        assert np.isfinite(frame.image).all(), material
        assert (frame.image >= 0).all(), material
        lit = light != "none" and material != "black"
        lit &= (light, material) != ("spot", "nearly a mirror")  # a point's reflection lies between pixels
        assert frame.direct[frame.surface_mask].any() == lit, material
        bounces = preset in INDIRECT and light != "none" and material not in ("black", "nearly a mirror")
        assert frame.indirect[frame.surface_mask].any() == bounces, material
        glossy = "specular" in repr(MATERIALS[material]) and light != "none"
        ran = [stage for stage in frame.stats.stages if any(word in stage for word in LOBES)]
        assert bool(ran) == glossy, (material, ran)
        assert (renderer.render(scene, CAMERA, settings).image == frame.image).all(), material


@pytest.mark.parametrize("preset", PRESETS)
def test_the_plan_says_what_is_left_out(renderer: ml.Renderer, preset: str) -> None:
    plain = renderer.plan(_scene(LIGHTS["area"], MATERIALS["diffuse"]), CAMERA, preset)
    lobes = {name: why for name, why in plain.skipped.items() if any(word in name for word in LOBES)}
    assert lobes
    assert set(lobes.values()) == {"no material has a specular part"}
    assert not [name for name in plain.passes if any(word in name for word in LOBES)]
    glossy = renderer.plan(_scene(LIGHTS["area"], MATERIALS["glossy"]), CAMERA, preset)
    assert [name for name in glossy.passes if any(word in name for word in LOBES)], "negative control"
    unlit = renderer.plan(_scene([], MATERIALS["glossy"]), CAMERA, preset)
    assert not [name for name in unlit.passes if name.startswith("direct/")]


def test_a_picture_is_bound_only_where_one_is_shown(renderer: ml.Renderer) -> None:
    plans = {
        light: renderer.plan(_scene(LIGHTS[light], MATERIALS["diffuse"]), CAMERA)
        for light in ("area", "picture")
    }
    assert plans["area"].skipped["direct/textured_share"] == "no light emits a picture"
    assert "direct/textured_share" in plans["picture"].passes


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("material", ["diffuse", "glossy"])
def test_a_film_is_an_upload(renderer: ml.Renderer, preset: str, material: str) -> None:
    """A new frame of video makes no pipeline, tree or geometry again, and shows on what it lights."""
    scene = _scene(LIGHTS["picture"], MATERIALS[material])
    light = next(iter(scene.lights))
    outputs = ("image", "direct", "surface_mask")
    frames = [renderer.render(scene, CAMERA, preset, outputs)]
    for step in range(1, 4):
        scene.lights[light].radiance = np.roll(_picture(), step, axis=1)
        frames.append(renderer.render(scene, CAMERA, preset, outputs))
        assert set(frames[-1].stats.rebuilt) <= {"lights"}
    for one, other in itertools.pairwise(frames):
        assert (one.image != other.image).any()
        lit = one.surface_mask
        assert (one.direct[lit] != other.direct[lit]).any()


def _scaled(scale: float, shift: float) -> tuple[ml.Scene, ml.Camera]:
    """A glossy ball on a floor under a lamp, in other units and another place."""

    def place(*at: float) -> tuple[float, float, float]:
        x, y, z = (scale * coordinate + shift for coordinate in at)
        return x, y, z

    def moved(*at: float) -> NDArray[np.float64]:
        matrix: NDArray[np.float64] = trimesh.transformations.translation_matrix(place(*at))
        return matrix

    scene = ml.Scene()
    floor = trimesh.creation.box((4 * scale, 0.1 * scale, 4 * scale))
    scene.add_mesh(floor, name="floor", shading="flat", transform=moved(0, -0.05, 0))
    ball = trimesh.creation.icosphere(3, 0.4 * scale)
    scene.add_mesh(ball, name="ball", transform=moved(0, 0.6, 0), material=MATERIALS["glossy"])
    scene.add_light(ml.AreaLight(place(*CORNER), (1.2 * scale, 0, 0), (0, 0, 0.8 * scale), (5, 3, 1)))
    look = ml.Camera.look_at(place(0, 2.2, 3.2), place(0, 0.3, 0), fov_y=50, width=97, height=70)
    return scene, look


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("visibility", ["ray", "voxel"])
def test_units_and_place_do_not_matter(renderer: ml.Renderer, preset: str, visibility: str) -> None:
    settings = ml.Settings.preset(preset).replace(light_samples=64)
    if preset != "default":
        settings = settings.replace(visibility=visibility)
    wanted = renderer.render(*_scaled(1.0, 0.0), settings).image
    assert wanted.any()
    for scale, shift in ((1e-8, 0), (1e-4, 0), (1e4, 0), (1e8, 0), (1, 1000)):
        found = renderer.render(*_scaled(scale, shift), settings).image
        assert np.isfinite(found).all()
        apart = np.abs(found - wanted).mean() / wanted.mean()
        assert apart < 1e-3, (scale, shift)
    other = renderer.render(*_scaled(1.0, 0.0), settings.replace(visibility="none")).image
    assert np.abs(other - wanted).mean() / wanted.mean() > 1e-2, "negative control"
