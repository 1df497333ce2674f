"""Frames: shapes and dtypes, lazy reading, fragments, statistics, files, pickling, pictures."""

from __future__ import annotations

import io
import pickle
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import miplight as ml
from miplight import notebook
from miplight.fragments import Fragments

SHAPES = {
    "image": (3, np.float32),
    "direct": (3, np.float32),
    "indirect": (3, np.float32),
    "position": (3, np.float32),
    "normal": (3, np.float32),
    "albedo": (3, np.float32),
    "depth": (None, np.float32),
    "light_mask": (None, np.bool_),
    "surface_mask": (None, np.bool_),
}


@pytest.fixture
def frame(renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings) -> ml.Frame:
    return renderer.render(room, camera, quick)


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_shapes_and_dtypes(frame: ml.Frame, camera: ml.Camera, name: str) -> None:
    channels, dtype = SHAPES[name]
    array = getattr(frame, name)
    assert array.shape == (camera.height, camera.width) + ((channels,) if channels else ())
    assert array.dtype == dtype
    assert array is frame[name]
    assert array.flags.writeable


def test_parts_add_up(frame: ml.Frame) -> None:
    rest = frame.image - frame.direct - frame.indirect
    assert np.all(rest[~frame.light_mask] == 0)
    np.testing.assert_allclose(rest[frame.light_mask], 8.0, rtol=1e-6)
    assert not (frame.light_mask & frame.surface_mask).any()
    assert frame.light_mask.any()
    assert frame.surface_mask.any()


def test_nothing_seen(frame: ml.Frame) -> None:
    nothing = ~(frame.light_mask | frame.surface_mask)
    assert nothing.any()
    assert np.all(np.isinf(frame.depth[nothing]))
    assert np.all(np.isfinite(frame.depth[~nothing]))
    for array in (frame.image, frame.position, frame.normal, frame.albedo):
        assert not array[nothing].any()


def test_normals_are_unit_and_face_the_viewer(frame: ml.Frame, camera: ml.Camera) -> None:
    seen = frame.surface_mask
    np.testing.assert_allclose(np.linalg.norm(frame.normal[seen], axis=-1), 1.0, rtol=1e-5)
    towards = camera.origin - frame.position[seen]
    assert np.all(np.sum(frame.normal[seen] * towards, axis=-1) > 0)


def test_position_agrees_with_depth(frame: ml.Frame, camera: ml.Camera) -> None:
    seen = frame.surface_mask
    expected = camera.origin + frame.depth[seen][:, None] * camera.ray_directions()[seen]
    np.testing.assert_allclose(frame.position[seen], expected, atol=1e-4)


def test_fragments_partition_what_is_seen(frame: ml.Frame) -> None:
    fragments = frame.fragments
    assert fragments.level_map.dtype == np.uint8
    assert np.array_equal(fragments.level_map == 0, frame.surface_mask)
    assert np.array_equal(fragments.level_map == 254, frame.light_mask)
    assert np.array_equal(fragments.level_map == 255, ~(frame.surface_mask | frame.light_mask))
    assert np.array_equal(fragments.reason_map == ml.Reason.EMITTER, frame.light_mask)
    assert np.all(fragments.reason_map[frame.surface_mask] == ml.Reason.COARSEST)
    assert np.array_equal(fragments.masks[0], frame.surface_mask)
    assert fragments.counts == (int(frame.surface_mask.sum()),)
    assert fragments.total == fragments.counts[0]
    assert fragments.extra == 0
    assert frame.fragments is fragments


def test_masks_of_coarse_levels_round_up() -> None:
    level_map = np.full((5, 7), 2, np.uint8)
    level_map[:2, :2] = 1
    level_map[4, 6] = 255
    fragments = Fragments(level_map, np.zeros_like(level_map), extra=3, coarsest_level=3)
    assert [mask.shape for mask in fragments.masks] == [(5, 7), (3, 4), (2, 2), (1, 1)]
    # the coarse block around the fine one holds a coarse fragment as well: it shades the rest of the block
    assert fragments.counts == (0, 1, 4, 0)
    assert fragments.total == 5
    assert fragments.extra == 3
    assert "level 1: 1" in repr(fragments)


def test_reasons_match_the_core() -> None:
    names = ["COARSEST", "DEPTH", "NORMAL", "ILLUMINATION", "VISIBILITY", "LOBE"]
    names += ["EMITTER", "FACING_AWAY", "BEHIND_LIGHT", "OUTSIDE_LOBE"]
    assert [ml.Reason[name].value for name in names] == list(range(10))
    assert ml.Reason(255) is ml.Reason.NOTHING


def test_fragments_plot(frame: ml.Frame) -> None:
    from matplotlib import pyplot as plt

    axes = frame.fragments.plot()
    labels = {text.get_text() for text in axes.get_legend().get_texts()}
    assert labels == {"level 0", "culled", "nothing seen"}
    plt.close(axes.figure)
    assert frame.fragments._repr_png_().startswith(b"\x89PNG")


def test_other_fragments(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings, frame: ml.Frame
) -> None:
    assert frame.indirect_fragments is None
    assert frame.specular_fragments is None
    bounced = renderer.render(room, camera, quick.replace(indirect="final-gather", gather_rays=4))
    assert bounced.indirect_fragments == bounced.fragments


def test_unread_outputs_end_with_the_next_render(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    first = renderer.render(room, camera, quick, outputs=("image", "depth"))
    image, depth = first.image.copy(), first.depth.copy()
    renderer.render(room, camera, quick)
    assert np.array_equal(first.image, image)
    assert np.array_equal(first.depth, depth)
    with pytest.raises(ml.DeviceError, match="normal.*(again|before)"):
        _ = first.normal
    with pytest.raises(ml.DeviceError):
        _ = first.fragments
    # what was read stays usable
    assert first.stats.total_ms > 0
    assert "image, depth" in repr(first)
    copy = pickle.loads(pickle.dumps(first))
    assert np.array_equal(copy.image, image)
    with pytest.raises(ml.DeviceError, match="normal"):
        _ = copy.normal


def test_unknown_names_suggest(frame: ml.Frame) -> None:
    with pytest.raises(ml.SettingsError, match="did you mean 'normal'"):
        _ = frame["norml"]


def test_settings_reproduce(frame: ml.Frame, quick: ml.Settings) -> None:
    assert isinstance(frame.settings, ml.Settings)
    assert frame.settings == quick


def test_stats(frame: ml.Frame) -> None:
    stats = frame.stats
    assert stats.total_ms > 0
    assert stats.stages
    assert all(ms >= 0 for ms in stats.stages.values())
    assert stats.readback_ms > 0
    assert stats.rays > 0
    assert stats.light_evaluations > 0
    assert all(isinstance(reason, str) and reason for reason in stats.skipped.values())
    assert isinstance(stats.rebuilt, list)
    assert stats.adapter
    assert ml.Stats.from_dict(stats.to_dict()) == stats
    for name in stats.stages:
        assert name in str(stats)
        assert name in stats._repr_html_()


def test_npz_round_trip_is_complete(frame: ml.Frame, tmp_path: Path) -> None:
    path = frame.save(tmp_path / "frame.npz")
    again = ml.Frame.load(path)
    assert set(again.names) == set(frame.names)
    for name in frame.names:
        assert np.array_equal(again[name], frame[name])
        assert again[name].dtype == frame[name].dtype
    assert again.settings == frame.settings
    assert again.stats.to_dict() == frame.stats.to_dict()
    assert again.fragments == frame.fragments
    assert (again.width, again.height) == (frame.width, frame.height)


def test_exr_holds_the_image(frame: ml.Frame, tmp_path: Path) -> None:
    again = ml.Frame.load(frame.save(tmp_path / "frame.EXR"))
    assert np.array_equal(again.image, frame.image)
    assert again.settings == frame.settings
    with pytest.raises(ml.SettingsError, match=r"no array 'depth'.*frame\.EXR"):
        _ = again.depth


def test_png_is_srgb(frame: ml.Frame, tmp_path: Path) -> None:
    frame.save(tmp_path / "a.png", exposure=0.0)
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (frame.height, frame.width, 3)
    expected = ml.linear_to_srgb(np.clip(frame.image, 0, 1), dtype=np.uint8)
    assert np.abs(pixels.astype(int) - expected.astype(int)).max() <= 1
    frame.save(tmp_path / "b.png", exposure=-8.0)
    with Image.open(tmp_path / "b.png") as picture:
        assert np.asarray(picture).mean() < pixels.mean()


@pytest.mark.parametrize("name", ["x.jpg", "x", "x.npy"])
def test_unknown_suffix(frame: ml.Frame, tmp_path: Path, name: str) -> None:
    with pytest.raises(ml.SceneError, match=r"\.exr"):
        frame.save(tmp_path / name)
    assert not list(tmp_path.iterdir())
    (tmp_path / name).write_text("something else")
    with pytest.raises(ml.SceneError, match=r"\.npz"):
        ml.Frame.load(tmp_path / name)


@pytest.mark.parametrize("suffix", [".npz", ".exr"])
def test_missing_and_cut_files(frame: ml.Frame, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"frame{suffix}"
    with pytest.raises(ml.SceneError, match="a file that exists"):
        ml.Frame.load(path)
    frame.save(path)
    whole = path.read_bytes()
    for length in (0, 10, len(whole) // 2):
        path.write_bytes(whole[:length])
        with pytest.raises(ml.SceneError, match="cut short"):
            ml.Frame.load(path)


@pytest.mark.parametrize("exposure", ["bright", float("nan"), 1000.0])
def test_exposure_is_checked(frame: ml.Frame, tmp_path: Path, exposure: float) -> None:
    with pytest.raises(ml.SettingsError, match="exposure"):
        frame.save(tmp_path / "x.png", exposure=exposure)
    with pytest.raises(ml.SettingsError, match="exposure"):
        frame.show(exposure=exposure)
    with pytest.raises(ml.SettingsError, match="only .png"):
        frame.save(tmp_path / "x.exr", exposure=1.0)


def test_pickle_reads_everything_first(
    renderer: ml.Renderer, room: ml.Scene, camera: ml.Camera, quick: ml.Settings
) -> None:
    frame = renderer.render(room, camera, quick, outputs=())
    again = pickle.loads(pickle.dumps(frame))
    for name in SHAPES:
        assert np.array_equal(again[name], frame[name])
    assert again.fragments == frame.fragments
    assert again.settings == frame.settings


def test_notebook_display(frame: ml.Frame) -> None:
    png = frame._repr_png_()
    with Image.open(io.BytesIO(png)) as picture:
        assert picture.size == (frame.width, frame.height)
    assert "data:image/png;base64," in frame._repr_html_()
    assert f"{frame.width} × {frame.height}" in repr(frame)


def test_show_without_a_notebook(frame: ml.Frame) -> None:
    from matplotlib import pyplot as plt

    before = len(plt.get_fignums())
    frame.show(exposure=1.0)
    assert len(plt.get_fignums()) == before + 1
    plt.close("all")


def test_auto_exposure_looks_at_surfaces() -> None:
    image = np.full((4, 4, 3), 0.2, np.float32)
    image[0, 0] = 1000.0
    mask = np.ones((4, 4), bool)
    mask[0, 0] = False
    assert notebook.auto_exposure(image, mask) == pytest.approx(2.0, abs=1e-4)
    assert notebook.auto_exposure(np.zeros_like(image), mask) == 0.0
