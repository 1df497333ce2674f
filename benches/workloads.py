"""What is measured: places of several kinds, each with its lights, its camera and its settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import trimesh

import miplight as ml
from miplight import demo
from miplight.one_call import as_lights


@dataclass(frozen=True)
class Workload:
    """One row of the tables."""

    name: str
    scene: ml.Scene
    camera: ml.Camera
    settings: ml.Settings
    max_depth: int  # of the Mitsuba path that the picture is compared with


def _place(place: trimesh.Scene, width: int, height: int) -> tuple[ml.Scene, ml.Camera]:
    scene = ml.Scene.from_trimesh(place)
    for light in as_lights(place.metadata["lights"]):
        scene.add_light(light)
    return scene, ml.Camera.look_at(**place.metadata["view"], width=width, height=height)


def _direct(light_samples: int) -> ml.Settings:
    return ml.Settings.preset("brute-force").replace(light_samples=light_samples)


def room(size: int) -> Workload:
    """A Cornell-like room, direct light."""
    scene, camera = _place(ml.shapes.room(), size, size)
    return Workload("room", scene, camera, _direct(256), 2)


def scan(size: int) -> Workload:
    """A room with a rough sphere of 20 k triangles in it, direct light."""
    scene, camera = _place(ml.shapes.room(boxes=False), size, size)
    lift = trimesh.transformations.translation_matrix((0.0, 1.2, 0.0))
    scene.add_mesh(ml.shapes.displaced_sphere(20_000), name="scan", transform=lift)
    return Workload("scan", scene, camera, _direct(256), 2)


def scan_default(size: int) -> Workload:
    """The same by the preset "default"."""
    work = scan(size)
    return Workload("scan, default", work.scene, work.camera, ml.Settings.preset("default"), 2)


def spot(size: int) -> Workload:
    """Spot in a room, direct light and one bounce."""
    job = demo.spot_in_a_room(size, size)
    settings = _direct(64).replace(indirect="final-gather", gather_rays=64)
    return Workload("spot, one bounce", job.scene, job.camera, settings, 3)


def interior(size: int) -> Workload:
    """A cluttered interior of 100 k triangles, direct light."""
    scene, camera = _place(ml.shapes.cluttered_interior(), size, size)
    return Workload("cluttered interior", scene, camera, _direct(64), 2)


def colonnade(size: int) -> Workload:
    """Half a million triangles, two lights, direct light."""
    scene, camera = _place(ml.shapes.colonnade(500_000), size, size)
    return Workload("colonnade", scene, camera, _direct(64), 2)


ALL: dict[str, Callable[[int], Workload]] = {
    "room": room,
    "scan": scan,
    "scan_default": scan_default,
    "spot": spot,
    "interior": interior,
    "colonnade": colonnade,
}
