"""What is proven is left unasked, and the picture is the same as if it had been asked."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.claim_scenes import CLAIMS

DEFAULT = ml.Settings.preset("default")
OUTPUTS = ("direct", "surface_mask", "fragments")


@pytest.mark.parametrize("name", ["torture_small", "torture_wide", "sphere_one", "boxes", "far_near"])
def test_proofs_save_rays_and_change_no_picture(renderer: ml.Renderer, name: str) -> None:
    scene, camera = CLAIMS[name].build(200, 168)
    proven = renderer.render(scene, camera, DEFAULT, OUTPUTS)
    proven_rays = renderer.render(scene, camera, DEFAULT).stats.rays  # of a still frame, as those below
    asked = renderer.render(scene, camera, DEFAULT.replace(shadow_proofs="off"), OUTPUTS)
    assert proven_rays < 0.99 * asked.stats.rays
    differ = (proven.direct != asked.direct).any(axis=-1)
    # a cell beside a proven tile has other neighbours to agree with
    assert differ.mean() < 0.01
    brute = ml.Settings.preset("brute-force").replace(direct_estimator="ratio", light_samples=1024)
    truth = renderer.render(scene, camera, brute, OUTPUTS).direct
    level = float(truth[proven.surface_mask].mean())
    # where they differ the proven picture is no worse
    errors = [np.abs(frame.direct - truth)[differ].mean(axis=-1) / level for frame in (proven, asked)]
    with_proofs, without = (float(np.sqrt((error**2).sum() / max(error.size, 1))) for error in errors)
    assert with_proofs <= 1.2 * without + 0.005
    assert errors[0].max(initial=0.0) < 0.25
    # negative control: proofs of what is not so
    clear = renderer.render(scene, camera, DEFAULT.replace(visibility="none"), OUTPUTS)
    assert (clear.direct != asked.direct).any(axis=-1).mean() > 0.05


def test_nothing_is_left_to_ask_of_two_bare_surfaces(renderer: ml.Renderer) -> None:
    """A floor and a wall that no light shines through: both are proven, at any size of the picture."""
    scene, camera = CLAIMS["boxes"].build(160, 120)
    for name in ("tall_box", "low_box"):
        scene.remove(name)
    frames = [
        renderer.render(scene, camera, DEFAULT.replace(direct=switch)) for switch in ("off", "off", "on")
    ]
    assert frames[2].stats.rays == frames[1].stats.rays
    assert (frames[2].fragments.level_map[frames[2].surface_mask] > 0).all()
    again = CLAIMS["boxes"].build(160, 120)[0]  # negative control: with its boxes
    renderer.render(again, camera, DEFAULT.replace(direct="off"))
    assert renderer.render(again, camera, DEFAULT).stats.rays > 0


def test_a_wire_that_no_sample_meets_forbids_the_proof(renderer: ml.Renderer) -> None:
    """Thinner than anything that 16 strata could find: the tiles below it must not count as proven lit."""
    scene, camera = CLAIMS["bare_floor"].build(128, 96)
    bare = renderer.render(scene, camera, DEFAULT).stats.light_evaluations
    scene.add_mesh(ml.shapes.tube([(-3, 0.9, 0.1), (3, 0.9, -0.2)], 1e-4, sides=3), name="hair")
    renderer.render(scene, camera, DEFAULT.replace(direct="off"))
    with_hair = renderer.render(scene, camera, DEFAULT)
    assert with_hair.stats.rays > 0
    assert with_hair.stats.light_evaluations >= bare
