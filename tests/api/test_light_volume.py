"""What went through a propagation volume, as arrays and as slices."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from matplotlib import pyplot as plt
from numpy.typing import NDArray

import miplight as ml

KEEP = ("volume",)
LPV = ml.Settings(direct="off", indirect="lpv", lpv_resolution=16, lpv_samples=4096)
ALBEDO, INTENSITY, CUTOFF = 0.5, (10.0, 5.0, 0.0), 40.0
CAMERA = ml.Camera.look_at((0, 0, 0.9), (0, -0.2, -1), fov_y=60, width=16, height=16)


def _box(shift: tuple[float, float, float] = (0, 0, 0)) -> ml.Scene:
    """A closed box of 4 × 2 × 2 and a spot inside of it that shines down."""
    scene = ml.Scene()
    box = trimesh.creation.box((4, 2, 2))
    box.apply_translation(shift)
    scene.add_mesh(box, name="box", material=ml.Material((ALBEDO,) * 3), shading="flat")
    at = np.array([-1.0, 0.5, 0.0]) + shift
    scene.add_light(ml.SpotLight(at, at - (0, 1, 0), intensity=INTENSITY, cutoff=CUTOFF), name="spot")
    return scene


def _volume(
    renderer: ml.Renderer, scene: ml.Scene, camera: ml.Camera = CAMERA, **changes: object
) -> ml.LightVolume:
    found = renderer.render(scene, camera, LPV.replace(**changes), ("image",), KEEP).volume
    assert found is not None
    return found


def _ended(volume: ml.LightVolume) -> NDArray[np.float64]:
    """Flux that ended at closed faces and at the volume's border."""
    return (volume.flux * ~volume.open[:, None]).sum((0, 2, 3, 4), dtype=np.float64)


def test_what_is_reflected_ends_at_the_walls(renderer: ml.Renderer) -> None:
    """In a closed box all flux that the floor reflects ends at a closed face, in each channel."""
    reflected = ALBEDO * np.array(INTENSITY) * 2 * np.pi * (1 - np.cos(np.radians(CUTOFF)))
    volume = _volume(renderer, _box(), lpv_iterations=200)
    assert volume.flux.shape == (6, 3, *volume.size[::-1])
    assert volume.open.shape == (6, *volume.size[::-1])
    np.testing.assert_allclose(_ended(volume), reflected, rtol=0.03)
    assert volume.flux.min() >= 0
    # negative control: after few steps most of it is still on its way
    assert (_ended(_volume(renderer, _box(), lpv_iterations=4))[:2] < 0.7 * reflected[:2]).all()


def test_the_volume_lies_about_the_meshes(renderer: ml.Renderer) -> None:
    """Cubic cells, a margin of one at either end of the longest edge; closed faces where the box is."""
    volume = _volume(renderer, _box())
    low, high = volume.bounds
    assert volume.size[0] == LPV.lpv_resolution
    np.testing.assert_allclose((high - low) / volume.size, volume.edge, rtol=1e-5)
    assert (low < (-2, -1, -1)).all()
    assert (high > (2, 1, 1)).all()
    assert volume.edge == pytest.approx(4 / (LPV.lpv_resolution - 2), rel=1e-3)
    assert (volume.corner == low).all()
    z, y, x = (np.arange(n) for n in volume.flux.shape[2:])
    places = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1) + 0.5
    middles = volume.corner + places * volume.edge
    inside = (np.abs(middles) < (2, 1, 1)).all(-1)
    for face, step in enumerate(np.concatenate([[-axis, axis] for axis in np.eye(3)])):
        beside = (np.abs(middles + volume.edge * step) < (2, 1, 1)).all(-1)
        assert (volume.open[face][inside] == beside[inside]).all(), face
    lit = volume.irradiance[..., 0] > 0
    assert lit[inside].mean() > 0.9
    assert not lit[~inside].any()


def test_light_flows_away_from_the_floor(renderer: ml.Renderer) -> None:
    volume = _volume(renderer, _box(), lpv_iterations=100)
    net = volume.net_flow
    assert net.shape == (*volume.flux.shape[2:], 3, 3)
    up = net[..., 1, 0].sum((0, 2))
    floor = int((-1 - volume.corner[1]) / volume.edge) + 2
    assert (up[floor : floor + 4] > 0).all()
    # red and green as the light has them, no blue
    np.testing.assert_allclose(volume.flux[:, 0], 2 * volume.flux[:, 1], rtol=1e-3, atol=1e-6)
    assert not volume.flux[:, 2].any()


def test_a_far_scene_has_its_place(renderer: ml.Renderer) -> None:
    shift = (1000.0, -500.0, 250.0)
    near = _volume(renderer, _box())
    pose = np.array(CAMERA.world_from_camera)
    pose[:3, 3] += shift
    far = _volume(renderer, _box(shift), CAMERA.replace(world_from_camera=pose))
    np.testing.assert_allclose(far.bounds - shift, near.bounds, atol=1e-3)
    np.testing.assert_allclose(far.flux.sum(), near.flux.sum(), rtol=0.02)


@pytest.mark.parametrize("indirect", ["off", "final-gather", "clustered"])
def test_what_is_not_there_says_so(renderer: ml.Renderer, indirect: str) -> None:
    settings = ml.Settings(
        indirect=indirect, indirect_visibility="on" if indirect == "final-gather" else "off"
    )
    for name in ("volume", "volume_open", "volume_bounds"):
        with pytest.raises(ml.SettingsError, match=f"{name}.*allowed: indirect lpv"):
            renderer.render(_box(), CAMERA, settings, ("image",), (name,))
    assert renderer.render(_box(), CAMERA, settings, ("image",)).volume is None


def test_a_kept_volume_outlives_the_next_render(renderer: ml.Renderer) -> None:
    frame = renderer.render(_box(), CAMERA, LPV, ("image",), KEEP)
    lost = renderer.render(_box(), CAMERA, LPV, ("image",))
    renderer.render(_box(), CAMERA, LPV, ("image",))
    assert frame.volume is not None
    assert frame["volume"].dtype == np.float32
    assert frame["volume_bounds"].dtype == np.float64
    with pytest.raises(ml.DeviceError, match="volume.*gone"):
        _ = lost.volume


def test_slices_are_drawn(renderer: ml.Renderer) -> None:
    """Each axis, at a place: the brightest pixel lies in the cell before the lit floor."""
    volume = _volume(renderer, _box())
    x, y, z = volume.size
    for axis, shape in (("x", (y, z, 3)), ("y", (z, x, 3)), ("z", (y, x, 3))):
        axes = volume.plot(axis=axis)
        assert axes.images[0].get_array().shape == shape
        assert len(axes.collections) == 1
    axes = volume.plot(axis="z", at=0.01, brightest=1e3, walls=False)
    picture = np.asarray(axes.images[0].get_array())[..., 0]
    left, right, bottom, top = axes.images[0].get_extent()
    row, column = np.unravel_index(picture.argmax(), picture.shape)
    assert left + (column + 0.5) * (right - left) / x == pytest.approx(-1, abs=1.5 * volume.edge)
    assert bottom + (row + 0.5) * (top - bottom) / y == pytest.approx(-1, abs=1.5 * volume.edge)
    assert not axes.collections
    for wrong in ({"axis": "w"}, {"at": 7.0}, {"at": "here"}, {"brightest": 0}):
        with pytest.raises(ml.SettingsError, match=next(iter(wrong))):
            volume.plot(**wrong)
    plt.close("all")


def test_frames_keep_it_in_files(renderer: ml.Renderer, tmp_path: object) -> None:
    frame = renderer.render(_box(), CAMERA, LPV, ("image",), KEEP)
    loaded = ml.Frame.load(frame.save(f"{tmp_path}/frame.npz")).volume
    assert loaded is not None
    assert frame.volume is not None
    assert (loaded.flux == frame.volume.flux).all()
    assert (loaded.bounds == frame.volume.bounds).all()
