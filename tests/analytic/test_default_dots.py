"""Single pixels that stand out from their neighbours, and whether they stand on a lattice."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

import miplight as ml
from tests.claim_scenes import CLAIMS

Map = NDArray[np.float64]
SIZE = 224
OUTPUTS = ("direct", "surface_mask")
RATIO = ml.Settings.preset("brute-force").replace(direct_estimator="ratio")
AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)
STANDS_OUT, SMOOTH = 0.08, 0.03  # of the light that a pixel may see
LATTICE = 1.5  # chance makes 1 and less; of the few dozen dots that there are, a little more


def stand_out(found: Map, truth: Map, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels far from the median of their neighbours where the truth is smooth; (H, W, 3) shares."""
    dots = np.zeros(there.shape, bool)
    for channel in range(3):
        own, right = (
            np.abs(share[..., channel] - ndimage.median_filter(share[..., channel], footprint=AROUND))
            for share in (found, truth)
        )
        dots |= (own > STANDS_OUT) & (right < SMOOTH)
    return np.asarray(dots & there, np.bool_)


def lattice(dots: NDArray[np.bool_]) -> float:
    """Pairs of dots two pixels apart over pairs of neighbours: below 1 for noise that a filter spread."""

    def pairs(apart: int) -> int:
        return int((dots[apart:] & dots[:-apart]).sum() + (dots[:, apart:] & dots[:, :-apart]).sum())

    return pairs(2) / max(pairs(1), 20)


@pytest.mark.parametrize(
    "name", ["sphere_one", "boxes", "far_near", "sphere_card", "ribbon_video", "torture_wide"]
)
def test_no_dots(renderer: ml.Renderer, name: str) -> None:
    scene, camera = CLAIMS[name].build(SIZE, SIZE)
    settings = (
        RATIO.replace(visibility="none"),
        ml.Settings.preset("default"),
        RATIO.replace(light_samples=1024),
    )
    frames = [renderer.render(scene, camera, s, OUTPUTS) for s in settings]
    full, own, right = (frame.direct.astype(np.float64) for frame in frames)
    mask = frames[0].surface_mask
    there = mask & (full.min(axis=-1) > 0.02 * full[mask].mean())
    scale = np.where(there[..., None], full, 1.0)
    found, truth = own / scale, right / scale
    dots = stand_out(found, truth, there)
    assert dots.sum() < 0.025 * there.sum()
    assert lattice(dots) < LATTICE
    # negative control: dots on every other pixel of every other row, in a tenth of the picture
    spoilt = found.copy()
    spoilt[1::2, 1::2][:, ::5] += 0.15
    spoilt[1::2, 1::2][:, 1::5] += 0.15
    more = stand_out(spoilt, truth, there)
    assert more.sum() > 0.025 * there.sum()
    assert lattice(more & ~dots) > LATTICE
