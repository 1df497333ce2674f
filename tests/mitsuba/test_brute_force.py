"""The brute-force preset against Mitsuba, within the bounds that the project promises."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight.mitsuba import Reference
from miplight.testing import Comparison, compare
from tests.mitsuba.reference_scenes import STORED, load

pytestmark = pytest.mark.mitsuba

MatchReference = Callable[..., Comparison]

# relative RMSE and median allowed with 256 jittered samples a light
DIRECT: dict[str, dict[str, float]] = {
    "one_light": {"relative_rmse": 0.015, "median": 0.006, "energy": 0.002},
    "two_lights": {"relative_rmse": 0.015, "median": 0.006, "energy": 0.002},
    "textured_light": {"relative_rmse": 0.02, "energy": 0.002},
    "hard_spot": {"relative_rmse": 0.02, "median": 0.002, "energy": 0.005},
    "cluttered": {"relative_rmse": 0.03, "energy": 0.005},
    # slats within centimetres of the window: plain light sampling is noisy there, and right on average
    "blind": {"relative_rmse": 0.15, "energy": 0.005},
}


def settings(**changes: Any) -> ml.Settings:
    return ml.Settings.preset("brute-force").replace(light_samples=256, light_pattern="jittered", **changes)


@pytest.mark.parametrize("name", list(DIRECT))
def test_direct_light(renderer: ml.Renderer, match_reference: MatchReference, name: str) -> None:
    reference = load(name)
    scene, camera = STORED[name].build()
    frame = renderer.render(scene, camera, settings())
    result = match_reference(frame, reference, **DIRECT[name])
    print(f"{name}: {result}")
    # negative controls: a reference 3 % darker, and one moved by four pixels
    brighter = dataclasses.replace(
        reference, mean=reference.mean / np.float32(1.03), halves=reference.halves / np.float32(1.03)
    )
    with pytest.raises(AssertionError):
        ml.testing.assert_matches(frame, brighter, **DIRECT[name])
    moved = Reference(
        np.roll(reference.mean, 4, 1),
        np.roll(reference.halves, 4, 2),
        reference.variance,
        reference.spp,
        reference.info,
    )
    with pytest.raises(AssertionError):
        ml.testing.assert_matches(frame, moved, relative_rmse=DIRECT[name]["relative_rmse"])


def test_one_bounce(renderer: ml.Renderer, match_reference: MatchReference) -> None:
    scene, camera = STORED["one_bounce"].build()
    frame = renderer.render(scene, camera, settings(indirect="final-gather", gather_rays=256))
    match_reference(frame, load("one_bounce"), relative_rmse=0.03)
    indirect = load("one_bounce_indirect")
    match_reference(frame, indirect, energy=0.01)
    # negative control: direct light alone is too dark
    with pytest.raises(AssertionError):
        ml.testing.assert_matches(
            frame.direct, load("one_bounce"), relative_rmse=0.03, mask=frame.surface_mask
        )
    assert indirect.mean.mean() > 0.1 * load("one_bounce").mean.mean()


@pytest.mark.slow
def test_four_bounces(renderer: ml.Renderer, match_reference: MatchReference) -> None:
    scene, camera = STORED["four_bounces_indirect"].build()
    frame = renderer.render(scene, camera, settings(indirect="final-gather", gather_rays=64, bounces=4))
    match_reference(frame, load("four_bounces_indirect"), energy=0.01)
    # negative control: one bounce has a quarter less energy and more
    assert compare(frame, load("one_bounce_indirect")).energy > 0.1


def test_the_lights_in_view(renderer: ml.Renderer) -> None:
    """What the camera sees of a light itself is the same, too: the whole image, not only its parts."""
    scene, camera = STORED["two_lights"].build()
    frame = renderer.render(scene, camera, settings())
    whole = STORED["two_lights"].render(spp=64, part="total", cached=False)
    assert frame.light_mask.sum() > 50
    np.testing.assert_allclose(frame.image[frame.light_mask], whole.mean[frame.light_mask], rtol=1e-5)


def test_camera_with_a_shifted_centre(renderer: ml.Renderer) -> None:
    scene, camera = STORED["hard_spot"].build()
    K = camera.K
    K[0] *= 0.5
    K[1] *= 0.4
    K[:2, 2] += (-9.0, 4.5)
    shifted = camera.replace(K=K, width=70, height=45)
    reference = ml.mitsuba.reference(scene, shifted, 16, cached=False)
    frame = renderer.render(scene, shifted, settings())
    result = ml.testing.assert_matches(frame, reference, relative_rmse=0.02, trim=0.005)
    assert result.reference.max() > 0.1
    K[0, 2] += 0.5  # negative control: half a pixel
    other = renderer.render(scene, camera.replace(K=K, width=70, height=45), settings())
    with pytest.raises(AssertionError):
        ml.testing.assert_matches(other, reference, relative_rmse=0.02, trim=0.005)


# -- the stored files themselves


@pytest.mark.parametrize("name", list(STORED))
def test_a_live_render_agrees_with_the_stored_one(name: str, request: pytest.FixtureRequest) -> None:
    """The files are not out of date: a few samples now agree within their noise."""
    if STORED[name].needs_scenes:
        request.getfixturevalue("scenes_folder")
    # a narrow spot's bounce is noisy: few paths find what it lights
    spp = 512 if name == "spot_indirect" else 16 if STORED[name].max_depth > 2 else 64
    stored = load(name)
    live = STORED[name].render(spp=spp, seed=11, cached=False)
    assert {key: live.info[key] for key in ("max_depth", "part", "pixel")} == {
        key: stored.info[key] for key in ("max_depth", "part", "pixel")
    }
    # differences of blocks of 8 × 8 pixels against their standard deviation; a floor for float16
    seen, kept = _blocks(live.mean), _blocks(stored.mean)
    spread = np.sqrt((_blocks(live.variance) + _blocks(stored.variance)) / 64) + 1e-3 * (kept + 0.01)

    def agrees(blocks: Any) -> bool:
        z = (blocks - kept) / spread
        return bool(abs(np.mean(z)) < 0.5 and np.quantile(np.abs(z), 0.95) < 3.0)

    assert agrees(seen)
    assert not agrees(1.06 * seen)  # negative control
    assert not agrees(seen[:, ::-1])


def _blocks(image: Any) -> Any:
    height, width = (size // 8 for size in image.shape[:2])
    return image.astype(np.float64).reshape(height, 8, width, 8, 3).mean(axis=(1, 3))


def test_stored_files_are_small_and_complete() -> None:
    from tests.mitsuba.reference_scenes import FOLDER

    assert {path.stem for path in FOLDER.glob("*.npz")} == set(STORED)
    assert max(path.stat().st_size for path in FOLDER.glob("*.npz")) <= 300_000
