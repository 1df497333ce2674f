"""`lobe_points`: shading points of the lobes' fragments, and the exponents they carry."""

from __future__ import annotations

import numpy as np

from tests.passes.reference.gbuffers import random_gbuffer
from tests.passes.reference.image import pixel_numbers, random_view
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import ULP, Runner, assert_within, read
from tests.passes.reference.structs import RECEIVER, SURFACE, record, row

PARAMS = np.dtype([("patterns", "<u4"), ("seed", "<u4"), ("pad", "<u4", 2)])
STEM = "passes/lobes/lobe_points"


def test_points_stand_on_their_fragments(runner: Runner, rng: np.random.Generator) -> None:
    width, height, level = 20, 12, 2
    view = random_view(rng, width, height)
    g = random_gbuffer(rng, width * height, surfaces=0.6)
    numbers = pixel_numbers(width, height)
    flags = np.zeros(len(numbers), np.uint32)
    for place, pixel in enumerate(numbers):
        y, x = divmod(int(pixel), width)
        if pixel < 0 or x % 4 or y % 4:
            continue
        block = np.add.outer(
            np.arange(y, min(y + 4, height)) * width, np.arange(x, min(x + 4, width))
        ).ravel()
        flags[place] = 256 + level + 1 if (g.kind[block] == SURFACE).any() else 0
    chosen = np.flatnonzero(flags).astype(np.uint32)
    levels = sizes(width, height)
    out = runner(
        STEM,
        len(chosen),
        params=record(PARAMS, patterns=1, seed=0),
        pyramid=pyramid_record(view, 3),
        fragment_list=chosen,
        fragment_flags=flags,
        receivers=np.zeros(len(chosen), RECEIVER),
        fragment_at=np.zeros(sum(row_[3] for row_ in levels[:4]), np.uint32),
        **g.rows(),
    )
    found, at = read(out, "receivers", RECEIVER), read(out, "fragment_at", np.uint32)
    pixels = found["pixel"].astype(int)
    assert (g.kind[pixels] == SURFACE).all()
    first = numbers[chosen]
    assert (pixels // width // 4 == first // width // 4).all()
    assert (pixels % width // 4 == first % width // 4).all()
    assert_within(found["origin"], g.origin[pixels], 2 * ULP * np.abs(g.origin[pixels]), "origins")
    texels = levels[level][2] + first // width // 4 * levels[level][0] + first % width // 4
    assert (at[texels] == np.arange(1, len(chosen) + 1)).all()
    assert np.count_nonzero(at) == len(chosen)


def test_exponents_are_those_of_the_instances(runner: Runner, rng: np.random.Generator) -> None:
    receivers = np.zeros(50, RECEIVER)
    receivers["pixel"] = rng.permutation(80)[:50]
    lobes, at = rng.uniform(0, 100, (6, 4)).astype(np.float32), rng.integers(0, 6, 80)
    out = runner(
        STEM,
        50,
        entry="exponents",
        receivers=receivers,
        g_albedo=row(np.zeros((80, 3)), at),
        instance_lobes=lobes,
    )
    found = read(out, "receivers", RECEIVER)["flags"].view(np.float32)
    assert (found == lobes[at[receivers["pixel"]], 3]).all()
