"""`lobe_visible`: places seen by their ray, and by the variance of their neighbours' distances [DL06]."""

from __future__ import annotations

import numpy as np

from tests.passes.reference.image import random_view
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import HIT, MISS, RECEIVER, record

PARAMS = np.dtype([("first", "<u4"), ("places", "<u4"), ("side", "<u4"), ("pad", "<u4")])
STEM, PLACES = "passes/lobes/lobe_visible", 25


def test_a_ray_tells_all_or_nothing(runner: Runner, rng: np.random.Generator) -> None:
    hidden = rng.uniform(size=300) < 0.5
    bits = np.packbits(np.pad(hidden, (0, 20)), bitorder="little").view("<u4")
    out = runner(STEM, 300, entry="bits", occluded=bits, lobe_seen=np.full(300, 9, np.float32))
    assert (read(out, "lobe_seen", np.float32) == ~hidden).all()


def test_distances_are_those_to_the_light_less_one(runner: Runner, rng: np.random.Generator) -> None:
    hits = np.zeros(2 * PLACES, HIT)
    hits["t"] = rng.uniform(0, 1, len(hits))
    hits["instance"] = rng.choice([MISS, 3], len(hits))
    before = np.full(5 * PLACES, 9, np.float32)
    out = runner(
        STEM,
        len(hits),
        entry="distances",
        params=record(PARAMS, first=2, places=PLACES, side=5),
        hits=hits,
        lobe_distances=before,
    )
    found = read(out, "lobe_distances", np.float32).reshape(5, PLACES)
    met = hits["instance"] != MISS
    assert (found[2:4].ravel() == np.where(met, hits["t"] - np.float32(1), 0)).all()
    assert (found[[0, 1, 4]] == 9).all()


def test_variance_bounds_what_is_seen(runner: Runner, rng: np.random.Generator) -> None:
    """Fragments of one level on a plane, some missing; one faces away and does not count."""
    width = height = 24
    level, across = 1, 12
    view = random_view(rng, width, height)
    there = rng.uniform(size=(across, across)) < 0.9
    at = np.zeros(sum(row[3] for row in sizes(width, height)[:3]), np.uint32)
    first = sizes(width, height)[level][2]
    lines, columns = np.nonzero(there)
    count = len(lines)
    at[first + lines * across + columns] = np.arange(1, count + 1)
    receivers = np.zeros(count, RECEIVER)
    receivers["origin"] = np.column_stack([columns, np.zeros(count), lines])
    receivers["normal_geo"] = receivers["normal_shade"] = (0, 1, 0)
    away = count // 2
    receivers["normal_geo"][away] = receivers["normal_shade"][away] = (1, 0, 0)
    # places of the tile order: tiles of 8 × 8, pixels row by row
    y, x = 2 * lines, 2 * columns
    places = (y // 8 * 3 + x // 8) * 64 + y % 8 * 8 + x % 8
    flags = np.zeros(9 * 64, np.uint32)
    flags[places] = 256 + level + 1
    distances = np.where(rng.uniform(size=(count, PLACES)) < 0.5, 0, -rng.uniform(0, 0.9, (count, PLACES)))
    distances[:, 3] = 0
    distances[:, 4] = -0.5
    out = runner(
        STEM,
        count * PLACES,
        entry="variance",
        params=record(PARAMS, first=0, places=PLACES, side=5),
        pyramid=pyramid_record(view, 2),
        receivers=receivers,
        fragment_list=places.astype(np.uint32),
        fragment_flags=flags,
        fragment_at=at,
        lobe_seen=np.zeros(count * PLACES, np.float32),
        lobe_distances=distances.ravel().astype(np.float32),
    )
    found = read(out, "lobe_seen", np.float32, count, PLACES)
    expected = np.zeros((count, PLACES))
    for i in range(count):
        near = (np.abs(lines - lines[i]) <= 1) & (np.abs(columns - columns[i]) <= 1)
        if i == away:
            near[:] = False
        else:
            near[away] = False
        near[i] = True
        kept = distances[near]
        mean, s2 = kept.mean(0), np.maximum(kept.var(0), 1e-5)
        bound = np.maximum(s2 / (s2 + mean**2) - 0.2, 0) / 0.8
        expected[i] = np.where(mean > -1e-4, 1, bound)
    expected[:, 24] = expected[:, 18]
    assert_within(found, expected, 1e-5, "seen")
    assert (found[:, 3] == 1).all()
    assert (found[:, 4] < 1e-3).all()
    assert_not_within(found, expected + 0.01, 1e-5)
