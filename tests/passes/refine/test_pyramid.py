"""`pyramid`: each texel of each level against its own pixels, in float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, plane_gbuffer, wavy_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.pyramids import pyramid_record, sizes, texels
from tests.passes.reference.run import ULP, Runner, assert_not_within, assert_within
from tests.passes.reference.structs import NOTHING, SURFACE, floats

STEM = "passes/refine/pyramid"
SIZES = [(37, 21), (1, 19), (23, 1), (32, 16), (2, 2), (1, 1)]
Rows = NDArray[Any]


def run(
    runner: Runner, view: Rows, g: GBuffer, coarsest: int, steepness: bool = True
) -> tuple[Rows, Rows, Rows]:
    """Means (texels, 3, 4) words, ranges (texels, 2, 4) and spreads (texels, 2) of levels 1 to `coarsest`."""
    levels = sizes(int(view["width"][0]), int(view["height"][0]))
    count = sum(row[3] for row in levels[1 : coarsest + 1])
    out: dict[str, Rows] = {
        "means": np.zeros((3 * count, 4), np.uint32),
        "ranges": np.zeros((2 * count, 4), np.float32),
    }

    def step(entry: str, level: int, names: list[str], **given: Any) -> None:
        kept = {name: out[name] for name in names}
        found = runner(
            STEM,
            levels[level][3],
            entry=entry,
            pyramid=pyramid_record(view, coarsest, level=level),
            **given,
            **kept,
        )
        for name, array in kept.items():
            if name in found:
                out[name] = found[name].view(array.dtype).reshape(array.shape)

    rows = g.rows()
    step("base", 1, ["means", "ranges"], constants={"STEEPNESS": steepness}, view=view, **rows)
    for level in range(2, coarsest + 1):
        step("reduce", level, ["means", "ranges"])
    out["spreads"] = np.zeros(2 * count, np.uint32)
    del rows["g_geometric"]
    step("deviations", 1, ["means", "spreads"], view=view, **rows)
    spreads = out["spreads"].view(np.float32).reshape(-1, 2)
    return out["means"].reshape(-1, 3, 4), out["ranges"].reshape(-1, 2, 4), spreads


@pytest.mark.parametrize("size", SIZES)
def test_every_texel_agrees_with_its_pixels(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view)
    g.kind[0] = NOTHING
    coarsest = 6
    means, ranges, spreads = run(runner, view, g, coarsest)
    expected = texels(view, g, coarsest)
    words = means[..., 3].view(np.float32)
    reach = float(np.abs(g.position).max())

    assert (means[:, 0, 3] == expected.count).all()
    assert_within(floats(means[:, 0]), expected.position, 40 * ULP * reach, "positions")
    assert_within(floats(means[:, 1]), expected.normal, 40 * ULP, "normals")
    assert_within(floats(means[:, 2]), expected.geometric, 40 * ULP, "geometric normals")
    # differences of coordinates lose their size; a pixel is about 1/40 of the depth wide
    assert_within(words[:, 2], expected.slope, 2e3 * ULP * reach + 1e-5 * expected.slope, "slopes")
    assert_within(words[:, 1], expected.curvature, 1e-4 * (1 + expected.curvature), "curvatures")
    some = expected.count > 0
    assert_within(ranges[some, 0], expected.least[some], 40 * ULP * reach, "least")
    assert_within(ranges[some, 1], expected.most[some], 40 * ULP * reach, "largest")
    assert (ranges[~some, 0] > ranges[~some, 1]).all()
    assert_within(
        spreads[:, 0] * expected.width, expected.plane * expected.width, 100 * ULP * reach, "planes"
    )
    assert_within(spreads[:, 1], expected.cone, 20 * ULP, "cones")

    if size[0] * size[1] < 10:
        return
    everywhere = GBuffer(g.position, g.error, g.normal, g.geometric, np.full_like(g.kind, SURFACE))
    other = texels(view, everywhere, coarsest)
    assert_not_within(means[:, 0, 3], other.count, 0)
    assert_not_within(floats(means[:, 0]), other.position, 40 * ULP * reach)
    assert_not_within(spreads[:, 1], expected.cone * 1.001, 20 * ULP)
    assert_not_within(words[:, 2], expected.slope * 1.001, 1e-5 * expected.slope)


def test_what_sees_no_surface_does_not_count(runner: Runner, rng: np.random.Generator) -> None:
    """NaN where nothing is seen reaches no texel."""
    view = random_view(rng, 20, 12)
    g = wavy_gbuffer(rng, view, holes=0.5)
    clean = run(runner, view, g, 4)
    holes = g.kind != SURFACE
    for array in (g.position, g.normal, g.geometric):
        array[holes] = np.nan
    for found, before in zip(run(runner, view, g, 4), clean, strict=True):
        assert found.tobytes() == before.tobytes()


@pytest.mark.parametrize("tilt", [0.0, 60.0, 80.0])
def test_a_tilted_plane_lies_in_its_tangent_plane(
    runner: Runner, rng: np.random.Generator, tilt: float
) -> None:
    """Range and slope grow with the tilt; the distance to the mean plane stays nothing."""
    view = random_view(rng, 64, 64)
    view["cx"], view["cy"], view["fx"], view["fy"] = 32, 32, 200, 200
    g = plane_gbuffer(view, tilt)
    _, ranges, spreads = run(runner, view, g, 5)
    assert spreads[:, 0].max() < 1e-3
    assert spreads[:, 1].max() < 1e-6
    deepest = (ranges[:, 1, 3] - ranges[:, 0, 3])[-4:]
    if tilt:
        assert deepest.min() > 0.1, "the range of depth does see the tilt"


def test_slopes_and_curvatures_are_left_out_where_nobody_asks(
    runner: Runner, rng: np.random.Generator
) -> None:
    view = random_view(rng, 32, 16)
    g = wavy_gbuffer(rng, view)
    means, ranges, _ = run(runner, view, g, 3)
    fewer, same, _ = run(runner, view, g, 3, steepness=False)
    assert (same == ranges).all()
    assert (fewer[..., :3] == means[..., :3]).all()
    assert (means[:, 1:, 3] != 0).any()
    assert not fewer[:, 1:, 3].any()
