"""What holds of every fragment map, whatever made it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import miplight as ml
from miplight.fragments import CULLED, NOTHING, Fragments

REFINED = {ml.Reason.DEPTH, ml.Reason.NORMAL, ml.Reason.ILLUMINATION, ml.Reason.VISIBILITY, ml.Reason.LOBE}
COARSEST = 16  # the largest value of the setting coarsest_level
CULLING = {ml.Reason.EMITTER, ml.Reason.FACING_AWAY, ml.Reason.BEHIND_LIGHT, ml.Reason.OUTSIDE_LOBE}


def spread(mask: NDArray[np.bool_], level: int, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """The pixels of the blocks that `mask` names."""
    rows, columns = (np.arange(length) >> level for length in shape)
    pixels: NDArray[np.bool_] = mask[np.ix_(rows, columns)]
    return pixels


def assert_partition(fragments: Fragments) -> None:
    """Every seen, unculled pixel lies in exactly one fragment, and maps, masks and counts say the same."""
    levels = fragments.level_map
    assert levels.dtype == np.uint8
    assert fragments.reason_map.dtype == np.uint8
    assert fragments.reason_map.shape == levels.shape
    height, width = levels.shape
    shaded = levels < CULLED
    assert set(np.unique(levels[~shaded])) <= {CULLED, NOTHING}
    assert levels[shaded].max(initial=0) <= COARSEST
    owners = np.zeros(levels.shape, int)
    for level, mask in enumerate(fragments.masks):
        size = 2**level
        assert mask.dtype == bool
        assert mask.shape == (-(-height // size), -(-width // size))
        assert fragments.counts[level] == np.count_nonzero(mask)
        pixels = spread(mask, level, levels.shape)
        owners += pixels
        # a fragment shades all of its block that needs shading
        assert np.array_equal(pixels & shaded, levels == level)
    assert (owners[shaded] == 1).all()
    assert fragments.total == sum(fragments.counts)
    assert fragments.extra >= 0


def assert_reasons(fragments: Fragments) -> None:
    """Every pixel's reason is one that its level allows."""
    levels, reasons = fragments.level_map, fragments.reason_map
    shaded = levels < CULLED
    assert set(np.unique(reasons[shaded])) <= {ml.Reason.COARSEST, *REFINED}
    assert set(np.unique(reasons[levels == CULLED])) <= CULLING
    assert (reasons[levels == NOTHING] == ml.Reason.NOTHING).all()
    # the coarsest fragments have no parent that could have been refined, the others have one
    coarsest = shaded & (reasons == ml.Reason.COARSEST)
    top = int(levels[shaded].max(initial=0))
    if coarsest.any() or fragments.coarsest_level == top > 0:
        assert np.array_equal(coarsest, shaded & (levels == top))


def assert_seen(frame: ml.Frame) -> None:
    """The map agrees with what the camera sees."""
    levels, reasons = frame.fragments.level_map, frame.fragments.reason_map
    surface, light = frame.surface_mask, frame.light_mask
    assert ((levels == NOTHING) == ~(surface | light)).all()
    assert ((reasons == ml.Reason.EMITTER) == light).all()
    assert (levels[light] == CULLED).all()
    # what is culled is unlit
    assert not frame.direct[surface & (levels == CULLED)].any()
