"""`one_pass`: level and reason of every pixel, and the first pixel of every fragment, against plain loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, plane_gbuffer, wavy_gbuffer
from tests.passes.reference.image import pixel_numbers, random_view
from tests.passes.reference.lights import Area, Light, Spot, table
from tests.passes.reference.pyramids import pyramid_record, sizes, texels
from tests.passes.reference.refining import (
    CULLED,
    DEPTH_METRICS,
    FRAGMENT,
    LIT,
    NORMAL_METRICS,
    ROUGH_DEPTH,
    ROUGH_NORMAL,
    choose,
    depth_change,
    normal_change,
    pixel_bits,
    texel_states,
)
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import NOTHING, ONE_PASS, SURFACE, record
from tests.passes.refine.test_pyramid import run as run_pyramid

STEM = "passes/refine/one_pass"
Rows = NDArray[Any]


class Chosen:
    """What the pass writes."""

    def __init__(self, view: Rows, state: Rows, out: dict[str, Rows], at: Rows) -> None:
        width, height = int(view["width"][0]), int(view["height"][0])
        self.state = state
        self.level_map = read(out, "level_map", np.uint32, height, width)
        self.reason_map = read(out, "reason_map", np.uint32, height, width)
        self.at = at
        flags, pixels = read(out, "fragment_flags", np.uint32), pixel_numbers(width, height)
        assert not flags[pixels < 0].any()
        places = np.flatnonzero(flags & FRAGMENT)
        rows, columns = np.divmod(pixels[places], width)
        levels = (flags[places] & 255).astype(int) - 1
        self.fragments = sorted(zip(levels.tolist(), rows.tolist(), columns.tolist(), strict=True))


def culled(
    runner: Runner, view: Rows, g: GBuffer, lights: Sequence[Light], given: dict[str, Rows], total: int
) -> Rows:
    """States of all texels after `cull`."""
    width, height = int(view["width"][0]), int(view["height"][0])
    marked = runner(
        STEM,
        sizes(width, height)[1][3],
        entry="cull",
        lights=table(list(lights)),
        marks=np.zeros(total, np.uint32),
        **given,
        **g.rows(),
    )
    return read(marked, "marks", np.uint32)


def lit(runner: Runner, view: Rows, g: GBuffer, given: dict[str, Rows], total: int) -> Rows:
    """States of all texels after `all_lit`."""
    blocks = sizes(int(view["width"][0]), int(view["height"][0]))[1][3]
    marks = np.zeros(total, np.uint32)
    pyramid, normal = given["pyramid"], g.rows()["g_normal"]
    return read(
        runner(STEM, blocks, entry="all_lit", marks=marks, pyramid=pyramid, g_normal=normal),
        "marks",
        np.uint32,
    )


def chosen(
    runner: Runner, view: Rows, g: GBuffer, pyramid: Rows, state: Rows, all_lit: bool = False
) -> Chosen:
    """What follows from the states."""
    width, height = int(view["width"][0]), int(view["height"][0])
    places = len(pixel_numbers(width, height))
    out = runner(
        STEM,
        places,
        entry="choose",
        constants={"ALL_LIT": all_lit},
        pyramid=pyramid,
        g_normal=g.rows()["g_normal"],
        texel_state=state,
        level_map=np.full(width * height, 77, np.uint32),
        reason_map=np.full(width * height, 77, np.uint32),
        fragment_flags=np.full(places, 77, np.uint32),
        fragment_at=np.zeros(len(state), np.uint32),
    )
    return Chosen(view, state, out, read(out, "fragment_at", np.uint32))


def constants(metrics: tuple[int, int]) -> dict[str, float]:
    """Metrics of depth and normal by number, as the shaders know them."""
    return {"DEPTH_METRIC": metrics[0], "NORMAL_METRIC": metrics[1]}


def refine(
    runner: Runner,
    view: Rows,
    g: GBuffer,
    lights: Sequence[Light] | None,
    coarsest: int,
    finest: int = 0,
    metrics: tuple[int, int] = (0, 0),
    at_once: bool = False,
    **params: Any,
) -> Chosen:
    """Pyramid and refinement of a G-buffer; metrics of depth and normal by number, thresholds.

    Without lights all is lit; `at_once`: as the shaders know beforehand.
    """
    given = {
        "params": record(ONE_PASS, lights=len(lights or []), **params),
        "pyramid": pyramid_record(view, coarsest, finest),
    }
    total = sum(row[3] for row in sizes(int(view["width"][0]), int(view["height"][0]))[: coarsest + 1])
    if at_once:
        state = np.full(total, 77, np.uint32)
    elif lights is None:
        state = lit(runner, view, g, given, total)
    else:
        state = culled(runner, view, g, lights, given, total)
    if coarsest > (0 if at_once else finest):
        means, ranges, spreads = run_pyramid(runner, view, g, coarsest)
        classified = runner(
            STEM,
            len(means),
            entry="classify",
            view=view,
            means=means.reshape(-1, 4),
            ranges=ranges.reshape(-1, 4),
            spreads=spreads.ravel(),
            texel_state=state,
            constants={**constants(metrics), "ALL_LIT": at_once},
            **given,
        )
        state = read(classified, "texel_state", np.uint32)
    return chosen(runner, view, g, given["pyramid"], state, at_once)


def _gap(values: Rows, share: float) -> float:
    """A threshold with `share` of the values below it, in the middle between its neighbours."""
    ordered = np.unique(values.astype(np.float32))
    at = min(int(share * len(ordered)), len(ordered) - 2)
    return float(ordered[at] / 2 + ordered[at + 1] / 2) if len(ordered) > 1 else float(ordered[0] * 1.5 + 1)


def some_lights(rng: np.random.Generator, view: Rows) -> list[Light]:
    """An area light beside the surface, which only some of it faces, and a spot on another part."""
    v = {name: view[name][0].astype(np.float64) for name in ("eye", "right", "up", "backward")}
    middle = v["eye"] - 3.0 * v["backward"]
    corner = middle + 1.2 * v["right"] + 0.5 * v["up"]
    area = Area(corner, 0.3 * v["up"] + 0.1 * v["right"], 0.2 * v["backward"] - 0.1 * v["right"], np.ones(3))
    position = middle - 2 * v["right"] + rng.normal(size=3) * 0.2
    return [area, Spot(position, v["right"] - 0.3 * v["backward"], np.ones(3), 0.95)]


def numbers_of(metrics: tuple[str, str]) -> tuple[int, int]:
    """Metrics by number."""
    return DEPTH_METRICS[metrics[0]], NORMAL_METRICS[metrics[1]]


def rough_texels(
    view: Rows, g: GBuffer, coarsest: int, metrics: tuple[str, str]
) -> tuple[dict[str, Any], NDArray[np.int64]]:
    """Thresholds of metrics that some of the texels are above of, and which these are."""
    t = texels(view, g, max(coarsest, 1))
    depth, normal = depth_change(t, metrics[0]), normal_change(t, metrics[1])
    limits = _gap(depth[t.count > 0], 0.7), _gap(normal[t.count > 0], 0.6)
    rough = ROUGH_DEPTH * ((depth > limits[0]) | (t.count < t.pixels)) + ROUGH_NORMAL * (normal > limits[1])
    params = {
        "depth_threshold": limits[0],
        "normal_threshold": limits[1],
    }
    return params, rough


CASES = [
    ((37, 21), 4, 0),
    ((64, 40), 5, 1),
    ((1, 19), 3, 0),
    ((23, 1), 16, 0),
    ((24, 16), 0, 0),
    ((33, 17), 2, 2),
]


@pytest.mark.parametrize(("size", "coarsest", "finest"), CASES)
@pytest.mark.parametrize("metrics", [("range", "component"), ("derivative", "curvature"), ("plane", "cone")])
def test_levels_reasons_and_fragments_agree_with_the_loops(
    runner: Runner,
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    finest: int,
    metrics: tuple[str, str],
) -> None:
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=0.01, step=0.5)
    lights = some_lights(rng, view)
    params, rough = rough_texels(view, g, coarsest, metrics)
    found = refine(runner, view, g, lights, coarsest, finest, numbers_of(metrics), **params)
    bits = pixel_bits(g, lights)

    def expected(bits: Rows, rough: Rows) -> tuple[Rows, Rows, list[tuple[int, int, int]]]:
        return choose(g, texel_states(view, g, bits, rough, coarsest), coarsest, finest)

    levels, reasons, fragments = expected(bits, rough)
    assert (found.level_map == levels).all()
    assert (found.reason_map == reasons).all()
    assert found.fragments == fragments
    partition(found, bits)
    if coarsest > finest and size[0] * size[1] > 100:
        assert {254, 255} <= set(np.unique(levels)), "some pixels are culled, some see nothing"
        assert (found.reason_map != expected(bits, rough & ROUGH_NORMAL)[1]).any()
        assert (found.level_map != expected(np.minimum(bits, 1), rough)[0]).any()


def partition(found: Chosen, bits: Rows) -> None:
    """Every lit pixel lies in exactly one fragment, of the level that its map says; a culled one in none."""
    height, width = found.level_map.shape
    covered = np.zeros((height, width), int)
    for level, row, column in found.fragments:
        block = np.s_[row : row + 2**level, column : column + 2**level]
        covered[block] += 1
        inside = found.level_map[block]
        assert np.isin(inside, [level, 254, 255]).all()
        assert (inside == level).any()
    assert (covered <= 1).all()
    shaded = found.level_map < 254
    assert (covered[shaded] == 1).all()
    assert shaded[(bits & LIT).reshape(height, width) != 0].all(), "what a light reaches is not culled"


@pytest.mark.parametrize("tilt", [0.0, 60.0, 80.0])
def test_a_bare_tilted_plane_stays_at_the_coarsest_level(
    runner: Runner, rng: np.random.Generator, tilt: float
) -> None:
    """N19: the distance to the tangent plane does not see the tilt; range and derivative do."""
    view = random_view(rng, 64, 64)
    view["cx"], view["cy"], view["fx"], view["fy"] = 32, 32, 200, 200
    g = plane_gbuffer(view, tilt)
    eye, backward = (view[name][0].astype(np.float64) for name in ("eye", "backward"))
    light = [Spot(eye + backward * 0.1, -backward, np.ones(3), 0.1)]
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25}
    found = refine(runner, view, g, light, 4, metrics=(3, 2), **limits)
    assert (found.level_map == 4).all()
    assert not found.reason_map.any()
    assert len(found.fragments) == 16
    if tilt:
        for metric in (1, 2):
            other = refine(runner, view, g, light, 4, metrics=(metric, 2), **limits)
            assert (other.level_map < 4).any(), f"metric {metric} fires on a smooth floor"


@pytest.mark.parametrize("metric", [1, 2, 3])
def test_a_crease_refines(runner: Runner, rng: np.random.Generator, metric: int) -> None:
    """Two planes that meet at column 29: fragments across it go down to pixels, for the normal's sake."""
    view = random_view(rng, 64, 32)
    g = plane_gbuffer(view, 0.0)
    turned = np.arange(64 * 32) % 64 >= 29
    side = (0.6 * view["right"][0] + 0.8 * view["backward"][0]).astype(np.float32)
    g.normal[turned] = g.geometric[turned] = side
    eye, backward = (view[name][0].astype(np.float64) for name in ("eye", "backward"))
    light = [Spot(eye + backward * 0.1, -backward, np.ones(3), 0.1)]
    found = refine(runner, view, g, light, 4, metrics=(0, metric), normal_threshold=0.2)
    assert (found.level_map[:, 28:30] == 0).all()
    assert (found.reason_map[:, 28:30] == 2).all()
    assert (found.level_map[:, :16] == 4).all()
    assert (found.level_map[:, 48:] == 4).all()
    blind = refine(runner, view, g, light, 4, normal_threshold=0.2)
    assert (blind.level_map == 4).all(), "without the metric nothing is split"


def test_no_light_culls_everything_and_says_so(runner: Runner, rng: np.random.Generator) -> None:
    view = random_view(rng, 32, 32)
    g = plane_gbuffer(view, 0.0)
    found = refine(runner, view, g, [], 3, metrics=(3, 0), depth_threshold=0.05)
    assert (found.level_map == 254).all()
    assert (found.reason_map == 8).all()
    assert found.fragments == []
    first = sizes(32, 32)[3][2]
    assert (found.at[first:] == CULLED).all()
    assert not found.at[:first].any()


@pytest.mark.parametrize(("coarsest", "finest"), [(4, 0), (4, 1), (3, 3), (0, 0)])
def test_it_needs_no_marks_where_all_is_lit(
    runner: Runner, rng: np.random.Generator, coarsest: int, finest: int
) -> None:
    view = random_view(rng, 41, 30)
    g = wavy_gbuffer(rng, view, holes=0.02, step=0.5)
    rows, columns = np.divmod(np.arange(41 * 30), 41)
    g.kind[(rows < 17) & (columns >= 16) & (columns < 32)] = (
        NOTHING  # a texel of the coarsest level sees nothing
    )
    limits = {"metrics": (3, 2), "depth_threshold": 0.1, "normal_threshold": 0.2}
    marked, plain = (
        refine(runner, view, g, None, coarsest, finest, at_once=at_once, **limits)
        for at_once in (False, True)
    )
    assert (plain.level_map == marked.level_map).all()
    assert (plain.reason_map == marked.reason_map).all()
    assert plain.fragments == marked.fragments
    assert (plain.at == marked.at).all()
    assert len(plain.fragments) > 10


def test_where_light_comes_from_everywhere_no_light_culls(runner: Runner, rng: np.random.Generator) -> None:
    view = random_view(rng, 41, 30)
    g = wavy_gbuffer(rng, view, holes=0.02, step=0.5)
    found = refine(runner, view, g, None, 4, metrics=(3, 0), depth_threshold=0.1)
    surfaces = (g.kind == SURFACE).reshape(30, 41)
    assert ((found.level_map < 254) == surfaces).all()
    assert (found.state[: 41 * 30] == np.where(surfaces.ravel(), LIT, 0)).all()
    bits = np.where(g.kind == SURFACE, LIT, 0)
    partition(found, bits)
    some = refine(runner, view, g, some_lights(rng, view), 4, metrics=(3, 0), depth_threshold=0.1)
    assert ((some.level_map < 254) != surfaces).any(), "the lights do cull some"
