"""Procedural shapes: triangle counts, closedness, orientation, determinism."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

import miplight as ml
from miplight import shapes

MESHES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "quad": lambda: shapes.quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 3, 2),
    "box": shapes.box,
    "lathe": lambda: shapes.lathe([(1, 0), (1, 2)], 16, flutes=4, flute_depth=0.1),
    "tube": lambda: shapes.tube([(0, 0, 0), (1, 0, 0), (1, 1, 0)], 0.1),
    "displaced_sphere": shapes.displaced_sphere,
    "fence": shapes.fence,
    "wires": shapes.wires,
    "slats": shapes.slats,
    "crossing_ribbon": shapes.crossing_ribbon,
    "towers": shapes.towers,
}
PLACES: dict[str, Callable[[], trimesh.Scene]] = {
    "room": shapes.room,
    "colonnade": lambda: shapes.colonnade(80_000),
    "cluttered_interior": shapes.cluttered_interior,
    "bare_floor": shapes.bare_floor,
    "half_unlit": shapes.half_unlit,
    "wires_and_slats": shapes.wires_and_slats,
    "wires_and_slats_wide": lambda: shapes.wires_and_slats("wide"),
}


def count(place: trimesh.Scene) -> int:
    return sum(len(place.geometry[place.graph[node][1]].faces) for node in place.graph.nodes_geometry)


@pytest.mark.parametrize("name", MESHES)
def test_meshes_are_sound_and_always_the_same(name: str) -> None:
    first, second = MESHES[name](), MESHES[name]()
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)
    scene = ml.Scene()
    scene.add_mesh(first, name=name)
    assert scene.report.dropped == 0
    assert scene.report.triangles == len(first.faces)


@pytest.mark.parametrize("name", PLACES)
def test_places_are_sound_and_say_how_to_look_at_them(name: str) -> None:
    place = PLACES[name]()
    scene = ml.Scene.from_trimesh(place)
    assert scene.report.dropped == 0
    assert scene.report.triangles == count(place)
    assert all(report.notes == () for report in scene.report.values())
    camera = ml.Camera.look_at(**place.metadata["view"], width=64, height=48)
    assert camera.width == 64
    for row in place.metadata["lights"]:
        scene.add_light(ml.AreaLight(row[:3], row[3:6], row[6:9], row[9:]))
    assert scene.bounds is not None
    again = PLACES[name]()
    for key, mesh in place.geometry.items():
        np.testing.assert_array_equal(mesh.vertices, again.geometry[key].vertices)


@pytest.mark.parametrize("triangles", [20, 80, 100, 1_000, 20_000, 100_002])
def test_displaced_spheres_are_closed_and_exact(triangles: int) -> None:
    mesh = shapes.displaced_sphere(triangles)
    assert len(mesh.faces) == triangles
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert radius.min() > 0.75
    assert radius.max() < 1.25


def test_displaced_spheres_vary() -> None:
    assert len(shapes.displaced_sphere(1_001).faces) == 1_000
    radius = np.linalg.norm(shapes.displaced_sphere(20_000).vertices, axis=1)
    assert np.ptp(radius) > 0.1
    other = np.linalg.norm(shapes.displaced_sphere(20_000, seed=1).vertices, axis=1)
    assert np.abs(radius - other).max() > 0.05
    flat = np.linalg.norm(shapes.displaced_sphere(20_000, radius=2.0, amplitude=0.0).vertices, axis=1)
    np.testing.assert_allclose(flat, 2.0)


def test_boxes_point_outwards() -> None:
    box = shapes.box((1, 2, 3), (4, 5, 6))
    assert box.bounds.tolist() == [[3.5, 4, 4.5], [4.5, 6, 7.5]]
    outward = box.triangles_center - (4, 5, 6)
    assert ((outward * box.face_normals).sum(axis=1) > 0.4).all()
    welded = box.copy()
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    assert welded.is_watertight
    assert welded.volume == pytest.approx(6.0)
    # split corners: smooth shading keeps the edges
    np.testing.assert_allclose(box.vertex_normals, np.repeat(box.face_normals[::2], 4, axis=0), atol=1e-12)


def test_lathes_point_outwards_and_close_at_the_axis() -> None:
    ball = shapes.lathe([(np.sin(a), -np.cos(a)) for a in np.linspace(0, np.pi, 33)[1:-1]], 64)
    assert ((ball.triangles_center * ball.face_normals).sum(axis=1) > 0).all()
    closed = shapes.lathe([(0, 0), (1, 0), (1, 0), (1, 1), (1, 1), (0, 1)], 32)
    closed.merge_vertices()
    assert closed.is_watertight
    assert closed.volume == pytest.approx(np.pi, rel=0.01)


def test_tubes_point_outwards_and_keep_their_radius() -> None:
    path = np.array([(np.cos(t), 0.3 * t, np.sin(t)) for t in np.linspace(0, 6, 60)])
    tube = shapes.tube(path, 0.05, sides=12)
    centre = np.repeat((path[:-1] + path[1:]) / 2, 24, axis=0)
    outward = tube.triangles_center - centre
    assert ((outward * tube.face_normals).sum(axis=1) > 0.03).all()
    distance = np.linalg.norm(tube.vertices - np.repeat(path, 12, axis=0), axis=1)
    np.testing.assert_allclose(distance, 0.05, rtol=1e-9)


def test_quads_face_their_side_and_merge_keeps_uvs() -> None:
    quad = shapes.quad((1, 1, 1), (2, 0, 0), (0, 0, 2), 4, 3)
    assert len(quad.faces) == 24
    np.testing.assert_allclose(quad.face_normals, np.tile([0, -1, 0], (24, 1)))
    assert quad.area == pytest.approx(4.0)
    both = shapes.merge([quad, shapes.box()])
    assert len(both.visual.uv) == len(both.vertices)
    bare = shapes.merge([quad, shapes.displaced_sphere(20)])
    assert getattr(bare.visual, "uv", None) is None


def test_the_ribbon_passes_through_itself() -> None:
    ribbon = shapes.crossing_ribbon(segments=100)
    near = np.abs(ribbon.triangles_center[:, [0, 2]]).max(axis=1) < 0.03
    headings = ribbon.face_normals[near]
    assert np.abs(headings @ headings.T).min() < 0.2  # two sheets at right angles in one place


@pytest.mark.parametrize("triangles", [80_000, 500_000])
def test_the_colonnade_meets_its_number_and_shares_its_columns(triangles: int) -> None:
    place = shapes.colonnade(triangles)
    assert count(place) == pytest.approx(triangles, rel=0.02)
    scene = ml.Scene.from_trimesh(place)
    columns = {scene.meshes[f"column_{k}"].geometry for k in range(16)}
    assert len(columns) == 1


def test_the_interior_meets_its_number() -> None:
    assert count(shapes.cluttered_interior(100_000)) == pytest.approx(100_000, rel=0.01)
    assert count(shapes.cluttered_interior(75_000, seed=3)) == pytest.approx(75_000, rel=0.01)


def test_the_room_has_the_walls_asked_for() -> None:
    assert set(shapes.room().geometry) == {"floor", "ceiling", "back", "left", "right", "tall_box", "low_box"}
    closed = shapes.room((2, 2, 2), boxes=False, open_front=False)
    assert set(closed.geometry) == {"floor", "ceiling", "back", "left", "right", "front"}
    for mesh in closed.geometry.values():  # walls face inwards
        assert mesh.face_normals[0] @ (np.array([0, 1, 0]) - mesh.triangles_center[0]) > 0


def test_the_two_lights_over_wires_have_the_same_power() -> None:
    small, wide = (shapes.wires_and_slats(light).metadata["lights"][0] for light in ("small", "wide"))
    power = [np.linalg.norm(np.cross(row[3:6], row[6:9])) * row[9:] for row in (small, wide)]
    np.testing.assert_allclose(*power)
    assert np.linalg.norm(wide[3:6]) > 10 * np.linalg.norm(small[3:6])


def test_the_wires_are_thinner_than_two_pixels() -> None:
    """Between a third of a pixel and two, at 256 × 256, where they hang."""
    place = shapes.wires_and_slats()
    camera = ml.Camera.look_at(**place.metadata["view"], width=256, height=256)
    ends = place.geometry["wires"].vertices.reshape(-1, 2, 6, 3)
    radius = np.linalg.norm(ends - ends.mean(axis=2, keepdims=True), axis=-1).mean(axis=(1, 2))
    away = np.linalg.norm(ends.mean(axis=(1, 2)) - camera.origin, axis=-1)
    pixels = 2 * radius / away * camera.K[1, 1]
    assert 0.2 < pixels.min() < 0.35
    assert 1.5 < pixels.max() < 2.5


def test_half_of_what_is_seen_is_behind_the_light() -> None:
    place = shapes.half_unlit()
    camera = ml.Camera.look_at(**place.metadata["view"], width=32, height=32)
    row = place.metadata["lights"][0]
    normal = np.cross(row[3:6], row[6:9])
    points = camera.origin + camera.ray_directions() * camera.origin[1]
    assert (((points - row[:3]) @ normal) < 0).mean() == 0.5


def test_pictures_for_lights() -> None:
    card, frame = shapes.color_card(24, 32), shapes.video_frame(48, 64, peak=60.0)
    assert card.shape == (24, 32, 3)
    assert frame.shape == (48, 64, 3)
    assert card.dtype == frame.dtype == np.float32
    turned = [card[::-1], card[:, ::-1], card[::-1, ::-1]]
    assert all(np.abs(card - other).mean() > 0.2 * card.mean() for other in turned)
    square = shapes.color_card(16, 16)
    assert np.abs(square - square.swapaxes(0, 1)).mean() > 0.2 * square.mean()
    assert card.max() == pytest.approx(30.0)
    assert frame.max() == pytest.approx(60.0)
    assert frame.max() > 1000 * frame.min(axis=-1).min() > 0  # as strong in contrast as a film
    later = shapes.video_frame(48, 64, time=1.0)
    assert np.abs(frame - later).mean() > 0.1 * frame.mean()  # and it moves
    np.testing.assert_array_equal(frame, shapes.video_frame(48, 64, peak=60.0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: shapes.displaced_sphere(19),
        lambda: shapes.displaced_sphere(100, amplitude=1.0),
        lambda: shapes.quad((0, 0, 0), (1, 0, 0), (0, 1, 0), columns=0),
        lambda: shapes.lathe([(1, 0)]),
        lambda: shapes.lathe([(1, 0), (1, 0)]),
        lambda: shapes.lathe([(1, 0), (1, 1)], segments=2),
        lambda: shapes.tube([(0, 0, 0)], 0.1),
        lambda: shapes.tube([(0, 0, 0), (1, 0, 0)], -0.1),
        lambda: shapes.merge([]),
        lambda: shapes.colonnade(1_000),
        lambda: shapes.cluttered_interior(1_000),
        lambda: shapes.towers(0),
        lambda: shapes.room((1, 1)),
        lambda: shapes.wires_and_slats("large"),
        lambda: shapes.bare_floor(0.0),
        lambda: shapes.color_card(0),
        lambda: shapes.video_frame(peak=-1.0),
    ],
)
def test_bad_arguments(make: Callable[[], Any]) -> None:
    with pytest.raises(ml.SceneError, match="allowed"):
        make()
