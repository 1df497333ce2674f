"""Fragments through the whole renderer: refined in one pass, one receiver each, three ways to upsample."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml
from tests.analytic.closed_forms import floor_scene, view_down
from tests.analytic.test_area_light import lamp

UPSAMPLERS = ["nearest", "bilinear", "edge-aware"]
Array = NDArray[np.float64]


def _pair(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera, **changes: str | float | None
) -> tuple[ml.Frame, ml.Frame]:
    """The frame of fragments and that of every pixel, with the same samples."""
    brute = ml.Settings.preset("brute-force").replace(light_pattern="grid", light_samples=36)
    settings = brute.replace(refine="one-pass", **changes)
    outputs = ("image", "direct", "fragments", "surface_mask", "light_mask", "statistics")
    made = []
    for each in (settings, brute):
        made.append(renderer.render(scene, camera, each, outputs=outputs))
        assert made[-1]["direct_irradiance"].shape == made[-1].image.shape, "read while it is there"
    return made[0], made[1]


def _window(image: Array, reach: int) -> tuple[Array, Array]:
    """Least and largest value within `reach` pixels of each."""
    padded = np.pad(image, ((reach, reach), (reach, reach), (0, 0)), mode="edge")
    blocks = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1, 2 * reach + 1), axis=(0, 1))
    return blocks.min(axis=(-2, -1)), blocks.max(axis=(-2, -1))


def _bound(exact: Array, upsample: str) -> float:
    """What an image may lose in fragments of 8 × 8 pixels, from its differences from pixel to pixel.

    Nearest: five pixels along each axis at most. Linear from level to level: w²/8 times the second difference
    of each axis at each of the levels w = 8, 4, 2, which together are less than 64/6.
    """
    order = 1 if upsample == "nearest" else 2
    steepest = sum(np.abs(np.diff(exact, order, axis)).max() for axis in (0, 1))
    return float(steepest * (5 if upsample == "nearest" else 64 / 6))


@pytest.mark.parametrize("upsample", UPSAMPLERS)
@pytest.mark.parametrize("size", [(64, 48), (61, 43)])
def test_a_floor_under_a_light_errs_by_what_a_fragment_spans(
    renderer: ml.Renderer, upsample: str, size: tuple[int, int]
) -> None:
    """Weights are at least 0 and sum to 1: a pixel's light lies between those of the fragments about it."""
    frame, brute = _pair(renderer, floor_scene(lamp()), view_down(*size), upsample=upsample, coarsest_level=3)
    assert (frame.fragments.level_map == 3).all(), "the bare floor stays at the coarsest level"
    found, exact = (np.asarray(f["direct_irradiance"], np.float64) for f in (frame, brute))
    # nearest: the own fragment; else that of the neighbours at each of three levels, two fragments at most
    least, most = _window(exact, 7 if upsample == "nearest" else 16)
    assert (found >= least - 1e-6).all()
    assert (found <= most + 1e-6).all()
    assert frame.stats.light_evaluations < brute.stats.light_evaluations / 50
    across, down = (side // 8 * 8 for side in size)
    error = np.abs(found - exact)[8 : down - 8, 8 : across - 8]
    assert error.max() < _bound(exact, upsample)
    wrong = found[:, ::-1]
    assert np.abs(2 * found - exact).max() > _bound(exact, upsample)
    assert not ((wrong >= least - 1e-6) & (wrong <= most + 1e-6)).all(), "another image lies outside"


@pytest.mark.parametrize("upsample", UPSAMPLERS)
def test_pixels_as_fragments_are_brute_force(renderer: ml.Renderer, upsample: str) -> None:
    """Level 0 everywhere: the same receivers, the same bits; culled pixels are black there as well."""
    scene = floor_scene(lamp(visible=True), ml.SpotLight((1, 2, 0), (0, 0, 0), (9, 8, 7), cutoff=30))
    ball = trimesh.creation.icosphere(3, 0.6).apply_translation((0, 1, 0))
    scene.add_mesh(ball, name="ball")
    camera = ml.Camera.look_at((0, 1.0, 4), (0, 0.8, 0), fov_y=60, width=53, height=37)
    frame, brute = _pair(renderer, scene, camera, upsample=upsample, coarsest_level=0)
    assert (frame.image == brute.image).all()
    culled = (frame.fragments.level_map == 254) & frame.surface_mask
    assert culled.any()
    assert not brute.direct[culled].any()


def _clutter() -> ml.Scene:
    scene = floor_scene(
        lamp(visible=True), ml.SpotLight((1, 2, 0), (0, 0, 0), (9, 8, 7), cutoff=30), size=3.0
    )
    scene.add_mesh(trimesh.creation.icosphere(3, 0.6), name="ball")
    scene.add_mesh(trimesh.creation.box((0.05, 1.5, 0.05)), name="pole")
    return scene


@pytest.mark.parametrize("size", [(53, 37), (1, 40), (41, 1), (2, 2), (130, 67)])
@pytest.mark.parametrize("levels", [(4, 0), (16, 0), (3, 2), (1, 1)])
def test_every_lit_pixel_belongs_to_one_fragment(
    renderer: ml.Renderer, size: tuple[int, int], levels: tuple[int, int]
) -> None:
    camera = ml.Camera.look_at((0, 2.5, 4), (0, 0.6, 0), fov_y=50, width=size[0], height=size[1])
    coarsest, finest = levels
    frame, brute = _pair(
        renderer,
        _clutter(),
        camera,
        upsample="edge-aware",
        coarsest_level=coarsest,
        finest_level=finest,
    )
    f = frame.fragments
    assert ((f.level_map == 255) == ~(frame.surface_mask | frame.light_mask)).all()
    assert (f.reason_map[frame.light_mask] == ml.Reason.EMITTER).all()
    shaded = f.level_map < 254
    assert shaded[brute.direct.any(axis=-1)].all(), "what is lit is not culled"
    covered = sum(
        np.kron(mask, np.ones((2**level, 2**level), int))[: size[1], : size[0]] * (f.level_map == level)
        for level, mask in enumerate(f.masks)
        if level < 8
    )
    big = np.isin(f.level_map, range(8, 17))
    assert (np.asarray(covered)[shaded & ~big] == 1).all()
    assert f.level_map[shaded].max(initial=finest) <= coarsest
    assert f.level_map[shaded].min(initial=coarsest) >= finest
    assert frame.stats.light_evaluations == f.total * (36 + 1), "one receiver a fragment"
    assert np.isfinite(frame.image).all()
    assert not frame.direct[~shaded].any()


def test_a_metric_without_a_threshold_does_not_refine(renderer: ml.Renderer) -> None:
    camera = ml.Camera.look_at((0, 2.5, 4), (0, 0.6, 0), fov_y=50, width=64, height=64)
    none = {"depth_threshold": None, "normal_threshold": None}
    frame, _ = _pair(renderer, _clutter(), camera, coarsest_level=3, **none)
    assert set(np.unique(frame.fragments.level_map)) <= {3, 254, 255}
    depth, _ = _pair(renderer, _clutter(), camera, coarsest_level=3, normal_threshold=None)
    reasons = set(np.unique(depth.fragments.reason_map))
    assert ml.Reason.DEPTH in reasons
    assert ml.Reason.NORMAL not in reasons


def test_the_same_bits_every_time_and_at_any_chunk(renderer: ml.Renderer) -> None:
    camera = ml.Camera.look_at((0, 2.5, 4), (0, 0.6, 0), fov_y=50, width=96, height=64)
    frames = [_pair(renderer, _clutter(), camera, upsample="edge-aware")[0] for _ in range(3)]
    assert all((frame.image == frames[0].image).all() for frame in frames)
    assert all(frame.fragments == frames[0].fragments for frame in frames)


def test_nothing_to_shade_is_said(renderer: ml.Renderer) -> None:
    """A floor behind the only light has no fragment."""
    light = ml.AreaLight((-0.5, -1, -0.5), (1, 0, 0), (0, 0, 1), (5, 5, 5), visible=False)
    frame, brute = _pair(renderer, floor_scene(light), view_down())
    assert not brute.direct.any()
    assert not frame.direct.any()
    assert frame.fragments.total == 0
    assert (frame.fragments.level_map == 254).all()
    assert np.isin(frame.fragments.reason_map, [ml.Reason.FACING_AWAY, ml.Reason.BEHIND_LIGHT]).all()
    assert "direct/fragment_receivers" in frame.stats.empty


def test_levels_in_the_wrong_order_are_refused(renderer: ml.Renderer) -> None:
    with pytest.raises(ml.SettingsError, match="coarsest_level >= finest_level"):
        _pair(renderer, floor_scene(lamp()), view_down(), coarsest_level=1, finest_level=2)
