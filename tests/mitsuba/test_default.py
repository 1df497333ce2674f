"""The default preset against Mitsuba: the errors that it promises, at a tenth of brute force's rays."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

import miplight as ml
from miplight.mitsuba import Reference
from miplight.testing import Comparison
from tests.claim_scenes import CLAIMS
from tests.mitsuba.reference_scenes import STORED, load

pytestmark = pytest.mark.mitsuba

MatchReference = Callable[..., Comparison]

ROOM = {"relative_rmse": 0.02, "median": 0.006, "energy": 0.003}
BOUNDS: dict[str, dict[str, float]] = {
    "one_light": ROOM,
    "two_lights": ROOM,
    "textured_light": ROOM,
    "dragon_two": ROOM,
    "dragon_card": ROOM,
    # 4 % at 256 x 256; here a pixel holds four times as much clutter
    "cluttered": {"relative_rmse": 0.05, "energy": 0.005},
    "ribbon_video": {"relative_rmse": 0.04, "energy": 0.005},
    "far_near": {"relative_rmse": 0.03, "energy": 0.003},
}
DEFAULT = ml.Settings.preset("default")


def _spoilt(reference: Reference) -> dict[str, Reference]:
    """References that a right picture must not match."""
    return {
        "darker": dataclasses.replace(
            reference,
            mean=reference.mean / np.float32(1.05),
            halves=reference.halves / np.float32(1.05),
        ),
        "moved": dataclasses.replace(
            reference, mean=np.roll(reference.mean, 3, 1), halves=np.roll(reference.halves, 3, 2)
        ),
    }


@pytest.mark.parametrize("name", list(BOUNDS))
def test_direct_light(
    renderer: ml.Renderer, match_reference: MatchReference, name: str, request: pytest.FixtureRequest
) -> None:
    if STORED[name].needs_scenes:
        request.getfixturevalue("scenes_folder")
    reference = load(name)
    scene, camera = STORED[name].build()
    frame = renderer.render(scene, camera, DEFAULT)
    result = match_reference(frame, reference, **BOUNDS[name])
    print(f"{name}: {result}")
    # a large gap would be a bug to look at: a few pixels that are quite wrong
    assert result.untrimmed < 4 * max(result.relative_rmse, 0.005)
    for spoilt in _spoilt(reference).values():  # negative controls
        with pytest.raises(AssertionError):
            ml.testing.assert_matches(frame, spoilt, relative_rmse=BOUNDS[name]["relative_rmse"])


@pytest.mark.parametrize("name", ["one_light", "textured_light"])
def test_without_visibility_the_bounds_are_broken(renderer: ml.Renderer, name: str) -> None:
    """Negative control of all of them: a picture without its shadows is far off."""
    scene, camera = STORED[name].build()
    clear = ml.Settings.preset("brute-force").replace(visibility="none")
    frame = renderer.render(scene, camera, clear)
    with pytest.raises(AssertionError):
        ml.testing.assert_matches(frame, load(name), relative_rmse=0.1)


def costs(renderer: ml.Renderer, name: str, size: int) -> tuple[float, float]:
    """Rays of all kinds, and fragments, for each pixel that sees a surface."""
    scene, camera = CLAIMS[name].build(size, size)
    renderer.render(ml.Scene(), camera, DEFAULT)  # what was seen before is forgotten: all rays count
    frame = renderer.render(scene, camera, DEFAULT)
    pixels = int(frame.surface_mask.sum())
    return frame.stats.rays / pixels, frame.fragments.total / pixels


@pytest.mark.parametrize("name", ["sphere_one", "sphere_two", "sphere_card", "boxes", "dragon_one"])
def test_few_rays_and_few_fragments(renderer: ml.Renderer, name: str, request: pytest.FixtureRequest) -> None:
    if CLAIMS[name].needs_scenes:
        request.getfixturevalue("scenes_folder")
    bounds = CLAIMS[name].bounds
    rays, fragments = costs(renderer, name, 256)
    assert bounds.rays_a_pixel is not None
    assert bounds.fragments_a_pixel is not None
    assert rays <= bounds.rays_a_pixel
    assert fragments <= bounds.fragments_a_pixel
    # the number of fragments follows what there is to see, and not the number of pixels
    assert costs(renderer, name, 512)[1] < fragments
