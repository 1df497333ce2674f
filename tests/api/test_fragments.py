"""Fragment maps: a partition at every size, maps that agree, reasons, and their pictures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot as plt

import miplight as ml
from miplight import notebook
from miplight.fragments import CULLED, NOTHING, Fragments
from tests.claim_scenes import CLAIMS
from tests.fragment_rules import CULLING, assert_partition, assert_reasons, assert_seen

SIZES = [(1, 1), (8, 8), (63, 47), (1, 41), (97, 1), (130, 65), (128, 128), (33, 257)]
SCENES = ["boxes", "bare_floor", "half_unlit", "torture_small", "far_near"]


def keep_the_rules(fragments: Fragments) -> None:
    assert_partition(fragments)
    assert_reasons(fragments)


def check(frame: ml.Frame) -> None:
    keep_the_rules(frame.fragments)
    assert_seen(frame)


def test_masks_of_levels_larger_than_the_image() -> None:
    fragments = Fragments(np.full((3, 5), 16, np.uint8), np.zeros((3, 5), np.uint8))
    assert [mask.shape for mask in fragments.masks[:4]] == [(3, 5), (2, 3), (1, 2), (1, 1)]
    assert fragments.counts == (0,) * 16 + (1,)
    assert_partition(fragments)


@pytest.mark.parametrize("preset", ["brute-force", "default"])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_any_size_is_partitioned(renderer: ml.Renderer, size: tuple[int, int], preset: str) -> None:
    scene, camera = CLAIMS["boxes"].build(*size)
    frame = renderer.render(scene, camera, ml.Settings.preset(preset).replace(light_samples=16))
    assert frame.fragments.level_map.shape == size[::-1]
    check(frame)


@pytest.mark.parametrize("name", SCENES)
def test_any_scene_is_partitioned(renderer: ml.Renderer, name: str) -> None:
    scene, camera = CLAIMS[name].build(75, 53)
    check(renderer.render(scene, camera, ml.Settings.preset("default").replace(light_samples=16)))


def test_odd_scenes(renderer: ml.Renderer) -> None:
    """No light, no mesh, lights that cannot be seen, a spot, many lights."""
    scene, camera = CLAIMS["boxes"].build(45, 31)
    settings = ml.Settings.preset("default").replace(light_samples=16)
    (name,) = scene.lights
    light = scene.lights[name]
    light.visible = False
    check(renderer.render(scene, camera, settings))
    for k in range(4):
        scene.add_light(ml.SpotLight((0.5 * k - 1, 2.5, 0), (0, 0, 0.2 * k), intensity=(9, 8, 7), cutoff=30))
    check(renderer.render(scene, camera, settings))
    check(renderer.render(ml.Scene(), camera, settings))
    for kept in list(scene.lights):
        scene.remove(kept)
    dark = renderer.render(scene, camera, settings)
    check(dark)
    assert not dark.direct.any()


def test_supersampled_maps_have_the_internal_size(renderer: ml.Renderer) -> None:
    scene, camera = CLAIMS["boxes"].build(21, 17)
    settings = ml.Settings.preset("default").replace(light_samples=16, supersample=2)
    fragments = renderer.render(scene, camera, settings).fragments
    assert fragments.level_map.shape == (34, 42)
    assert_partition(fragments)
    assert_reasons(fragments)


# -- the rules themselves


def nested(height: int = 21, width: int = 30) -> Fragments:
    """Coarse fragments on the left, finer ones to the right, some culled, the last columns empty."""
    levels, reasons = np.full((height, width), 2, np.uint8), np.zeros((height, width), np.uint8)
    levels[:, 8:16], reasons[:, 8:16] = 1, ml.Reason.DEPTH
    levels[:, 16:], reasons[:, 16:] = 0, ml.Reason.VISIBILITY
    levels[:5, 3:9], reasons[:5, 3:9] = CULLED, ml.Reason.BEHIND_LIGHT
    levels[5:7, :6], reasons[5:7, :6] = CULLED, ml.Reason.EMITTER
    levels[:, 27:], reasons[:, 27:] = NOTHING, ml.Reason.NOTHING
    return Fragments(levels, reasons, coarsest_level=2)


def test_nested_levels_keep_the_rules() -> None:
    fragments = nested()
    assert_partition(fragments)
    assert_reasons(fragments)
    assert [mask.shape for mask in fragments.masks] == [(21, 30), (11, 15), (6, 8)]
    assert fragments.counts[2] == 2 * 6 - 1  # one block is culled as a whole
    assert fragments.counts[0] == 21 * 11


def _finer_pixel(levels: Any, reasons: Any) -> None:
    levels[12, 1], reasons[12, 1] = 0, ml.Reason.DEPTH


def _coarse_pixel(levels: Any, reasons: Any) -> None:
    levels[3, 20] = 1


def _culled_without_cause(levels: Any, reasons: Any) -> None:
    levels[12:16, 0:4] = CULLED


def _coarsest_though_fine(levels: Any, reasons: Any) -> None:
    reasons[2, 20] = ml.Reason.COARSEST


def _refined_though_coarsest(levels: Any, reasons: Any) -> None:
    reasons[12, 1] = ml.Reason.NORMAL


def _unknown_level(levels: Any, reasons: Any) -> None:
    levels[12, 1] = 200


@pytest.mark.parametrize(
    "spoil",
    [
        _finer_pixel,
        _coarse_pixel,
        _culled_without_cause,
        _coarsest_though_fine,
        _refined_though_coarsest,
        _unknown_level,
    ],
)
def test_broken_maps_are_noticed(spoil: Callable[[Any, Any], None]) -> None:
    """Negative controls of the rules that all the other tests rely on."""
    good = nested()
    levels, reasons = good.level_map.copy(), good.reason_map.copy()
    spoil(levels, reasons)
    with pytest.raises(AssertionError):
        keep_the_rules(Fragments(levels, reasons, coarsest_level=2))


# -- pictures


@pytest.mark.parametrize("by", ["level", "reason"])
def test_plot_names_what_it_shows_and_hatches_what_is_culled(by: str) -> None:
    axes = nested().plot(by=by)
    patches = axes.get_legend().get_patches()
    labels = {patch.get_label(): patch.get_hatch() for patch in patches}
    if by == "level":
        assert labels == dict.fromkeys(["level 0", "level 1", "level 2", "nothing seen"]) | {"culled": "////"}
    else:
        assert labels == dict.fromkeys(["coarsest", "depth", "visibility", "nothing seen"]) | {
            "behind-light": "////",
            "emitter": "////",
        }
    # as many colours in the picture as names beside it
    shown = axes.get_images()[0].get_array()
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) == len(labels)
    assert "42 culled" in axes.get_title()
    plt.close(axes.figure)


def test_plot_draws_where_it_is_told() -> None:
    figure, (left, right) = plt.subplots(1, 2)
    assert nested().plot(left) is left
    assert nested().plot(ax=right, by="reason") is right
    figure.canvas.draw()
    plt.close(figure)
    with pytest.raises(ml.SettingsError, match=r"by is 'cause'; allowed: 'level', 'reason'"):
        nested().plot(by="cause")


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1)])
def test_tiny_maps_plot(shape: tuple[int, int]) -> None:
    for level, reason in ((CULLED, ml.Reason.EMITTER), (0, ml.Reason.COARSEST), (NOTHING, NOTHING)):
        fragments = Fragments(np.full(shape, level, np.uint8), np.full(shape, reason, np.uint8))
        axes = fragments.plot(by="reason")
        axes.figure.canvas.draw()
        plt.close(axes.figure)


def test_every_level_and_every_reason_has_its_colour() -> None:
    levels = np.array([[*range(17), CULLED, NOTHING]], np.uint8)
    assert len(np.unique(notebook.level_colors(levels)[0], axis=0)) == 19
    reasons = np.array([list(ml.Reason)], np.uint8)
    assert len(np.unique(notebook.reason_colors(reasons)[0], axis=0)) == len(ml.Reason)
    # what is culled is grey or white, why a fragment was refined is not
    spread = np.ptp(notebook.reason_colors(reasons)[0].astype(int), axis=-1)
    for reason, value in zip(ml.Reason, spread, strict=True):
        assert (value < 45) == (reason in CULLING or reason is ml.Reason.NOTHING), reason


def test_a_frame_plots_its_own_fragments(renderer: ml.Renderer) -> None:
    scene, camera = CLAIMS["boxes"].build(48, 40)
    frame = renderer.render(scene, camera, ml.Settings.preset("default").replace(light_samples=16))
    axes = frame.fragments.plot(by="reason")
    labels = {text.get_text() for text in axes.get_legend().get_texts()}
    assert "emitter" in labels
    shown = axes.get_images()[0].get_array()
    np.testing.assert_array_equal(shown, notebook.reason_colors(frame.fragments.reason_map))
    plt.close(axes.figure)
