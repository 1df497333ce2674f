"""The scenes that the claims about direct light are held against; by name, at any size.

`CLAIMS` has a row for each kind of place that a bound is promised for. Scans come from the folder that
MIPLIGHT_SCENES names; without it `available` leaves those scenes out.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike

import miplight as ml
from miplight.one_call import as_lights

SceneAndCamera = tuple[ml.Scene, ml.Camera]


@dataclasses.dataclass(frozen=True)
class Bounds:
    """What is promised of one scene; None where nothing is."""

    relative_rmse: float | None = None
    median: float | None = None
    rays_a_pixel: float | None = 20.0
    fragments_a_pixel: float | None = 0.35  # at 256 × 256; and fewer at 1024 × 1024
    shadow_rays: int | None = None
    faster: dict[int, float] = dataclasses.field(default_factory=lambda: {256: 1.5, 512: 2.5})


@dataclasses.dataclass(frozen=True)
class Claim:
    """A scene and what is promised of it."""

    build: Callable[[int, int], SceneAndCamera]  # width, height
    bounds: Bounds
    needs_scenes: bool = False
    spp: int = 1024  # of a reference at 256 × 256, so that its noise is a third of the bounds or less


def scans() -> Path | None:
    """Folder of scans and scenes, or None."""
    folder = os.environ.get("MIPLIGHT_SCENES")
    return Path(folder) if folder else None


def place_in(place: trimesh.Scene, width: int, height: int, *, lights: bool = True) -> SceneAndCamera:
    """Scene and camera of a procedural place."""
    scene = ml.Scene.from_trimesh(place)
    for light in as_lights(place.metadata["lights"]) if lights else []:
        scene.add_light(light)
    return scene, ml.Camera.look_at(**place.metadata["view"], width=width, height=height)


def scan_mesh(name: str, across: float, at: ArrayLike, turn: float = 0.0) -> trimesh.Trimesh:
    """A scan of the folder, `across` wide, its lowest point at `at`."""
    folder = scans()
    if folder is None:
        raise FileNotFoundError("MIPLIGHT_SCENES is not set")
    mesh: trimesh.Trimesh = trimesh.load(folder / "meshes" / f"{name}.ply", process=False)
    low, high = mesh.bounds
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    mesh.apply_translation(-foot)
    mesh.apply_scale(across / (high - low).max())
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn), (0, 1, 0)))
    mesh.apply_translation(np.asarray(at, np.float64))
    return mesh


def _room(width: int, height: int, *, lights: bool = True) -> SceneAndCamera:
    return place_in(ml.shapes.room(boxes=False), width, height, lights=lights)


def _dragon_room(width: int, height: int, *, lights: bool = True) -> SceneAndCamera:
    scene, camera = _room(width, height, lights=lights)
    dragon = scan_mesh("dragon_20k", 2.4, (0.1, 0.0, 0.0), 25.0)
    scene.add_mesh(dragon, name="dragon", material=ml.Material((0.75, 0.7, 0.6)))
    return scene, camera


def _sphere_room(width: int, height: int, *, lights: bool = True) -> SceneAndCamera:
    scene, camera = _room(width, height, lights=lights)
    body = ml.shapes.displaced_sphere(20_000, radius=0.8, amplitude=0.5)
    lift = trimesh.transformations.translation_matrix((0.2, 0.9, -0.1))
    scene.add_mesh(body, name="scan", material=ml.Material((0.75, 0.7, 0.6)), transform=lift)
    return scene, camera


def _nefertiti(width: int, height: int) -> SceneAndCamera:
    """A bust of 100,000 triangles seen close, under the room's light and a red one at its side."""
    scene, camera = _room(width, height)
    bust = scan_mesh("nefertiti_100k", 1.9, (0.0, 0.0, 0.3), -20.0)
    scene.add_mesh(bust, name="bust", material=ml.Material((0.7, 0.6, 0.5)))
    scene.add_light(side_lamp((28.0, 5.0, 4.0)), name="side")
    return scene, camera.replace(fov_y=33.0)


def side_lamp(radiance: ArrayLike) -> ml.AreaLight:
    """A small light low on the right."""
    return ml.AreaLight((1.9, 0.6, 0.6), (0, 0.4, 0), (0, 0, -0.4), radiance=radiance)


def screen(radiance: ArrayLike) -> ml.AreaLight:
    """A screen of 2.4 × 1.6 on the left wall."""
    return ml.AreaLight((-1.95, 0.5, 1.2), (0, 0, -2.4), (0, 1.6, 0), radiance=radiance)


def _two(base: Callable[..., SceneAndCamera]) -> Callable[[int, int], SceneAndCamera]:
    def build(width: int, height: int) -> SceneAndCamera:
        scene, camera = base(width, height)
        scene.add_light(side_lamp((4.0, 10.0, 30.0)), name="side")
        return scene, camera

    return build


def _shown(base: Callable[..., SceneAndCamera], picture: ArrayLike) -> Callable[[int, int], SceneAndCamera]:
    def build(width: int, height: int) -> SceneAndCamera:
        scene, camera = base(width, height, lights=False)
        scene.add_light(screen(picture), name="screen")
        return scene, camera

    return build


def _far_and_near(width: int, height: int) -> SceneAndCamera:
    """A small light eight units away, as bright on the floor as the wide one that hangs low over it."""
    scene, camera = _sphere_room(width, height, lights=False)
    wide = ml.AreaLight((-1.5, 2.3, -1.5), (2.4, 0, 0), (0, 0, 2.4), radiance=(1.6, 1.5, 1.3))
    scene.add_light(wide, name="wide")
    far = ml.AreaLight((1.0, 3.4, 8.0), (0.15, 0, 0), (0, -0.15, 0), radiance=(6500.0, 7000.0, 8000.0))
    scene.add_light(far, name="far")
    return scene, camera


def _interior_panel(width: int, height: int) -> SceneAndCamera:
    scene, camera = place_in(ml.shapes.cluttered_interior(100_000), width, height, lights=False)
    top = float(scene.meshes["ceiling"].bounds[0, 1]) - 0.02
    panel = ml.AreaLight((-1.2, top, -0.8), (1.8, 0, 0), (0, 0, 1.2), radiance=(12.0, 11.0, 10.0))
    scene.add_light(panel, name="panel")
    return scene, camera


def _interior_window(width: int, height: int) -> SceneAndCamera:
    return place_in(ml.shapes.cluttered_interior(100_000), width, height)


def _ribbon(width: int, height: int) -> SceneAndCamera:
    """A closed band that passes through itself, a fence behind it, on a floor, by a screen's light."""
    scene, camera = _room(width, height, lights=False)
    lift = trimesh.transformations.translation_matrix((0.1, 0.75, 0.1))
    scene.add_mesh(
        ml.shapes.crossing_ribbon(2.4, 0.9),
        name="ribbon",
        material=ml.Material((0.8, 0.75, 0.7)),
        transform=lift,
    )
    back = trimesh.transformations.translation_matrix((0.2, 0.0, -1.2))
    scene.add_mesh(ml.shapes.fence(2.6, 1.1, 18), name="fence", transform=back, shading="flat")
    scene.add_light(screen(ml.shapes.video_frame()), name="screen")
    return scene, camera


def _file(folder: str, name: str, camera: int = 0) -> Callable[[int, int], SceneAndCamera]:
    """A whole scene of the folder with the lights and a camera of its JSON file."""

    def build(width: int, height: int) -> SceneAndCamera:
        base = scans()
        if base is None:
            raise FileNotFoundError("MIPLIGHT_SCENES is not set")
        notes = json.loads((base / folder / f"{name}.json").read_text())
        scene = ml.Scene.from_trimesh(trimesh.load(base / folder / f"{name}.glb", process=False))
        for lamp in notes["lights"]:
            names = ("center", "half_u", "half_v", "radiance")
            middle, u, v, radiance = (np.array(lamp[name], np.float64) for name in names)
            scene.add_light(ml.AreaLight(middle - u - v, 2 * u, 2 * v, radiance=radiance))
        eye = notes["cameras"][camera]
        view = {key: eye[key] for key in ("origin", "target", "up")}
        return scene, ml.Camera.look_at(
            **view, fov_y=min(eye["fov_degrees"], 60.0), width=width, height=height
        )

    return build


def _of(make: Callable[[], trimesh.Scene]) -> Callable[[int, int], SceneAndCamera]:
    return lambda width, height: place_in(make(), width, height)


_SCAN = Bounds(0.02, 0.006)
_CLUTTER = Bounds(0.04, rays_a_pixel=None, fragments_a_pixel=None, faster={})
_OPEN = Bounds(rays_a_pixel=None, fragments_a_pixel=None, faster={})
_MANY = 8192  # Mitsuba samples a picture by its area alone
_CARD, _VIDEO = ml.shapes.color_card(), ml.shapes.video_frame()

CLAIMS: dict[str, Claim] = {
    "dragon_one": Claim(_dragon_room, _SCAN, True),
    "dragon_two": Claim(_two(_dragon_room), _SCAN, True),
    "dragon_card": Claim(_shown(_dragon_room, _CARD), _SCAN, True, _MANY),
    "dragon_video": Claim(_shown(_dragon_room, _VIDEO), _SCAN, True, _MANY),
    "nefertiti": Claim(_nefertiti, _SCAN, True),
    "sphere_one": Claim(_sphere_room, _SCAN),
    "sphere_two": Claim(_two(_sphere_room), _SCAN),
    "sphere_card": Claim(_shown(_sphere_room, _CARD), _SCAN, spp=_MANY),
    "boxes": Claim(_of(ml.shapes.room), _SCAN),
    "interior_panel": Claim(_interior_panel, _CLUTTER),
    "interior_window": Claim(_interior_window, _OPEN),
    "ribbon_video": Claim(_ribbon, _CLUTTER, spp=_MANY),
    "far_near": Claim(_far_and_near, dataclasses.replace(_CLUTTER, relative_rmse=0.03)),
    "torture_small": Claim(_of(lambda: ml.shapes.wires_and_slats("small")), _OPEN),
    "torture_wide": Claim(_of(lambda: ml.shapes.wires_and_slats("wide")), _OPEN),
    "bare_floor": Claim(
        _of(ml.shapes.bare_floor), dataclasses.replace(_OPEN, relative_rmse=0.001, shadow_rays=0)
    ),
    "half_unlit": Claim(_of(ml.shapes.half_unlit), _OPEN),
    "cornell": Claim(_file("cornell_box", "cornell_box"), _SCAN, True),
    "staircase": Claim(_file("staircase", "staircase"), _CLUTTER, True),
    "sponza": Claim(_file("sponza_dabrovic", "sponza"), _CLUTTER, True),
}


def far_rooms(apart: float, size: int) -> SceneAndCamera:
    """A lit room of 4 × 3 × 4 with a box in it, seen from a corner; another so far along each axis."""
    scene = ml.Scene()
    for name, at in {"near": 0.0, "far": apart}.items():
        if name == "far" and not apart:
            continue
        for part, extents, middle in (
            ("room", (4, 3, 4), (0, 1.5, 0)),
            ("box", (1, 1, 1), (-0.6, 0.5, -0.6)),
        ):
            mesh = trimesh.creation.box(extents)
            mesh.apply_translation(np.array(middle) + at)
            scene.add_mesh(mesh, name=f"{name} {part}", material=ml.Material((0.7, 0.6, 0.5)), shading="flat")
        corner = np.array([0.2, 2.9, -0.5]) + at
        scene.add_light(ml.AreaLight(corner, (1, 0, 0), (0, 0, 1), radiance=(9, 8, 7)), name=name)
    view = ml.Camera.look_at((1.6, 1.6, 1.7), (-0.6, 0.8, -0.6), fov_y=60, width=size, height=size)
    return scene, view


def available() -> list[str]:
    """Names of the scenes that can be built here."""
    return [name for name, claim in CLAIMS.items() if scans() is not None or not claim.needs_scenes]
