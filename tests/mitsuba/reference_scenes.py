"""The scenes that references are stored for, a few units across: procedural, or with a scan in them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import miplight as ml
from miplight.mitsuba import Part, Reference
from tests.claim_scenes import CLAIMS

FOLDER = Path(__file__).parent / "references"
SIZE = 128
CLAIM_SIZE = 144
GLOSSY_SIZE = 96
SHININESS = (10, 50, 200, 1000)

SceneAndCamera = tuple[ml.Scene, ml.Camera]


@dataclasses.dataclass(frozen=True)
class Stored:
    """One stored reference: its scene, and how Mitsuba renders it."""

    build: Callable[[], SceneAndCamera]
    spp: int
    max_depth: int = 2
    part: Part = "direct"
    needs_scenes: bool = False  # a scan of the folder that MIPLIGHT_SCENES names

    def render(self, **changes: Any) -> Reference:
        """Render it, with `spp` or others changed."""
        scene, camera = self.build()
        options = {"spp": self.spp, "max_depth": self.max_depth, "part": self.part, **changes}
        return ml.mitsuba.reference(scene, camera, **options)


def path_of(name: str) -> Path:
    return FOLDER / f"{name}.npz"


def load(name: str) -> Reference:
    """The stored reference; its absence is an error, not a skip."""
    return Reference.load(path_of(name))


def _room_with_scan(lamp: bool = True) -> SceneAndCamera:
    """A Cornell-like room of 4 × 3 × 4 units with a bumpy body of 20,000 triangles on its floor."""
    place = ml.shapes.room(boxes=False)
    scene = ml.Scene.from_trimesh(place)
    body = ml.shapes.displaced_sphere(20_000, radius=0.8, amplitude=0.5)
    lift = trimesh.transformations.translation_matrix((0.2, 0.9, -0.1))
    scene.add_mesh(body, name="scan", material=ml.Material((0.75, 0.7, 0.6)), transform=lift)
    if lamp:
        add_lights(scene, place)
    return scene, ml.Camera.look_at(**place.metadata["view"], width=SIZE, height=SIZE)


def add_lights(scene: ml.Scene, place: trimesh.Scene) -> None:
    """Add the area lights that a procedural place describes."""
    for row in place.metadata["lights"]:
        corner, edge_u, edge_v, radiance = np.reshape(row, (4, 3))
        scene.add_light(ml.AreaLight(corner, edge_u, edge_v, radiance=radiance))


def one_light() -> SceneAndCamera:
    return _room_with_scan()


def two_lights() -> SceneAndCamera:
    """A small blue light low on the right, and the wide one under the ceiling."""
    scene, camera = _room_with_scan()
    lamp = ml.AreaLight((1.9, 0.6, 0.6), (0, 0, -0.4), (0, 0.4, 0), radiance=(4.0, 10.0, 30.0))
    lamp.set_geometry(edge_u=lamp.edge_v, edge_v=lamp.edge_u)
    scene.add_light(lamp, name="small")
    return scene, camera


def textured_light() -> SceneAndCamera:
    """A picture of 24 × 16 texels on the left wall: a gradient, bars and one bright corner."""
    scene, camera = _room_with_scan(lamp=False)
    y, x = np.mgrid[:16, :24] / np.array([15.0, 23.0])[:, None, None]
    picture = np.stack([1 + 6 * x, 1 + 4 * y * (np.floor(6 * x) % 2), 5 * (1 - y)], axis=-1)
    picture[:4, :5] = (30.0, 25.0, 10.0)
    scene.add_light(ml.AreaLight((-1.95, 0.5, 1.2), (0, 0, -2.4), (0, 1.6, 0), radiance=picture), name="tv")
    return scene, camera


def hard_spot() -> SceneAndCamera:
    """A spot from the upper left front; the cone's edge lies on the body, the floor and a wall."""
    scene, camera = _room_with_scan(lamp=False)
    spot = ml.SpotLight((-1.2, 2.6, 1.6), (0.2, 0.8, -0.2), intensity=(30.0, 26.0, 20.0), cutoff=22.0)
    scene.add_light(spot, name="spot")
    return scene, camera


def _interior() -> tuple[ml.Scene, ml.Camera, trimesh.Scene]:
    place = ml.shapes.cluttered_interior(100_000)
    camera = ml.Camera.look_at(**place.metadata["view"], width=SIZE, height=SIZE)
    return ml.Scene.from_trimesh(place), camera, place


def cluttered() -> SceneAndCamera:
    """A study of 100,000 triangles with thin things, lit by a panel under its ceiling."""
    scene, camera, _ = _interior()
    top = float(scene.meshes["ceiling"].bounds[0, 1]) - 0.02
    panel = ml.AreaLight((-1.2, top, -0.8), (1.8, 0, 0), (0, 0, 1.2), radiance=(12.0, 11.0, 10.0))
    scene.add_light(panel, name="panel")
    return scene, camera


def blind() -> SceneAndCamera:
    """The same study by its own lights: a window right behind a blind, and a lamp."""
    scene, camera, place = _interior()
    add_lights(scene, place)
    return scene, camera


def glossy_floor(shininess: float, shadowed: bool = False, size: int = GLOSSY_SIZE) -> SceneAndCamera:
    """A dark glossy floor before a screen that stands upright at its back: bright bars, a disc, dark parts.

    Shadowed, a box and a sphere stand between, and hide some of the screen from the floor and the eye.
    """
    scene = ml.Scene()
    material = ml.Material((0.1, 0.1, 0.1), specular=(0.6, 0.6, 0.6), shininess=shininess)
    corners = [(-2.5, 0, -2), (-2.5, 0, 3), (2.5, 0, 3), (2.5, 0, -2)]
    scene.add_arrays(corners, [(0, 1, 2), (0, 2, 3)], name="floor", material=material, shading="flat")
    screen = ml.AreaLight((-1.6, 0.15, -1.8), (3.2, 0, 0), (0, 1.8, 0), radiance=_test_picture())
    scene.add_light(screen, name="screen")
    if shadowed:
        shade = ml.Material((0.5, 0.5, 0.5))
        turned = trimesh.transformations.rotation_matrix(0.5, (0, 1, 0), (-0.8, 0, -0.5))
        turned = turned @ trimesh.transformations.translation_matrix((-0.8, 0.35, -0.5))
        scene.add_mesh(
            trimesh.creation.box((0.5, 0.7, 0.5)),
            name="box",
            material=shade,
            transform=turned,
            shading="flat",
        )
        ball = trimesh.creation.icosphere(subdivisions=4, radius=0.35)
        lift = trimesh.transformations.translation_matrix((0.7, 0.42, -0.6))
        scene.add_mesh(ball, name="ball", material=shade, transform=lift)
    return scene, ml.Camera.look_at((0.2, 1.7, 3.0), (0.0, 0.0, 0.15), fov_y=46, width=size, height=size)


def _test_picture() -> Any:
    """36 × 20 texels, no two corners alike: (20, 36, 3) float64."""
    y, x = np.mgrid[:20, :36]
    picture = np.stack([0.3 + 0.02 * x, 0.2 + 0.03 * y, 0.9 - 0.02 * x], axis=-1)
    picture[:, 4:7] = (14.0, 12.0, 9.0)
    picture[3:6, 10:22] = (2.0, 9.0, 3.0)
    picture[(x - 28) ** 2 + (y - 6) ** 2 < 20] = (16.0, 4.0, 1.5)
    picture[14:, 18:] *= 0.1
    picture[15:18, 30:34] = (3.0, 6.0, 18.0)
    return picture


def _glossy(shininess: float, shadowed: bool) -> Stored:
    return Stored(lambda: glossy_floor(shininess, shadowed), 32768)


def _claim(name: str) -> Stored:
    """One of the scenes that the claims about direct light are held against."""
    claim = CLAIMS[name]
    return Stored(lambda: claim.build(CLAIM_SIZE, CLAIM_SIZE), 8192, needs_scenes=claim.needs_scenes)


STORED = {
    "one_light": Stored(one_light, 8192),
    "two_lights": Stored(two_lights, 8192),
    "textured_light": Stored(textured_light, 8192),
    "hard_spot": Stored(hard_spot, 64),
    "cluttered": Stored(cluttered, 8192),
    "blind": Stored(blind, 16384),
    "one_bounce": Stored(one_light, 8192, 3, "total"),
    "one_bounce_indirect": Stored(one_light, 8192, 3, "indirect"),
    "four_bounces_indirect": Stored(one_light, 4096, 6, "indirect"),
    "spot_indirect": Stored(hard_spot, 8192, 3, "indirect"),
    **{f"glossy_floor_{n}": _glossy(n, shadowed=False) for n in SHININESS},
    **{f"glossy_shadowed_{n}": _glossy(n, shadowed=True) for n in SHININESS},
    "dragon_two": _claim("dragon_two"),
    "dragon_card": _claim("dragon_card"),
    "ribbon_video": _claim("ribbon_video"),
    "far_near": _claim("far_near"),
}
