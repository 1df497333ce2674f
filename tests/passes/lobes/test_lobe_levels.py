"""`lobe_levels`: whose lobes meet a light, and which texels are wider than the lobe, against plain loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.gbuffers import GBuffer, wavy_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.lights import Area, Light, Spot, table
from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import SURFACE, record, row

PARAMS = np.dtype([("lights", "<u4"), ("texels", "<u4"), ("threshold", "<f4"), ("pad", "<u4")])
STEM, COARSEST = "passes/lobes/lobe_levels", 3
LIT, OUTSIDE, ROUGH, WIDE = 1, 128, 280, 256


def _unit(v: NDArray[Any]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return unit


def _mirrors(view: NDArray[Any], g: GBuffer) -> NDArray[np.float64]:
    along = _unit(g.position - view["eye"][0])
    mirror: NDArray[np.float64] = along - 2 * (along * g.normal).sum(1, keepdims=True) * g.normal
    return mirror


def _nearest(light: Light, p: NDArray[Any], mirror: NDArray[Any]) -> float:
    """Cosine to what is seen of a light nearest to the mirror direction: by 61 × 61 places."""
    if isinstance(light, Spot):
        return float(_unit(light.position - p) @ mirror)
    steps = np.linspace(0, 1, 61)
    ab = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    return float((_unit(light.point(ab) - p) @ mirror).max())


def _lights() -> list[Light]:
    return [
        Area(
            np.array([-1.0, 1, -3]), np.array([2.0, 0, 0]), np.array([0, 1.5, 0]), np.ones(3), two_sided=True
        ),
        Spot(np.array([1.0, 3, 1]), np.array([0, -1.0, 0]), np.ones(3), 0.5),
    ]


@pytest.mark.parametrize("threshold", [0.5, -1.0])
def test_states_agree_with_the_reference(runner: Runner, rng: np.random.Generator, threshold: float) -> None:
    width, height = 23, 14
    view = random_view(rng, width, height)
    g = wavy_gbuffer(rng, view, holes=0.1, step=0.5)
    lobes = np.array([(0, 0, 0, 4.0), (0.3, 0.2, 0.1, 3.0), (0.5, 0.5, 0.5, 40.0)])
    at = np.repeat(rng.integers(0, 3, (height // 4 + 1, width // 4 + 1)), 4, 0).repeat(4, 1)[:height, :width]
    at = at.ravel()
    levels = sizes(width, height)[: COARSEST + 1]
    before = rng.choice([LIT, LIT, 2, 4], sum(level[3] for level in levels)).astype(np.uint32)
    before[levels[0][3] :] |= rng.choice([0, 8, 16], len(before) - levels[0][3]).astype(np.uint32)
    common = {"g_normal": row(g.normal, g.kind), "pyramid": pyramid_record(view, COARSEST), "view": view}
    begun = runner(STEM, len(before), entry="begin", texel_state=before, lobe_state=np.full_like(before, 7))
    begun_state = read(begun, "lobe_state", np.uint32)
    assert (begun_state == (before & ROUGH)).all()
    out = runner(
        STEM,
        width * height,
        entry="mark",
        params=record(PARAMS, lights=2, texels=len(before), threshold=threshold),
        g_position=row(g.position, 0),
        g_albedo=row(np.zeros((len(at), 3)), at),
        instance_lobes=lobes.astype(np.float32),
        lights=table(_lights()),
        texel_state=before,
        marks=begun_state,
        **common,
    )
    found = read(out, "marks", np.uint32)
    expected, doubtful = _reference(view, g, lobes[at], before, threshold)
    wrong = found != expected
    assert not (wrong & ~doubtful).any()
    assert wrong.mean() < 0.02
    assert {int(v) for v in np.unique(found & (LIT | OUTSIDE))} >= {LIT, OUTSIDE, LIT | OUTSIDE}
    assert ((found & WIDE) != 0).any() == (threshold > 0)


def _reference(
    view: NDArray[Any], g: GBuffer, surface: NDArray[Any], before: NDArray[Any], threshold: float
) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """States, and where rounding may tell otherwise."""
    width, height = int(view["width"][0]), int(view["height"][0])
    state, doubt = (before & ROUGH).astype(np.uint32), np.zeros(len(before), bool)
    mirrors, lights = _mirrors(view, g), _lights()
    middles = [x.position if isinstance(x, Spot) else x.point(np.array([0.5, 0.5])) for x in lights]
    for pixel in np.flatnonzero(g.kind == SURFACE):
        y, x = divmod(int(pixel), width)
        n, matt = surface[pixel, 3], not surface[pixel, :3].any()
        cosines = [_nearest(light, g.position[pixel], mirrors[pixel]) for light in lights]
        height_ = max(max(c, 0.0) ** n for c in cosines)
        own = int(before[pixel]) & 135
        unsure = not matt and bool(own & LIT) and 0.7e-3 < height_ < 1.4e-3
        if matt or (own & LIT and height_ <= 1e-3):
            own = OUTSIDE
        for level, (columns, _, first, _) in enumerate(sizes(width, height)[: COARSEST + 1]):
            number = first + (y >> level) * columns + (x >> level)
            bits, near = own, False
            if level and not matt and threshold > 0:
                lo = np.array([x >> level << level, y >> level << level])
                hi = np.minimum(lo + 2**level, [width, height]) - 1
                middle = (lo + hi + 1) // 2
                other = int(middle[1]) * width + int(middle[0])
                if other != pixel and g.kind[other] == SURFACE:
                    turn = float(np.linalg.norm(mirrors[pixel] - mirrors[other]))
                    turn += max(
                        float(np.linalg.norm(_unit(m - g.position[pixel]) - _unit(m - g.position[other])))
                        for m in middles
                    )
                    limit = threshold * np.arccos(0.5 ** (1 / max(n, 0.05)))
                    if turn > limit or (surface[other] != surface[pixel]).any():
                        bits |= WIDE
                    near = abs(turn / limit - 1) < 1e-3
            state[number] |= bits
            doubt[number] |= unsure or near
    return state, doubt
