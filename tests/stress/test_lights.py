"""Lights in odd places, of any brightness and number, with odd pictures."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml
from tests.analytic.closed_forms import add_quad, floor_points, floor_scene, light_irradiance, view_down
from tests.stress.common import (
    ALBEDO,
    OUTPUTS,
    PRESETS,
    UP,
    Array,
    assert_sound,
    lamp,
    quick,
    sized,
    variants,
    worst,
)

WHITE = (5.0, 3.0, 1.0)
ACROSS = ml.Camera.look_at((0.3, 1, 2), (0, 0, 0), fov_y=50, width=32, height=24)


def _area(corner: object, u: object, v: object, **options: object) -> ml.AreaLight:
    return ml.AreaLight(corner, u, v, WHITE, **options)


LIGHTS: dict[str, ml.AreaLight | ml.SpotLight] = {
    "stands on the floor": _area((-0.5, 0, 0), (1, 0, 0), (0, 1, 0)),
    "lies in the floor": _area((-0.5, 0, -0.5), (1, 0, 0), (0, 0, 1), two_sided=True, visible=False),
    "lies in the floor, seen": _area((-0.5, 0, 0.5), (1, 0, 0), (0, 0, -1), two_sided=True),
    "a hair over the floor": _area((-0.5, 1e-6, -0.5), (1, 0, 0), (0, 0, 1), visible=False),
    "a thousandth over the floor": _area((-0.5, 1e-3, -0.5), (1, 0, 0), (0, 0, 1), visible=False),
    "half in the floor": _area((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), two_sided=True, visible=False),
    "edge-on to the eye": _area((-0.4, 0.2, 0), (0.5, 0, 0), np.subtract((0.3, 1, 2), (0.1, 0.2, 0)) / 8),
    "behind the floor": _area((-0.5, -1, 0.5), (1, 0, 0), (0, 0, -1), visible=False),
    "looks away": _area((-0.5, 1, 0.5), (1, 0, 0), (0, 0, -1), visible=False),
    "behind the eye": _area((-1, 0.2, 4), (0, 1, 0), (1, 0, 0), visible=False),
    "through the eye": _area((-0.2, 0.9, 1.95), (1, 0, 0), (0, 0.2, 0.1), visible=False),
    "a spot on the floor": ml.SpotLight((0, 0, 0), (1, 0, 0), WHITE, 80),
    "a spot a hair over it": ml.SpotLight((0, 1e-6, 0), (0, 0, 0), WHITE, 80),
    "a spot in the eye": ml.SpotLight((0.3, 1, 2), (0, 0, 0), WHITE, 20),
    "a narrow spot": ml.SpotLight((0, 1, 0), (0, 0, 0), WHITE, 1e-3),
}
DARK = {
    "behind the floor",
    "looks away",
    "lies in the floor",
    "lies in the floor, seen",
    "a spot on the floor",
}
# with light of both sides, or where one side is the floor's
LIT = {"stands on the floor", "half in the floor", "a thousandth over the floor", "behind the eye"}


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.parametrize("variant", variants())
def test_lights_in_odd_places(renderer: ml.Renderer, variant: str, name: str) -> None:
    scene = floor_scene(LIGHTS[name])
    add_quad(scene, (-1, 0, -1.2), (2, 0, 0), (0, 0.8, 0), name="wall", albedo=ALBEDO)
    frame = renderer.render(scene, ACROSS, variants()[variant])
    assert_sound(frame)
    if name in DARK:
        floor = frame.surface_mask & (frame.position[..., 1] < 1e-5)
        assert not frame.direct[floor].any()
    if name in LIT:
        assert frame.direct[frame.surface_mask].any()
    if "ratio" in frame.settings.direct_estimator and isinstance(LIGHTS[name], ml.AreaLight):
        # no more than a sky full of the light: E <= πL
        assert (frame.direct <= ALBEDO * WHITE * (1 + 1e-5)).all()


@pytest.mark.parametrize("height", [1e-1, 1e-2, 1e-3])
def test_the_default_close_under_a_light_is_lambert_s(renderer: ml.Renderer, height: float) -> None:
    """Where samples have spikes (N2): the camera looks at the floor from under the light."""
    light = _area((-0.5, height, -0.5), (1, 0, 0), (0, 0, 1), visible=False)
    camera = view_down(16, 12, up=0.9 * height, fov_y=60)
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    found = renderer.render(floor_scene(light, size=2.0), camera, "default").direct.reshape(-1, 3)
    assert worst(found, expected) < 1e-4
    assert worst(found, 1.01 * expected) > 1e-4, "negative control"


@pytest.mark.parametrize("variant", variants())
def test_a_light_inside_a_mesh_stays_there(renderer: ml.Renderer, variant: str) -> None:
    """A bright light in a closed box: outside it is dark to the last bit, and inside it is not."""
    inner = ml.AreaLight((-0.1, 0.5, -0.1), (0.2, 0, 0), (0, 0, 0.2), (300.0,) * 3, two_sided=True)
    scene = floor_scene(inner)
    box = trimesh.creation.box((0.5, 0.5, 0.5)).apply_translation((0, 0.5, 0))
    scene.add_mesh(box, name="box", shading="flat")
    settings = variants()[variant]
    if settings.visibility == "voxel":
        settings = settings.replace(visibility="ray")  # voxels hold what the camera sees alone
    frame = renderer.render(scene, ACROSS, settings, OUTPUTS)
    assert frame.surface_mask.any()
    assert not frame.direct.any()
    inside = ml.Camera.look_at((0.15, 0.6, 0.15), (-0.2, 0.7, -0.2), fov_y=80, width=16, height=12)
    assert (renderer.render(scene, inside, settings).direct.mean(axis=(0, 1)) > 1).all(), "negative control"


@pytest.mark.parametrize("radiance", [1e-12, 1e-6, 1e6, 1e12])
@pytest.mark.parametrize("variant", variants())
def test_any_brightness(renderer: ml.Renderer, variant: str, radiance: float) -> None:
    """Radiance over 24 decades: the picture scales, and nothing is refined for it."""
    frames = []
    for factor in (1.0, radiance, 1.001 * radiance):
        scene = floor_scene(lamp(), ml.SpotLight((1, 1.5, 1), (0, 0, 0), factor * np.array(WHITE), 40))
        scene.lights["light_0"].radiance = factor * np.array(WHITE)
        scene.add_mesh(trimesh.creation.icosphere(2, 0.4).apply_translation((0.3, 0.5, 0)), name="ball")
        frames.append(renderer.render(scene, ACROSS, variants()[variant]))
    one, scaled, other = (f.image.astype(np.float64) for f in frames)
    assert worst(scaled / radiance, one) < 1e-5
    assert worst(other / radiance, one) > 1e-5, "negative control"
    assert frames[1].fragments == frames[0].fragments


@pytest.mark.parametrize("variant", variants())
def test_none_one_and_64_lights(renderer: ml.Renderer, variant: str) -> None:
    """64 lights of a 64th each are one light; none are darkness."""
    # 64 lights have as many maps: at their usual size an adapter may refuse them, and says so
    settings = variants()[variant].replace(light_pattern="grid", rsm_resolution=64)
    if settings.indirect == "hierarchical":
        # a cut looks at 40,000 nodes and no more unless it is to find all of them; 64 trees have more
        settings = settings.replace(light_cut_threshold=0.0)
    images = []
    for count in (0, 1, 64):
        scene = floor_scene()
        scene.add_mesh(trimesh.creation.icosphere(2, 0.4).apply_translation((0.3, 0.5, 0)), name="ball")
        for _ in range(count):
            light = lamp()
            light.radiance = np.array(WHITE) / count
            scene.add_light(light)
        images.append(renderer.render(scene, ACROSS, settings, OUTPUTS))
    none, one, many = images
    exact = settings.direct_estimator == "ratio"  # whose rays are jittered, for each light anew
    assert not none.image.any()
    assert worst(many.direct, one.direct) < (0.02 if exact else 1e-4)
    if one.indirect.any():
        # which virtual lights rays are sent to is by chance
        assert worst(many.indirect, one.indirect) < (0.1 if "with rays" in variant else 1e-3)
    assert worst(many.direct, 63 / 64 * one.direct) > 1e-3, "negative control"


def _picture(kind: str) -> Array:
    width = sized(2048, 8192)
    if kind == "hot":
        picture = np.zeros((8, 8, 3))
        picture[2, 5] = (1e6, 2e5, 1e4)
    elif kind == "black":
        picture = np.zeros((16, 9, 3))
    elif kind == "one":
        picture = np.full((1, 1, 3), WHITE)
    else:
        ramp = np.linspace(0, 2, width)
        picture = np.array(WHITE) * ramp[:, None]
        picture = picture[:, None] if kind == "tall" else picture[None]
    return picture


@pytest.mark.parametrize("kind", ["hot", "black", "one", "wide", "tall"])
@pytest.mark.parametrize("preset", PRESETS)
def test_pictures(renderer: ml.Renderer, preset: str, kind: str) -> None:
    """One hot texel, none, one alone, and thousands in a row that rise from black."""
    light, camera, picture = lamp(), view_down(10, 8), _picture(kind)
    light.radiance = picture.astype(np.float32)
    frame = renderer.render(floor_scene(light), camera, quick(preset, coarsest_level=0, light_samples=1024))
    assert_sound(frame)
    like = lamp()
    if picture.shape[0] * picture.shape[1] > 256:  # a reference of 32 patches: each the mean of its texels
        long = picture.reshape(32, -1, 3).mean(axis=1)
        picture = long[:, None] if kind == "tall" else long[None]
    like.radiance = picture.astype(np.float32)
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(like, points, np.tile(UP, (len(points), 1)))
    found = frame.direct.reshape(-1, 3)
    if kind == "black":
        assert not found.any()
        return
    error = np.abs(found - expected).mean() / expected.mean()
    assert error < (0.05 if kind == "hot" else 0.02)
    assert np.abs(1.2 * found - expected).mean() / expected.mean() > 0.05, "negative control"
