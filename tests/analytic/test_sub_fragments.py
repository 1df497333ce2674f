"""`area-2016` through the whole renderer: what it must equal, what its rules do, what it refuses."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import miplight as ml
from tests.analytic.closed_forms import floor_scene, view_down
from tests.analytic.test_incremental import VIEW, _clutter, _grey, _lamp, _render, _spot
from tests.claim_scenes import CLAIMS
from tests.fragment_rules import assert_partition, assert_reasons, assert_seen

AREA = ml.Settings.preset("area-2016")
BRUTE = ml.Settings.preset("brute-force").replace(light_samples=64, light_pattern="grid")
LARGE = VIEW.replace(width=210, height=135)


def _places(frame: ml.Frame) -> int:
    """How many extra samples the fragments above level 2 have room for."""
    levels, seen = frame.fragments.level_map, frame.surface_mask
    height, width = levels.shape
    count = 0
    for level, mask in enumerate(frame.fragments.masks):
        if level < 3:
            continue
        size = 2**level
        for row, column in zip(*np.nonzero(mask), strict=True):
            y, x = row * size, column * size
            half, last = size // 2, (height - 1, width - 1)
            places = {(y, x + half), (y, x), (y + half, x)}
            if x + size >= width:
                places |= {(y, last[1]), (y + half, last[1])}
            if y + size >= height:
                places |= {(last[0], x), (last[0], x + half)}
            if x + size >= width and y + size >= height:
                places.add(last)
            count += sum(bool(r < height and c < width and seen[r, c]) for r, c in places)
    return count


@pytest.mark.parametrize("size", [(53, 37), (1, 40), (41, 1), (1, 1), (3, 50), (130, 67)])
@pytest.mark.parametrize("levels", [(4, 0), (16, 0), (3, 2), (1, 1), (4, 1), (0, 0)])
def test_fragments_are_a_partition_and_extra_samples_are_none_of_them(
    renderer: ml.Renderer, size: tuple[int, int], levels: tuple[int, int]
) -> None:
    camera = VIEW.replace(width=size[0], height=size[1])
    frame = _render(renderer, _clutter(), camera, AREA, coarsest_level=levels[0], finest_level=levels[1])
    assert_partition(frame.fragments)
    assert_reasons(frame.fragments)
    if levels[1] == 0:  # light of coarser fragments may reach over the edge of what is culled
        assert_seen(frame)
    shaded = frame.fragments.level_map < 254
    assert frame.fragments.level_map[shaded].min(initial=levels[0]) >= levels[1]
    assert frame.fragments.extra == _places(frame)
    assert np.isfinite(frame.image).all()
    plain = _render(renderer, _clutter(), camera, AREA, coarsest_level=levels[0], extra_samples="off")
    assert plain.fragments.extra == 0


@pytest.mark.parametrize(("samples", "interleave"), [("same", 1), ("same", 2), ("own", 2)])
@pytest.mark.parametrize("pattern", ["grid", "jittered"])
def test_pixels_are_those_of_brute_force(
    renderer: ml.Renderer, samples: str, pattern: str, interleave: int
) -> None:
    """A pixel asks all samples, whatever was asked at it before."""
    changes = {"sub_fragment_samples": samples, "light_pattern": pattern, "interleave": interleave}
    frame = _render(renderer, _clutter(_lamp()), LARGE, AREA, gradient_threshold=None, **changes)
    single = frame.fragments.level_map == 0
    tested = single & (frame.fragments.reason_map == ml.Reason.VISIBILITY)
    assert tested.sum() > 100, "some pixels take over what was asked at them"
    if pattern == "grid":
        brute = _render(renderer, _clutter(_lamp()), LARGE, BRUTE)
        apart = np.abs(frame.direct - brute.direct)[single]
        assert apart.max() < 3e-6 * brute.direct.max()
        assert np.abs(np.roll(frame.direct, 1, 0) - brute.direct)[single].max() > 1e-2, "negative control"
    else:
        exact = _render(renderer, _clutter(_lamp()), LARGE, BRUTE, light_samples=1024)
        error = ml.metrics.relative_rmse(frame.direct, exact.direct, mask=single)
        assert error < 0.1


def test_every_pixel_a_fragment_is_brute_force(renderer: ml.Renderer) -> None:
    frame = _render(renderer, _clutter(), VIEW, AREA, coarsest_level=0)
    brute = _render(renderer, _clutter(), VIEW, BRUTE)
    assert np.abs(frame.direct - brute.direct).max() < 3e-6 * brute.direct.max()


@pytest.mark.parametrize("visibility", ["ray", "voxel", "shadow-map", "none"])
def test_it_is_near_brute_force_whoever_answers(renderer: ml.Renderer, visibility: str) -> None:
    frame = _render(renderer, _clutter(_lamp()), LARGE, AREA, visibility=visibility)
    brute = _render(renderer, _clutter(_lamp()), LARGE, BRUTE, visibility=visibility)
    error = ml.metrics.relative_rmse(frame.direct, brute.direct, mask=frame.surface_mask, trim=0.001)
    assert error < 0.05
    assert frame.fragments.total < 0.5 * frame.surface_mask.sum()


@pytest.mark.parametrize("visibility", ["ray", "none"])
def test_the_edge_of_a_cone_is_refined(renderer: ml.Renderer, visibility: str) -> None:
    """Between fragments that a spot shines on and those that it does not, where no ray is asked as well."""
    frame = _render(renderer, floor_scene(_spot()), LARGE, AREA, visibility=visibility)
    brute = _render(renderer, floor_scene(_spot()), LARGE, BRUTE, visibility=visibility)
    error = ml.metrics.relative_rmse(frame.direct, brute.direct, mask=frame.surface_mask, trim=0.001)
    assert error < 0.15
    assert (frame.fragments.reason_map == ml.Reason.VISIBILITY).sum() > 200
    lit, dark = ((brute.direct > 0).all(-1) == wanted for wanted in (True, False))
    assert not frame.direct[dark & (frame.fragments.level_map == 0)].any()
    assert lit.sum() > 1000


def test_fewer_bits_are_asked_twice(renderer: ml.Renderer) -> None:
    """Rays: what sub-fragments found is used again by pixels and for light."""
    scene, camera = CLAIMS["boxes"].build(256, 192)
    changes = {"stop_guard": "off", "extra_samples": "off", "gradient_threshold": None}
    around = AREA.replace(
        refine="incremental", interleave=1, illumination_threshold=None, visibility_reuse="off"
    )
    for _ in range(2):
        own = _render(renderer, scene, camera, AREA, **changes)
        other = _render(renderer, scene, camera, around)
    assert own.fragments.total < 0.7 * other.fragments.total
    assert own.stats.rays < 0.65 * other.stats.rays


def test_samples_of_their_own_refine_nearly_every_penumbra(renderer: ml.Renderer) -> None:
    scene, camera = CLAIMS["boxes"].build(256, 192)
    counts = {
        which: _render(renderer, scene, camera, AREA, sub_fragment_samples=which).fragments.counts
        for which in ("same", "own")
    }
    assert counts["own"][0] > 1.3 * counts["same"][0]


def test_steep_gradients_skip_a_level(renderer: ml.Renderer) -> None:
    """Up to 16 fragments in a step: fewer tests for nearly the same fragments, and never coarser ones."""
    scene = _clutter(_lamp())
    frames = {
        most: _render(renderer, scene, LARGE, AREA, gradient_threshold=most, stop_guard="off")
        for most in (None, 4, 0)
    }
    for less, more in itertools.pairwise(frames.values()):
        assert (less.fragments.level_map >= more.fragments.level_map).all()
        assert (less.fragments.level_map > more.fragments.level_map).any()
    counted = _render(renderer, scene, LARGE, AREA, gradient_metric="counts", stop_guard="off")
    assert (counted.fragments.level_map >= frames[4].fragments.level_map).all(), "counts change less"


def test_the_guard_finds_what_is_thin(renderer: ml.Renderer) -> None:
    """Wires between the samples: the paper's stops leave out shadows that bounds do not rule out (N20)."""
    scene, camera = CLAIMS["torture_small"].build(256, 192)
    brute = _render(renderer, scene, camera, BRUTE)
    error = {}
    for guard in ("off", "bounds"):
        frame = _render(renderer, scene, camera, AREA, stop_guard=guard)
        error[guard] = ml.metrics.relative_rmse(
            frame.direct, brute.direct, mask=frame.surface_mask, trim=0.001
        )
        open_ = frame.fragments.level_map[frame.fragments.reason_map == ml.Reason.VISIBILITY]
        assert (open_.max() <= 3) == (guard == "bounds") or guard == "off"
    assert error["bounds"] < 0.7 * error["off"]


def test_open_floors_stay_coarse(renderer: ml.Renderer) -> None:
    frame = _render(renderer, floor_scene(_lamp()), view_down(64, 48), AREA)
    assert (frame.fragments.level_map == 4).all(), "bounds prove that nothing hides the light"


def test_even_light_stays_even(renderer: ml.Renderer) -> None:
    far = ml.AreaLight((-200, 500, -200), (400, 0, 0), (0, 0, 400), (5, 5, 5), visible=False)
    frame = _render(renderer, floor_scene(far), view_down(64, 48), AREA)
    light = _grey(frame)
    assert light.std() / light.mean() < 1e-4
    assert frame.fragments.extra > 0


def test_kept_maps_say_where_fragments_agree_and_have_more_samples(renderer: ml.Renderer) -> None:
    keep = ("stable_map", "extra_map", "level_causes_2")
    frame = renderer.render(_clutter(_lamp()), LARGE, AREA, keep=keep)
    levels, seen = frame.fragments.level_map, frame.surface_mask
    assert frame["extra_map"].dtype == frame["stable_map"].dtype == np.bool_
    assert frame["extra_map"].sum() == frame.fragments.extra > 0
    assert (levels[frame["extra_map"]] >= 3).all()
    assert not frame["stable_map"][~seen].any()
    large = (levels >= 2) & (levels < 254)
    assert frame["stable_map"][large].all(), "one bit of difference would have split them"
    shadow = (levels == 0) & (frame.fragments.reason_map == ml.Reason.VISIBILITY)
    assert not frame["stable_map"][shadow].all()
    assert set(np.unique(frame["level_causes_2"])) <= {0, 1, 2, 4, 255}


def test_a_stable_map_of_a_coarse_image(renderer: ml.Renderer) -> None:
    frame = renderer.render(_clutter(_lamp()), VIEW, AREA.replace(finest_level=1), keep=("stable_map",))
    assert frame["stable_map"].any()


@pytest.mark.parametrize(
    ("changes", "keep", "message"),
    [
        ({"sub_fragment_samples": "own", "interleave": 1}, (), "allowed: interleave 2"),
        ({"light_samples": 63}, (), "multiples of 4"),
        ({"refine": "incremental"}, ("stable_map",), 'allowed: refine="sub-fragment"'),
        ({"upsample": "edge-aware"}, ("extra_map",), 'extra_samples="on"'),
        ({}, ("level_image_1",), 'allowed: refine="incremental"'),
        ({}, ("bits",), 'allowed: refine="incremental"'),
        ({"coarsest_level": 1, "finest_level": 2}, (), "coarsest_level"),
    ],
)
def test_what_does_not_go_together_is_refused(
    renderer: ml.Renderer, changes: dict[str, object], keep: tuple[str, ...], message: str
) -> None:
    with pytest.raises(ml.SettingsError, match=message):
        renderer.render(_clutter(), VIEW, AREA.replace(**changes), keep=keep)


def test_each_light_may_split(renderer: ml.Renderer) -> None:
    """A fragment is split if any light asks for it, and lit by all."""
    left, right = (
        ml.AreaLight((x - 0.2, 2, -0.4), (0.4, 0, 0), (0, 0, 0.4), (5, 3, 1), visible=False)
        for x in (-1.5, 1.5)
    )
    maps = {}
    for name, lights in (("left", (left,)), ("right", (right,)), ("both", (left, right))):
        frame = _render(renderer, _clutter(*lights), LARGE, AREA)
        maps[name] = frame.fragments.level_map
    both = _render(renderer, _clutter(left, right), LARGE, AREA)
    either = np.minimum(maps["left"], maps["right"])
    assert (maps["both"] <= either).mean() > 0.999
    brute = _render(renderer, _clutter(left, right), LARGE, BRUTE)
    assert ml.metrics.relative_rmse(both.direct, brute.direct, mask=both.surface_mask, trim=0.001) < 0.05


def test_the_plan_names_what_runs(renderer: ml.Renderer) -> None:
    plan = renderer.plan(_clutter(), VIEW, AREA)
    own = {"sub_bits", "sub_gather", "sub_fragments", "stop_guard", "extra_samples", "rbf", "prove"}
    assert {f"direct/{name}" for name in own} <= set(plan.passes)
    assert "direct/reuse" in plan.skipped
    assert "direct/interleaved" in plan.skipped
    bare = renderer.plan(_clutter(), VIEW, AREA.replace(stop_guard="off", extra_samples="off"))
    assert {"direct/stop_guard", "direct/extra_samples", "direct/prove"} <= set(bare.skipped)
    frame = renderer.render(_clutter(), VIEW, AREA)
    assert {f"direct/{name}" for name in own} <= set(frame.stats.stages)


@pytest.mark.parametrize("size", [(160, 160), (150, 139)])
def test_light_goes_on_to_the_last_column_and_row(renderer: ml.Renderer, size: tuple[int, int]) -> None:
    """The border of an image has no larger error on the right and below than on the left and above."""
    scene = ml.Scene.from_trimesh(ml.shapes.bare_floor(20.0))
    lamp = ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), (9, 9, 9), visible=False)
    scene.add_light(lamp)
    camera = ml.Camera.look_at((0, 9, 0), (0, 0, 0), (0, 0, -1), fov_y=45, width=size[0], height=size[1])
    truth = _grey(_render(renderer, scene, camera, BRUTE, light_samples=1024))

    def borders(**changes: object) -> list[float]:
        frame = _render(renderer, scene, camera, AREA, **changes)
        assert (frame.fragments.level_map == 4).all()
        off = np.abs(_grey(frame) / truth - 1)
        sides = (off[:4], off[:, :4], off[-4:], off[:, -4:])
        return [float(side.mean()) for side in sides]

    above, left, below, right = borders()
    assert max(above, left) < 0.02
    assert max(below, right) < 1.5 * max(above, left)
    # negative control: without samples on borders light stops at the middles
    assert min(borders(extra_samples="off")) > 2 * max(below, right)
