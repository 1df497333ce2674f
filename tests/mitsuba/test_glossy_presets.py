"""Glossy floors under a light with a picture, against stored references, and what must not change."""

from __future__ import annotations

import numpy as np
import pytest

import miplight as ml
from tests.fragment_rules import assert_partition
from tests.mitsuba.reference_scenes import glossy_floor, load

RAYS = ml.Settings.preset("area-2010").replace(visibility="ray")


def _error(renderer: ml.Renderer, settings: ml.Settings, exponent: int, shadowed: bool) -> float:
    scene, camera = glossy_floor(exponent, shadowed, 96)
    reference = load(f"glossy_{'shadowed' if shadowed else 'floor'}_{exponent}")
    frame = renderer.render(scene, camera, settings, outputs=("direct", "surface_mask"))
    return ml.metrics.relative_rmse(frame.direct, reference.mean, mask=frame.surface_mask, trim=0.001)


@pytest.mark.parametrize("exponent", [10, 50, 200, 1000])
@pytest.mark.parametrize("shadowed", [False, True])
def test_glossy_floors_agree_with_mitsuba(renderer: ml.Renderer, exponent: int, shadowed: bool) -> None:
    """Measured: `default` 1.3 to 1.7 %, with shadows 2.6 to 3.5 %; `area-2010` 2.4 to 3.4 %, 5.4 to 7.6 %."""
    assert _error(renderer, ml.Settings.preset("default"), exponent, shadowed) <= 0.04
    assert _error(renderer, RAYS, exponent, shadowed) <= 0.10


def test_a_sum_over_samples_shows_them_where_the_lobe_is_narrow(renderer: ml.Renderer) -> None:
    """The negative control: 256 samples are not enough for n = 1000."""
    assert _error(renderer, ml.Settings.preset("brute-force"), 1000, False) > 0.5


def test_fragments_of_lobes_partition_what_is_not_culled(renderer: ml.Renderer) -> None:
    scene, camera = glossy_floor(50, True, 96)
    frame = renderer.render(scene, camera, RAYS)
    fragments = frame.specular_fragments
    assert fragments is not None
    assert_partition(fragments)
    assert {ml.Reason.LOBE, ml.Reason.OUTSIDE_LOBE} <= {
        ml.Reason(int(r)) for r in np.unique(fragments.reason_map)
    }
    assert renderer.render(scene, camera, "default").specular_fragments is None


def test_a_scene_without_lobes_dispatches_nothing_for_them(renderer: ml.Renderer) -> None:
    scene, camera = glossy_floor(50, False, 32)
    for name in ("default", "area-2010", "brute-force"):
        settings = ml.Settings.preset(name)
        glossy = renderer.render(scene, camera, settings)
        assert any("lobe" in stage or "specular" in stage for stage in glossy.stats.stages)
        off = renderer.render(scene, camera, settings.replace(specular="off"))
        assert not any("lobe" in stage or "direct/specular" in stage for stage in off.stats.stages)
        assert off.stats.skipped["direct/specular"] == "specular is off"
        assert not off["specular_radiance"].any()
    plain = ml.Scene.from_trimesh(ml.shapes.room(boxes=False))
    skipped = renderer.plan(plain, camera, "area-2010").skipped
    assert {reason for name, reason in skipped.items() if "lobe" in name} <= {
        "no material has a specular part",
        "no light emits anything",
    }


def test_the_same_bits_and_twice_the_light(renderer: ml.Renderer) -> None:
    scene, camera = glossy_floor(50, True, 48)
    for settings in (ml.Settings.preset("default"), RAYS):
        first = renderer.render(scene, camera, settings, outputs=("direct",)).direct
        assert (renderer.render(scene, camera, settings, outputs=("direct",)).direct == first).all()


def test_variance_is_refused_where_lobes_have_no_fragments(renderer: ml.Renderer) -> None:
    scene, camera = glossy_floor(50, False, 16)
    for name in ("default", "brute-force"):
        settings = ml.Settings.preset(name).replace(specular_visibility="variance")
        with pytest.raises(ml.SettingsError, match="have none"):
            renderer.render(scene, camera, settings)
    assert np.isfinite(
        renderer.render(scene, camera, RAYS.replace(specular_visibility="variance")).image
    ).all()
