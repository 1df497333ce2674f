"""Studies of what each level does: counts and times agree with the frame, sweeps move the way they must."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import miplight as ml

SETTINGS = ml.Settings.preset("area-2010").replace(visibility="ray", light_samples=64)


@pytest.fixture(scope="module")
def place() -> tuple[ml.Scene, ml.Camera]:
    room = ml.shapes.room()
    scene = ml.Scene.from_trimesh(room)
    row = room.metadata["lights"][0]
    lamp = ml.AreaLight(corner=row[0:3], edge_u=row[3:6], edge_v=row[6:9], radiance=row[9:12])
    scene.add_light(lamp, name="lamp")
    return scene, ml.Camera.look_at(**room.metadata["view"], width=96, height=64)


def test_levels_add_up(renderer: ml.Renderer, place: tuple[ml.Scene, ml.Camera]) -> None:
    scene, camera = place
    table = ml.study.levels_along(scene, [camera, camera], SETTINGS, renderer)
    fragments = renderer.render(scene, camera, SETTINGS).fragments
    assert list(table["frame"].unique()) == [0, 1]
    for frame, rows in table.groupby("frame"):
        assert list(rows["level"]) == [4, 3, 2, 1, 0]
        assert (rows["fragments"].to_numpy()[::-1] == np.array(fragments.counts)).all(), frame
        assert (rows["nodes"] >= rows["fragments"]).all()
        assert rows["share"].between(0, 1).all()
        assert (rows["nodes"] <= rows["texels"]).all()
        assert rows["ms"].sum() <= rows["total_ms"].iloc[0]
    assert len(ml.study.plot_levels(table).axes) == 2


def test_causes_and_reasons_say_the_same(renderer: ml.Renderer, place: tuple[ml.Scene, ml.Camera]) -> None:
    scene, camera = place
    frame = renderer.render(scene, camera, SETTINGS, keep=ml.study.level_names(SETTINGS))
    levels, reasons = frame.fragments.level_map, frame.fragments.reason_map
    rows, columns = np.nonzero(levels < 4)
    for row, column in zip(rows[::7], columns[::7], strict=True):
        level = int(levels[row, column])
        above = frame[f"level_causes_{level + 1}"][row >> (level + 1), column >> (level + 1)]
        assert above == reasons[row, column]
        assert frame[f"level_causes_{level}"][row >> level, column >> level] == ml.Reason.COARSEST
    image = frame["level_image_0"]
    assert image.shape == frame.direct.shape
    pixels = levels == 0
    assert np.abs(image - frame.direct)[pixels].max() < 1e-5 * frame.direct.max()
    assert len(ml.study.plot_maps(frame).axes) == 10


def test_bits_are_kept(renderer: ml.Renderer, place: tuple[ml.Scene, ml.Camera], tmp_path: Path) -> None:
    scene, camera = place
    frame = renderer.render(scene, camera, SETTINGS, keep=("bits",))
    bits = frame["bits"]
    assert bits.shape == (64, 96, 1), "64 samples in four sets are one word"
    assert bits.dtype == np.uint32
    seen = np.unpackbits(bits.view(np.uint8), axis=2).sum(2)
    assert seen.max() <= 16
    bright = frame.direct.mean(-1)
    surface = frame.surface_mask & (frame.albedo.min(-1) > 0)
    assert seen[surface & (bright > np.median(bright[surface]))].mean() > 2 * seen[bright == 0].mean()
    frame.save(tmp_path / "frame.npz")
    assert (ml.Frame.load(tmp_path / "frame.npz")["bits"] == bits).all()


@pytest.mark.parametrize(
    ("settings", "keep", "says"),
    [
        (ml.Settings.preset("default"), "bits", 'allowed: refine="incremental"'),
        (SETTINGS, "level_causes_99", "no resource"),
        (SETTINGS, "level_causes_7", "allowed: 0 to 4"),
    ],
)
def test_what_is_not_there_is_refused(
    renderer: ml.Renderer, place: tuple[ml.Scene, ml.Camera], settings: ml.Settings, keep: str, says: str
) -> None:
    scene, camera = place
    with pytest.raises(ml.SettingsError, match=says):
        renderer.render(scene, camera, settings, keep=(keep,))


def test_sweeps_move_the_right_way(renderer: ml.Renderer, place: tuple[ml.Scene, ml.Camera]) -> None:
    scene, camera = place
    table = ml.study.threshold_sweep(
        scene,
        camera,
        illumination=(0.02, 0.5),
        normal=(0.5,),
        settings=SETTINGS,
        repeats=1,
        renderer=renderer,
    )
    assert list(table["illumination_threshold"]) == [0.02, 0.5]
    fine, coarse = table["fragments"]
    assert fine > coarse
    assert table["relative_rmse"].iloc[0] < table["relative_rmse"].iloc[1]
    ml.study.plot_thresholds(table)
    voxels = ml.study.voxel_sweep(
        scene, camera, resolutions=(32, 256), slices=(32, 256), settings=SETTINGS, renderer=renderer
    )
    error = voxels.set_index(["voxel_resolution", "voxel_slices"])["relative_rmse"]
    assert error[256, 256] < error[32, 32]
    ml.study.plot_voxels(voxels)


def test_other_refinements_are_refused(place: tuple[ml.Scene, ml.Camera]) -> None:
    scene, camera = place
    attempts: list[Any] = [
        lambda: ml.study.levels_along(scene, [camera], "default"),
        lambda: ml.study.level_names("brute-force"),
        lambda: ml.study.threshold_sweep(scene, camera, settings="default"),
    ]
    for attempt in attempts:
        with pytest.raises(ml.SettingsError, match="incremental"):
            attempt()
