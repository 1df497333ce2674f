"""The preset "default" where nothing, or half, or everything but what is thin is in the way of the light."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import miplight as ml
from tests.analytic.closed_forms import floor_points, floor_scene, light_irradiance, view_down
from tests.analytic.quadrature import irradiance, irradiance_at
from tests.claim_scenes import CLAIMS
from tests.fragment_rules import assert_partition

UP = np.array([0.0, 1.0, 0.0])
ALBEDO = np.array([0.8, 0.6, 0.4])
DEFAULT = ml.Settings.preset("default")


def shadow_rays(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings = DEFAULT
) -> int:
    """Rays beyond those that find what each pixel sees, which a still frame need not trace again."""
    off = settings.replace(direct="off")
    first, still = (renderer.render(scene, camera, off).stats.rays for _ in range(2))
    assert still in (0, first)
    return renderer.render(scene, camera, settings).stats.rays - still


# -- unshadowed light is exact

# name: corner, edge_u, edge_v, size of the floor, height of the camera
POSES: dict[str, tuple[Any, Any, Any, float, float]] = {
    "contact": ((-0.25, 0.02, -0.2), (0.5, 0, 0), (0, 0, 0.4), 1.0, 0.8),
    "near": ((-0.6, 0.2, -0.4), (1.2, 0.02, 0), (0.3, 0, 0.8), 4.0, 2.0),
    "overhead": ((-0.6, 2.0, -0.4), (1.2, 0.2, 0), (0.3, 0, 0.8), 8.0, 3.0),
    "tilted": ((-1.0, 1.0, -0.5), (1.0, 0.9, 0), (0, 0.1, 0.9), 8.0, 3.0),
    "standing": ((0.3, 0.05, -0.6), (0, 0, 1.2), (0, 0.7, 0), 4.0, 2.0),
    "far": ((0.3, 10.0, -0.2), (0.01, 0, 0), (0, 0.002, 0.012), 8.0, 3.0),
    "farther": ((0.3, 10.0, -0.2), (0.001, 0, 0), (0, 0.0002, 0.0012), 8.0, 3.0),
}


def posed(name: str, **changes: Any) -> tuple[ml.Scene, ml.Camera, ml.AreaLight]:
    corner, u, v, size, up = POSES[name]
    options: dict[str, Any] = {"radiance": (5.0, 3.0, 1.0), "visible": False, **changes}
    light = ml.AreaLight(corner, u, v, **options)
    if float((np.array([0.0, -10, 0]) - light.corner) @ light.normal) < 0 and name != "standing":
        light.set_geometry(edge_u=light.edge_v, edge_v=light.edge_u)  # to shine downwards
    return floor_scene(light, size=size), view_down(28, 24, up=up, fov_y=48.0), light


def own_error(found: NDArray[Any], expected: NDArray[np.float64]) -> float:
    """Largest error relative to a pixel's own value, of pixels above a thousandth of the brightest."""
    bright = expected > 1e-3 * expected.max()
    return float((np.abs(found - expected)[bright] / expected[bright]).max())


@pytest.mark.parametrize("name", POSES)
def test_unshadowed_light_agrees_with_a_quadrature(renderer: ml.Renderer, name: str) -> None:
    scene, camera, light = posed(name)
    image = renderer.render(scene, camera, DEFAULT).direct.reshape(-1, 3)
    expected = irradiance(light, floor_points(camera), UP)[:, None] * ALBEDO / np.pi * light.radiance
    assert expected.max() > 0
    assert own_error(image, expected) < 1e-4
    assert not image[(expected == 0).all(axis=1)].any()
    # negative control: a thousandth more is noticed
    assert own_error(image * 1.001, expected) > 1e-4


@pytest.mark.parametrize("name", ["near", "tilted", "standing"])
def test_both_sides_of_a_light_shine_alike(renderer: ml.Renderer, name: str) -> None:
    scene, camera, light = posed(name, two_sided=True)
    image = renderer.render(scene, camera, DEFAULT).direct.reshape(-1, 3)
    expected = irradiance(light, floor_points(camera), UP)[:, None] * ALBEDO / np.pi * light.radiance
    assert own_error(image, expected) < 1e-4
    light.two_sided = False
    light.set_geometry(edge_u=light.edge_v, edge_v=light.edge_u)
    one = renderer.render(scene, camera, DEFAULT).direct.reshape(-1, 3)
    assert own_error(one, expected) > 1e-4 or not one.any()  # negative control


def test_a_light_cut_by_the_horizon_is_exact(renderer: ml.Renderer) -> None:
    """It stands half below the floor, which hides what no pixel faces."""
    light = ml.AreaLight((0.3, -0.5, -0.6), (0, 0, 1.2), (0, 1.0, 0), radiance=(5.0, 3.0, 1.0), visible=False)
    light.two_sided = True
    camera = view_down(28, 24, up=2.0, fov_y=48.0)
    image = renderer.render(floor_scene(light, size=4.0), camera, DEFAULT).direct.reshape(-1, 3)
    points = floor_points(camera)
    expected = ALBEDO / np.pi * light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    assert own_error(image, expected) < 1e-4
    assert own_error(1.001 * image, expected) > 1e-4


@pytest.mark.parametrize("name", POSES)
def test_the_quadrature_agrees_with_lambert(name: str) -> None:
    """Two float64 ways to the same number, so that neither is trusted alone."""
    _, camera, light = posed(name, radiance=(1.0, 1.0, 1.0), two_sided=True)
    points = floor_points(camera)[::37]
    lambert = light_irradiance(light, points, np.tile(UP, (len(points), 1)))[:, 0]
    # the contour's own terms cancel with the square of the distance, in float64 as well
    np.testing.assert_allclose(
        irradiance(light, points, UP), lambert, rtol=1e-8 if "far" not in name else 1e-6
    )
    assert irradiance_at(light, points[0] + (0, 1e-3, 0), UP) != pytest.approx(lambert[0], rel=1e-8)


# -- what nothing shades costs no ray, what no light reaches costs no gather


@pytest.mark.parametrize("size", [(96, 80), (61, 45), (256, 256)], ids=str)
def test_a_bare_lit_floor_traces_no_ray(renderer: ml.Renderer, size: tuple[int, int]) -> None:
    scene, camera = CLAIMS["bare_floor"].build(*size)
    assert shadow_rays(renderer, scene, camera) == 0
    # negative control: something above it is asked for
    scene.add_mesh(ml.shapes.box((0.5, 0.5, 0.5), (0.3, 0.5, 0.2)))
    assert shadow_rays(renderer, scene, camera) > 0


def test_a_bare_tilted_floor_stays_coarse(renderer: ml.Renderer) -> None:
    scene, camera = CLAIMS["bare_floor"].build(96, 64)
    camera = camera.replace(fov_y=20.0)  # the floor alone
    frame = renderer.render(scene, camera, DEFAULT)
    assert frame.surface_mask.all()
    coarsest = len(frame.fragments.masks) - 1
    assert coarsest >= 2
    assert (frame.fragments.level_map == coarsest).all()
    assert (frame.fragments.reason_map == ml.Reason.COARSEST).all()
    assert frame.fragments.total == np.prod(frame.fragments.masks[-1].shape)
    # negative control: what stands on it is refined
    scene.add_mesh(ml.shapes.box((0.5, 0.5, 0.5), (0.0, 0.25, 0.0)))
    assert (renderer.render(scene, camera, DEFAULT).fragments.level_map < coarsest).any()


def test_a_spot_on_a_bare_floor_traces_no_ray(renderer: ml.Renderer) -> None:
    scene = floor_scene(ml.SpotLight((0, 2, 0), (0, 0, 0), intensity=(5, 5, 5), cutoff=30.0))
    camera = view_down(64, 48)
    assert shadow_rays(renderer, scene, camera) == 0
    assert renderer.render(scene, camera, DEFAULT).direct.any()


def test_the_unlit_half_is_culled(renderer: ml.Renderer) -> None:
    scene, camera = CLAIMS["half_unlit"].build(128, 128)
    frame = renderer.render(scene, camera, DEFAULT, keep=())
    assert_partition(frame.fragments)
    levels, reasons = frame.fragments.level_map, frame.fragments.reason_map
    behind = frame.surface_mask & (frame.position[..., 0] < -1e-5)
    away = frame.surface_mask & (frame.normal[..., 0] > 0.5)
    assert behind.mean() > 0.4
    assert 0.05 < away.mean() < 0.3
    for mask, reason in ((behind, ml.Reason.BEHIND_LIGHT), (away, ml.Reason.FACING_AWAY)):
        assert (levels[mask] == 254).all()
        assert (reasons[mask] == reason).all()
        assert not frame.direct[mask].any()
    # negative control: with light from both sides nothing is behind
    (light,) = scene.lights.values()
    light.two_sided = True
    both = renderer.render(scene, camera, DEFAULT)
    assert (both.fragments.level_map[behind] < 254).all()
    assert both.direct[behind].min() > 0


def test_an_unlit_view_costs_no_ray_and_no_gather(renderer: ml.Renderer) -> None:
    scene, camera = CLAIMS["half_unlit"].build(64, 64)
    dark = ml.Camera.look_at((-2.2, 4.0, 0), (-2.2, 0, 0), (0, 0, -1), 45.0, 64, 64)
    frame = renderer.render(scene, dark, DEFAULT)
    assert frame.surface_mask.all()
    assert frame.stats.light_evaluations == 0
    assert not frame.direct.any()
    assert frame.fragments.total == 0
    assert shadow_rays(renderer, scene, dark) == 0
    lit = renderer.render(scene, camera, DEFAULT)  # negative control
    assert lit.stats.light_evaluations > 0
    assert lit.direct.any()


# -- the same bits


@pytest.mark.parametrize("name", ["sphere_two", "torture_wide", "ribbon_video"])
def test_five_renders_and_a_second_renderer_agree(renderer: ml.Renderer, name: str) -> None:
    scene, camera = CLAIMS[name].build(75, 53)

    def digest(with_renderer: ml.Renderer, settings: ml.Settings = DEFAULT) -> str:
        with_renderer.render(scene, camera, settings)
        frame = with_renderer.render(scene, camera, settings)  # still, so that its rays are all for light
        maps = frame.fragments.level_map, frame.fragments.reason_map
        counts = frame.stats.rays, frame.stats.light_evaluations, frame.fragments.extra
        text = b"".join(np.ascontiguousarray(array).tobytes() for array in (frame.image, *maps))
        return hashlib.sha256(text + repr(counts).encode()).hexdigest()

    found = {digest(renderer) for _ in range(5)}
    with ml.Renderer(renderer.adapter["name"]) as second:
        second.render(*CLAIMS["boxes"].build(33, 21), DEFAULT)
        found.add(digest(second))
    assert len(found) == 1
    resolved = renderer.render(scene, camera, DEFAULT).settings
    assert digest(renderer, ml.Settings.from_dict(resolved.to_dict())) in found
    assert digest(renderer, DEFAULT.replace(seed=7)) not in found  # negative control


# -- nothing thin is missed

SAMPLES = 16  # as few as a method may take where it is not sure: the noise that is allowed
BLOCK = 8


def shadow_share(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, settings: ml.Settings
) -> NDArray[np.float64]:
    """Share of the light hidden from each pixel; NaN off the floor and the wall, and where it is dark."""
    outputs = ("direct", "position", "surface_mask")
    frame = renderer.render(scene, camera, settings, outputs)
    clear = ml.Settings.preset("brute-force").replace(visibility="none", direct_estimator="ratio")
    open_sky = renderer.render(scene, camera, clear, outputs)
    own, full = (f.direct.sum(axis=-1, dtype=np.float64) for f in (frame, open_sky))
    plain = frame.surface_mask & ((frame.position[..., 1] < 1e-4) | (frame.position[..., 2] < -2.9999))
    lit = plain & (full > 0.02 * full[frame.surface_mask].mean())
    return np.where(lit, 1.0 - own / np.where(lit, full, 1.0), np.nan)


def misses(found: NDArray[np.float64], truth: NDArray[np.float64]) -> tuple[float, float]:
    """How far shadows of more than 5 % are from the truth: pixels beyond noise, and the worst block.

    Returns the share of pixels that differ by more than 4 standard deviations of 16 samples and 0.1, and the
    least share of a shadow that any block of 8 × 8 pixels with 16 or more such pixels keeps.
    """
    there = np.isfinite(found) & np.isfinite(truth)
    shadowed = there & (np.nan_to_num(truth) > 0.05)
    spread = np.sqrt(np.clip(truth * (1 - truth), 0, None) / SAMPLES)
    far = float((np.abs(found - truth) > 0.1 + 4 * spread)[shadowed].mean())

    def blocks(values: NDArray[Any]) -> NDArray[np.float64]:
        rows, columns = (length // BLOCK for length in values.shape)
        cut = np.where(shadowed, values, 0)[: rows * BLOCK, : columns * BLOCK]
        summed: NDArray[np.float64] = cut.reshape(rows, BLOCK, columns, BLOCK).sum(axis=(1, 3))
        return summed

    count = blocks(np.ones_like(truth))
    enough = count >= 16
    return far, float((blocks(found)[enough] / blocks(truth)[enough]).min())


@pytest.mark.parametrize("light", ["small", "wide"])
def test_no_thin_occluder_is_missed(renderer: ml.Renderer, light: str) -> None:
    scene, camera = CLAIMS[f"torture_{light}"].build(160, 160)
    brute = ml.Settings.preset("brute-force").replace(light_samples=1024, direct_estimator="ratio")
    truth = shadow_share(renderer, scene, camera, brute)
    assert (truth[np.isfinite(truth)] > 0.05).mean() > 0.2
    far, kept = misses(shadow_share(renderer, scene, camera, DEFAULT), truth)
    assert far < 0.003
    assert kept > 0.5
    # negative control: without the wires their shadows are missed
    for name in ("wires", "lines"):
        scene.remove(name)
    far, kept = misses(shadow_share(renderer, scene, camera, DEFAULT), truth)
    assert kept < 0.5
    assert light == "wide" or far > 0.003
