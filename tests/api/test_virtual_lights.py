"""Reflective shadow maps, virtual lights and clusters of a frame, as arrays."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import miplight as ml
from miplight.virtual_lights import LIGHT

KEEP = ("rsm", "virtual_lights")
SPOT, AIM, CUTOFF = (-1.2, 2.6, 1.6), (0.2, 0.8, -0.6), 35.0


def _place() -> tuple[ml.Scene, ml.Camera]:
    scene = ml.Scene.from_trimesh(ml.shapes.room(boxes=True))
    scene.add_light(ml.SpotLight(SPOT, AIM, (30.0, 26.0, 20.0), cutoff=CUTOFF), name="spot")
    return scene, ml.Camera.look_at((0, 1.5, 5.6), (0, 1.5, 4.6), fov_y=45, width=32, height=24)


def _lights(renderer: ml.Renderer, indirect: str = "clustered", **changes: object) -> ml.VirtualLights:
    settings = ml.Settings(
        direct="off", indirect=indirect, indirect_visibility="off", rsm_resolution=64, **changes
    )
    keep = KEEP if indirect != "hierarchical" else KEEP[:1]
    found = renderer.render(*_place(), settings, ("image",), keep).virtual_lights
    assert found is not None
    return found


def test_maps_see_what_rays_hit(renderer: ml.Renderer) -> None:
    """Positions and distances against trimesh along the frustum's rays; nothing outside of the cone."""
    found = _lights(renderer)
    assert found.position.shape == (1, 64, 64, 3)
    seen = np.isfinite(found.distance[0])
    assert seen.mean() > 0.75
    mesh = trimesh.util.concatenate(ml.shapes.room(boxes=True).dump())
    offset = found.position[0][seen].astype(np.float64) - SPOT
    far = np.linalg.norm(offset, axis=1)
    np.testing.assert_allclose(found.distance[0][seen], far, rtol=1e-5)
    some = np.arange(0, len(far), 37)
    rays = offset[some] / far[some, None]
    triangles = mesh.triangles
    for ray, distance in zip(rays, far[some], strict=True):
        assert _first_hit(np.array(SPOT), ray, triangles) == pytest.approx(distance, rel=1e-4)
    axis = np.subtract(AIM, SPOT) / np.linalg.norm(np.subtract(AIM, SPOT))
    inside = (offset / far[:, None]) @ axis > np.cos(np.radians(CUTOFF + 1))
    assert not found.flux[0][seen][~inside].any()
    assert np.linalg.norm(found.normal[0][seen], axis=1) == pytest.approx(1, abs=1e-5)
    # solid angles of the cone add up to 2 π (1 − cos)
    assert found.solid_angle.sum() == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(CUTOFF))), rel=0.01)


def _first_hit(origin: np.ndarray, ray: np.ndarray, triangles: np.ndarray) -> float:
    """Distance of the nearest triangle [Möller–Trumbore], in float64."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(ray, v)
    det = (u * p).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = ((origin - a) * p).sum(1) / det
        q = np.cross(origin - a, u)
        t = (q @ ray) / det
        far = (v * q).sum(1) / det
        hit = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9) & (far > 1e-6)
    return float(far[hit].min())


@pytest.mark.parametrize(
    ("indirect", "changes"),
    [("clustered", {"vpls": 1024, "coarsest_vpls": 16}), ("gather", {"vpls": 256}), ("splat", {"vpls": 64})],
)
def test_lights_stand_for_all_texels_once(
    renderer: ml.Renderer, indirect: str, changes: dict[str, int]
) -> None:
    found = _lights(renderer, indirect, **changes)
    lights = found.lights
    assert lights is not None
    assert lights.dtype == LIGHT
    np.testing.assert_allclose(lights["flux"].sum(0), found.flux.sum((0, 1, 2)), rtol=1e-5)
    lit = found.flux.sum(-1) > 0
    numbers = found.cluster_map
    assert (numbers[lit] >= 0).all()
    assert numbers.max() == len(lights) - 1
    for number in range(0, len(lights), 7):
        own = found.flux[numbers == number].sum(0)
        np.testing.assert_allclose(lights["flux"][number], own, rtol=1e-5, atol=1e-9)
        # its ball holds the middles of its texels
        apart = np.linalg.norm(found.position[(numbers == number) & lit] - lights["position"][number], axis=1)
        assert (apart <= lights["radius"][number] * (1 + 1e-5) + 1e-6).all()
    assert 0.02 < found.borders.mean() < 0.9


def test_without_a_list_there_are_maps_alone(renderer: ml.Renderer) -> None:
    found = _lights(renderer, "hierarchical")
    assert found.lights is None
    with pytest.raises(ml.SettingsError, match="cluster_map needs a list"):
        _ = found.cluster_map


@pytest.mark.parametrize(
    ("changes", "keep", "part"),
    [
        ({"indirect": "hierarchical", "indirect_visibility": "off"}, "virtual_lights", "clustered"),
        ({"indirect": "final-gather"}, "rsm", "clustered, hierarchical"),
        ({}, "rsm", "allowed: indirect"),
    ],
)
def test_what_is_not_there_says_so(
    renderer: ml.Renderer, changes: dict[str, object], keep: str, part: str
) -> None:
    with pytest.raises(ml.SettingsError, match=part):
        renderer.render(*_place(), ml.Settings(**changes), ("image",), (keep,))  # type: ignore[arg-type]


def test_frames_without_virtual_lights_have_none(renderer: ml.Renderer) -> None:
    assert renderer.render(*_place(), ml.Settings(), ("image",)).virtual_lights is None


def test_a_kept_list_outlives_the_next_render(renderer: ml.Renderer) -> None:
    settings = ml.Settings(indirect="clustered", indirect_visibility="off", rsm_resolution=64)
    frame = renderer.render(*_place(), settings, ("image",), KEEP)
    lost = renderer.render(*_place(), settings, ("image",))
    renderer.render(*_place(), ml.Settings(), ("image",))
    assert frame.virtual_lights is not None
    with pytest.raises(ml.DeviceError, match="virtual_lights.*gone"):
        _ = lost.virtual_lights


def test_a_far_scene_has_its_places(renderer: ml.Renderer) -> None:
    """Positions are those of the scene, not of the rebased one."""
    scene, camera = _place()
    near = _lights(renderer)
    shift = np.array([1000.0, -500.0, 250.0])
    moved = ml.Scene()
    for number, mesh in enumerate(ml.shapes.room(boxes=True).dump()):
        moved.add_mesh(mesh.apply_translation(shift), name=str(number))
    moved.add_light(ml.SpotLight(SPOT + shift, AIM + shift, (30.0, 26.0, 20.0), cutoff=CUTOFF))
    pose = np.array(camera.world_from_camera)
    pose[:3, 3] += shift
    settings = ml.Settings(direct="off", indirect="clustered", indirect_visibility="off", rsm_resolution=64)
    found = renderer.render(moved, camera.replace(world_from_camera=pose), settings, ("image",), KEEP)
    lights = found.virtual_lights
    assert lights is not None
    seen = np.isfinite(lights.distance)
    np.testing.assert_allclose(lights.position[seen] - shift, near.position[seen], atol=2e-3)
    assert scene.lights


def test_pictures_are_drawn(renderer: ml.Renderer) -> None:
    found = _lights(renderer)
    axes = found.plot()
    assert axes.images[0].get_array().shape == (64, 64, 3)
    with pytest.raises(ml.SettingsError, match="map is 3"):
        found.plot(map=3)
