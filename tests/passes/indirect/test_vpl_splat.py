"""`vpl_splat`: virtual lights drawn as points and added up [NW09 Sec. 3.4], as `vpl_gather` sums them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml
from tests.passes.reference.run import Runner, read
from tests.passes.reference.structs import MISS, RECEIVER


def _place(width: int, height: int) -> tuple[ml.Scene, ml.Camera]:
    scene = ml.Scene()
    scene.add_mesh(trimesh.creation.box((4, 0.1, 4)), name="floor", shading="flat")
    ball = trimesh.transformations.translation_matrix((0, 0.6, 0))
    scene.add_mesh(trimesh.creation.icosphere(2, 0.4), name="ball", transform=ball)
    scene.add_light(ml.SpotLight((1, 2, 1), (0, 0.3, 0), (9, 8, 7), cutoff=40))
    return scene, ml.Camera.look_at((0, 2.2, 3.2), (0, 0.3, 0), fov_y=50, width=width, height=height)


def _settings(**changes: object) -> ml.Settings:
    values = {"direct": "off", "indirect": "splat", "indirect_visibility": "off", "vpls": 64, **changes}
    return ml.Settings(**values)  # type: ignore[arg-type]


def test_pixels_of_the_target_go_to_their_receivers(runner: Runner, rng: np.random.Generator) -> None:
    count, first = 100, 37
    receivers = np.zeros(first + count, RECEIVER)
    receivers["pixel"] = rng.permutation(first + count)
    receivers["pixel"][first + 5] = MISS
    sums = rng.uniform(size=(128, 4)).astype(np.float32)
    params = np.array([16, 8, first, 0], np.uint32)
    before = np.full((first + count, 4), -1, np.float32)
    out = runner(
        "passes/indirect/vpl_splat",
        count,
        entry="spread",
        params=params,
        receivers=receivers,
        sums=sums,
        irradiance=before,
    )
    got = read(out, "irradiance", np.float32, first + count, 4)
    expected = before.copy()
    for i in range(count):
        if i != 5:
            expected[receivers["pixel"][first + i]] = sums[i]
    assert (got == expected).all()
    assert (got == -1).any()


@pytest.mark.parametrize(("width", "height"), [(1, 1), (61, 47), (300, 220)])
@pytest.mark.parametrize("refine", ["none", "iterative"])
def test_splats_are_gathered_light(renderer: ml.Renderer, width: int, height: int, refine: str) -> None:
    scene, camera = _place(width, height)
    for changes in ({}, {"vpl_radius": 0.8}, {"form_factor": "disc", "vpls": 100}):
        splatted = renderer.render(scene, camera, _settings(refine=refine, **changes)).indirect
        gathered = renderer.render(
            scene, camera, _settings(refine=refine, indirect="gather", **changes)
        ).indirect
        np.testing.assert_allclose(splatted, gathered, rtol=1e-5, atol=1e-7)
    assert width == 1 or gathered.any()


def test_ten_runs_have_the_same_bits(renderer: ml.Renderer) -> None:
    place = _place(64, 48)
    images = [renderer.render(*place, _settings()).indirect.tobytes() for _ in range(10)]
    assert len(set(images)) == 1


def test_long_draws_are_cut_and_add_up(renderer: ml.Renderer) -> None:
    """Enough points for several draws of a tenth of a second: none is lost between them."""
    place = _place(256, 192)
    many = {"refine": "none", "vpls": 196}
    splatted = renderer.render(*place, _settings(**many)).indirect
    gathered = renderer.render(*place, _settings(**many, indirect="gather")).indirect
    np.testing.assert_allclose(splatted, gathered, rtol=1e-5, atol=1e-7)


def test_passes_take_time_after_something_was_drawn(adapter: str) -> None:
    """Mesa's timestamps stop at the first draw; then the wall clock tells, and stages fill the frame."""
    place, settings = _place(256, 192), _settings(refine="none", indirect="gather", vpls=256)
    with ml.Renderer(adapter) as renderer:
        before = renderer.render(*place, settings).stats
        drawn = renderer.render(*place, settings.replace(indirect="splat", vpls=16)).stats
        after = [renderer.render(*place, settings).stats for _ in range(2)][-1]
    gathered = [stats.stages["indirect/vpl_gather"] for stats in (before, after)]
    assert 0.2 < gathered[1] / gathered[0] < 5
    assert drawn.stages["indirect/vpl_splat"] > 0.5
    for stats in (drawn, after):
        assert sum(stats.stages.values()) == pytest.approx(stats.total_ms, rel=0.1)
        if renderer.adapter["software"]:
            assert stats.stages["host"] < 0.5 * stats.total_ms


def test_a_radius_darkens(renderer: ml.Renderer) -> None:
    """What DS06 clips is lost: less light the smaller the radius."""
    place = _place(64, 48)
    light = [renderer.render(*place, _settings(vpl_radius=r)).indirect.mean() for r in (0.2, 0.6, 2.0, None)]
    assert light == sorted(light)
    assert light[0] < 0.5 * light[-1]
