"""What a look at a picture would find: seams between levels, blocks, halos, missing contact shadows."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

import miplight as ml
from tests.claim_scenes import CLAIMS

Map = NDArray[np.float64]
SIZE = 192
DEFAULT = ml.Settings.preset("default")
RATIO = ml.Settings.preset("brute-force").replace(direct_estimator="ratio")
OUTPUTS = ("direct", "position", "normal", "surface_mask", "fragments")


class Shares:
    """Visible share of the light by the default and by 1,024 samples, where the light shines at all."""

    def __init__(self, renderer: ml.Renderer, name: str) -> None:
        scene, camera = CLAIMS[name].build(SIZE, SIZE)
        clear = renderer.render(scene, camera, RATIO.replace(visibility="none"), OUTPUTS)
        self.frame = renderer.render(scene, camera, DEFAULT, OUTPUTS)
        truth = renderer.render(scene, camera, RATIO.replace(light_samples=1024), OUTPUTS)
        full, own, right = (f.direct.sum(axis=-1, dtype=np.float64) for f in (clear, self.frame, truth))
        self.there = clear.surface_mask & (full > 0.02 * full[clear.surface_mask].mean())
        scale = np.where(self.there, full, 1.0)
        self.found: Map = np.where(self.there, own / scale, 0.0)
        self.truth: Map = np.where(self.there, right / scale, 0.0)

    def steps(self, values: Map, axis: int) -> tuple[NDArray[np.intp], Map]:
        """Row (or column) behind which each step from pixel to pixel lies, and its size, on one surface."""
        values, there = np.swapaxes(values, 0, axis), np.swapaxes(self.there, 0, axis)
        normal, position = (np.swapaxes(a, 0, axis) for a in (self.frame.normal, self.frame.position))
        flat = (normal[1:] * normal[:-1]).sum(axis=-1) > 0.999
        off = np.abs(((position[1:] - position[:-1]) * normal[1:]).sum(axis=-1)) < 0.01
        both = there[1:] & there[:-1] & flat & off
        where = np.broadcast_to(np.arange(len(values) - 1)[:, None], both.shape)
        return where[both], np.abs(values[1:] - values[:-1])[both]

    def seam(self, values: Map, period: int) -> float:
        """Steps across the edges of blocks by those inside of them, as a multiple of what the truth has."""
        ratios = []
        for picture in (values, self.truth):
            inside = across = 0.0
            for axis in (0, 1):
                where, step = self.steps(picture, axis)
                edge = where % period == period - 1
                across += float(step[edge].sum())
                inside += float(step[~edge].sum())
            ratios.append(across / max(inside, 1e-9))
        return ratios[0] / ratios[1]


def blocky(values: Map, there: NDArray[np.bool_], period: int) -> Map:
    """Means over blocks: what a seam looks like."""
    rows, columns = (np.arange(length) // period for length in values.shape)
    labels = rows[:, None] * (columns.max() + 1) + columns
    count = ndimage.sum_labels(there, labels, np.arange(labels.max() + 1))
    total = ndimage.sum_labels(np.where(there, values, 0), labels, np.arange(labels.max() + 1))
    result: Map = (total / np.maximum(count, 1))[labels]
    return result


@pytest.fixture(scope="module", params=["sphere_one", "boxes", "torture_small", "torture_wide"])
def shares(renderer: ml.Renderer, request: pytest.FixtureRequest) -> Shares:
    return Shares(renderer, request.param)


@pytest.mark.parametrize("period", [2, 4, 8, 16])
def test_no_seams_and_no_blocks(shares: Shares, period: int) -> None:
    """Steps from pixel to pixel are no larger across the edges of cells and tiles than within them."""
    assert shares.seam(shares.found, period) < 1.2
    # negative control: shares that are half way to the mean of their block
    blocks = blocky(shares.truth, shares.there, period)
    assert shares.seam((blocks + shares.truth) / 2, period) > 1.3


def test_no_seams_between_levels(shares: Shares) -> None:
    """Where a coarse fragment meets finer ones the picture does not jump: it stopped for a reason."""
    levels = shares.frame.fragments.level_map.astype(int)
    error = np.abs(shares.found - shares.truth)
    coarse = shares.there & (levels > 1) & (levels < 254)
    beside = coarse & ndimage.binary_dilation(shares.there & (levels <= 1), np.ones((3, 3)))
    if beside.sum() > 0:
        assert error[beside].mean() < 0.01
        assert np.sqrt((error[beside] ** 2).mean()) < 0.03
    # negative control: penumbrae as coarse as that would be seen
    early = np.abs(blocky(shares.truth, shares.there, 4) - shares.truth)
    assert np.sqrt((early[shares.there & (levels <= 1)] ** 2).mean()) > 0.03


def outlines(shares: Shares) -> NDArray[np.bool_]:
    """Pixels within three of a step in depth."""
    position = shares.frame.position.astype(np.float64)
    step = np.zeros(position.shape[:2], bool)
    for axis in (0, 1):
        apart = np.linalg.norm(np.diff(position, axis=axis, append=np.take(position, [-1], axis)), axis=-1)
        step |= apart > 0.3
    return np.asarray(ndimage.binary_dilation(step, np.ones((7, 7))) & shares.there, np.bool_)


def test_no_halos(shares: Shares) -> None:
    """Beside outlines the share is right on average: no light leaks over them, and no dark."""
    near = outlines(shares)
    assert near.sum() > 200
    error = shares.found - shares.truth
    assert abs(error[near].mean()) < 0.01
    assert np.sqrt((error[near] ** 2).mean()) < 0.1
    # negative control: a filter that knows of no outlines
    blurred = ndimage.gaussian_filter(shares.truth, 3.0) - shares.truth
    assert abs(blurred[near].mean()) > 0.01 or np.sqrt((blurred[near] ** 2).mean()) > 0.1


@pytest.mark.parametrize("name", ["boxes", "torture_small", "torture_wide"])
def test_contact_shadows_are_there(renderer: ml.Renderer, name: str) -> None:
    """On the floor within a few pixels of what stands on it, dark stays dark."""
    shares = Shares(renderer, name)
    frame = shares.frame
    floor = shares.there & (frame.position[..., 1] < 1e-4) & (frame.normal[..., 1] > 0.99)
    stands = frame.surface_mask & (frame.position[..., 1] > 1e-3) & (frame.position[..., 1] < 0.08)
    contact = floor & ndimage.binary_dilation(stands, np.ones((5, 5)))
    dark = contact & (shares.truth < 0.5)
    assert dark.sum() > 20
    assert shares.found[dark].mean() < shares.truth[dark].mean() + 0.02
    assert (shares.found[dark] > shares.truth[dark] + 0.4).mean() < 0.01
    # negative control: a fifth of the light more
    assert np.maximum(shares.found, 0.2)[dark].mean() > shares.truth[dark].mean() + 0.02
