"""`textured_share`: ∫ L w / (L̄ ∫ w) for w = cosθ_s cosθ_l / d², by the picture's moments at nodes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference import irradiances as ir
from tests.passes.reference.gbuffers import GBuffer
from tests.passes.reference.lights import Area, random_area, table
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import LIGHT_NODE, LIGHT_SAMPLES, MOMENTS, SURFACE, record

Array = NDArray[np.float64]
STEM = "passes/gather/textured_share"
CELLS = 32
# blocks along an edge, nodes along an edge of a block
FINE, COARSE = (4, 3), (1, 6)


def _edge_rule(blocks: int, points: int) -> tuple[Array, Array]:
    """Nodes along an edge, and each one's polynomial integrated over the cells, by many midpoints."""
    inner = np.polynomial.legendre.leggauss(points)[0] / 2 + 0.5
    nodes = ((np.arange(blocks)[:, None] + inner) / blocks).ravel()
    # midpoints of 64 parts a cell: 1e-5 of a basis integral
    x = (np.arange(CELLS * 64) + 0.5) / (CELLS * 64)
    values = np.zeros((len(nodes), len(x)))
    for i in range(len(nodes)):
        block = i // points
        others = [inner[j] for j in range(points) if j != i % points]
        local = x * blocks - block
        inside = (local > 0) & (local < 1)
        ratio = [(local - o) / (inner[i % points] - o) for o in others]
        values[i] = inside * np.prod(ratio, axis=0)
    return nodes, values.reshape(len(nodes), CELLS, 64).mean(axis=2) / CELLS


def _rules() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    rule, basis = [], []
    for kind in (FINE, COARSE):
        nodes, rows = _edge_rule(*kind)
        a, b = np.meshgrid(nodes, nodes)
        weight = np.outer(rows.sum(axis=1), rows.sum(axis=1))
        rule.append(np.stack([a, b, weight, 0 * a], axis=-1).reshape(-1, 4))
        basis.append(rows.ravel())
    return np.concatenate(rule).astype(np.float32), np.concatenate(basis).astype(np.float32)


def _nodes(runner: Runner, light: Area) -> NDArray[np.void]:
    """The light's table, by `light_samples` and `moments`."""
    cells = runner(
        "passes/lights/light_samples", CELLS**2, entry="radiance", groups=True, lights=table([light]),
        params=record(LIGHT_SAMPLES, strata_u=CELLS, strata_v=CELLS, patterns=1),
        light_radiance=np.zeros((CELLS**2, 4), np.float32),
    )  # fmt: skip
    rule, basis = _rules()
    made = runner(
        STEM, len(rule), entry="moments", groups=True, rule=rule, basis=basis,
        texture=record(
            MOMENTS, mean=light.mean, cell_area=light.area / CELLS**2, fine=FINE[0] * FINE[1],
            coarse=COARSE[0] * COARSE[1],
        ),
        radiance_cells=read(cells, "light_radiance", np.float32, -1, 4),
        light_nodes=np.zeros(len(rule), LIGHT_NODE),
    )  # fmt: skip
    return read(made, "light_nodes", LIGHT_NODE)


def _factor(runner: Runner, scene: ir.Scene, nodes: NDArray[np.void]) -> NDArray[np.float32]:
    """Shares a pixel, (n, 4), each kind of tiles by its table."""
    lists, arguments = ir.sort(runner, scene)
    share, fine = scene.share, (FINE[0] * FINE[1]) ** 2
    for kind in range(4):
        if arguments[kind, 3] == 0:
            continue
        first, count = (fine, len(nodes) - fine) if kind == 1 else (0, fine)
        inputs = ir.shared_inputs(scene, lists, kind=kind, first_node=first, nodes=count, textured=1)
        out = runner(
            STEM,
            int(arguments[4 + kind, 0]) + 1,
            entry="factor",
            groups=True,
            share=share,
            light_nodes=nodes,
            **inputs,
        )
        share = read(out, "share", np.float32, -1, 4)
    return share


def _expected(light: Area, g: GBuffer, at: NDArray[np.int64], side: int = 256) -> tuple[Array, Array]:
    """The factor and the share of the light above both horizons, by side² midpoints."""
    x = (np.arange(side) + 0.5) / side
    ab = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    y, emitted = light.point(ab), light.emitted(ab)
    factor, above = np.ones((len(at), 3)), np.zeros(len(at))
    for k, i in enumerate(at):
        d = y - g.position[i]
        up = (d @ g.normal[i] > 0) & (d @ g.geometric[i] > 0)
        w = up * (d @ g.normal[i]) / (d * d).sum(axis=1) ** 2
        above[k] = up.mean()
        if w.sum() > 0:
            factor[k] = (w @ emitted) / (w.sum() * light.mean)
    return factor, above


def _scene(
    rng: np.random.Generator, light: Area, nearest: float, size: tuple[int, int] = (64, 48)
) -> ir.Scene:
    """All of it lit, nothing nearer than some light sizes."""
    made = ir.scene(rng, light, size)
    size_of = max(np.linalg.norm(light.u), np.linalg.norm(light.v))
    # the nearest point of the light is at most this far from the nearest of some
    ab = np.stack(np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 33)), axis=-1).reshape(-1, 2)
    gaps = np.linalg.norm(light.point(ab)[None] - made.gbuffer.position[:, None], axis=2).min(axis=1)
    kind = np.where(gaps > nearest * size_of, made.gbuffer.kind, 0)
    made.cells[:] = ir.CELL_LIT
    made.flags &= ~np.uint32(ir.DARK)
    return dataclasses.replace(made, gbuffer=dataclasses.replace(made.gbuffer, kind=kind))


def _picture(rng: np.random.Generator, kind: str) -> Array:
    """32 × 32 texels, three channels."""
    if kind == "noise":
        return rng.uniform(0, 9, (32, 32, 3))
    row, column = np.mgrid[:32, :32]
    step = ((column < 14) * 1.0 + 0.05)[..., None] * [1, 2, 3]
    disc = (((row - 12) ** 2 + (column - 18) ** 2 < 60) * 5 + 0.1)[..., None] * [3, 2, 1]
    return np.asarray(step if kind == "step" else disc, np.float64)


@pytest.mark.parametrize("kind", ["noise", "step", "disc"])
def test_the_factor_agrees_with_a_quadrature(runner: Runner, rng: np.random.Generator, kind: str) -> None:
    """10⁻³ from half a light size on; a little more where a horizon cuts the light between nodes."""
    light = dataclasses.replace(random_area(rng, two_sided=True), radiance=_picture(rng, kind))
    scene = _scene(rng, light, 0.5)
    found = _factor(runner, scene, _nodes(runner, light))[:, :3]
    live = scene.gbuffer.kind == SURFACE
    at = np.flatnonzero(live & ((scene.flags[scene.tile_of] & ir.FACING) != 0))
    expected, above = _expected(light, scene.gbuffer, at)
    for part, middle, most in ((above == 1, 3e-4, 3e-3), ((above > 0.2) & (above < 1), 2e-3, 0.1)):
        error = np.abs(found[at][part] - expected[part]).max(axis=1)
        assert part.sum() > 100
        assert np.median(error) < middle
        assert_within(found[at][part], expected[part], most, "factors")
        assert_not_within(found[at][part], np.ones((part.sum(), 3)), middle)
    none = above == 0
    assert np.isfinite(found).all()
    assert none.any()


def test_a_plain_light_has_no_factor(runner: Runner, rng: np.random.Generator) -> None:
    """At contact and far away, whole or cut: 1 within rounding, also where the light has no picture."""
    light = random_area(rng, two_sided=True)
    for radiance in (light.radiance, np.broadcast_to(light.radiance, (5, 7, 3))):
        plain = dataclasses.replace(light, radiance=radiance)
        scene = _scene(rng, plain, 0.0)
        nodes = _nodes(runner, plain)
        assert_within(nodes["moment"][:, 0], nodes["moment"][:, 3], 1e-6, "moments")
        found = _factor(runner, scene, nodes)[:, :3]
        at = np.flatnonzero((scene.gbuffer.kind == SURFACE) & ((scene.flags[scene.tile_of] & ir.FACING) != 0))
        assert_within(found[at], np.ones((len(at), 3)), 1e-4, "factors")
        nodes["moment"][3, :3] *= 2
        assert_not_within(_factor(runner, scene, nodes)[at, :3], np.ones((len(at), 3)), 1e-4)


def test_the_factor_is_written_wherever_some_of_the_light_is_seen(
    runner: Runner, rng: np.random.Generator
) -> None:
    light = dataclasses.replace(random_area(rng), radiance=_picture(rng, "noise"))
    scene = ir.scene(rng, light, (80, 56))
    found = _factor(runner, scene, _nodes(runner, light))
    flags, state = scene.flags[scene.tile_of], scene.cells[scene.cell_of] & 3
    dark = (flags & ir.DARK) != 0
    whole = ((flags & ir.LIT) != 0) | (~dark & (state == ir.CELL_LIT))
    zone = ~whole & ~dark & (state == ir.CELL_ZONE)
    height = (light.corner - scene.gbuffer.position) @ light.normal
    wanted = (whole | zone) & (height < 0) & (scene.gbuffer.kind == SURFACE) & ((flags & ir.FACING) != 0)
    changed = (found != scene.share).any(axis=1)
    assert (changed == wanted).mean() > 0.999
    assert not changed[~wanted & (np.abs(height) > 1e-5)].any()
    assert (changed & zone).any(), "the zone is part of what is tested"
    assert (changed != (wanted & whole)).mean() > 0.01, "negative control: not the zone alone"
    ones = dataclasses.replace(scene, share=np.ones_like(scene.share))
    bare = _factor(runner, ones, _nodes(runner, light))
    both = zone & wanted
    expected = bare[both, :3] * scene.share[both, :3]
    assert_within(found[both, :3], expected, 1e-6 * np.abs(expected) + 1e-30, "factor times visible share")
    total = ir.irradiance(runner, scene, np.zeros_like(found), textured=1, share=found)[:, :3]
    plain = ir.irradiance(runner, scene, np.zeros_like(found))[:, :3]
    lit = whole & (plain > 0).all(axis=1)
    assert_within(total[lit], plain[lit] * found[lit, :3], 1e-6 * total[lit] + 1e-30, "irradiance")
