"""Films: scenes in which light, mesh, camera and size of the image are other ones in each frame."""

from __future__ import annotations

import numpy as np
import trimesh

import miplight as ml
from tests.analytic.closed_forms import floor_scene
from tests.stress.common import lamp, quick

HOW = [
    quick("default"),
    quick("brute-force", light_samples=16),
    quick("area-2010", light_samples=16, voxel_resolution=32, voxel_slices=32),
    quick("radiosity-2009", light_samples=16, rsm_resolution=32, vpls=64, coarsest_vpls=16),
]
WIDTHS = [24, 33, 17, 48]
OUTPUTS = ("image", "fragments", "direct", "indirect")


class Film:
    """A scene of its own in which at each step a light, a mesh, the camera and the size are other ones."""

    def __init__(self, number: int, *, pictures: bool = True) -> None:
        self.rng = np.random.default_rng(number)
        self.number, self.pictures = number, pictures
        self.scene = floor_scene(lamp())
        self.scene.add_mesh(trimesh.creation.icosphere(2, 0.4), name="ball")

    def frame(self, renderer: ml.Renderer, step: int, how: ml.Settings | None = None) -> ml.Frame:
        """Change everything and render it, as `how` says or each time otherwise."""
        scene, rng = self.scene, self.rng
        light = scene.lights["light_0"]
        picture = rng.uniform(0, 5, (int(rng.integers(1, 9)), 4, 3)).astype(np.float32)
        light.radiance = (
            picture if self.pictures and step % 3 == 1 else rng.uniform(1, 5, 3).astype(np.float32)
        )
        scene.set_transform(
            "ball", trimesh.transformations.translation_matrix(rng.uniform(-0.5, 0.5, 3) + 0.5)
        )
        if step % 2:
            vertices = scene.meshes["ball"].positions * rng.uniform(0.8, 1.2, (1, 3))
            scene.set_vertices("ball", vertices)
        if step % 4 == 2:
            scene.add_mesh(trimesh.creation.box(rng.uniform(0.2, 0.6, 3)), name="box", shading="flat")
        elif "box" in scene.meshes:
            scene.remove("box")
        origin = rng.uniform((-0.5, 1, 2), (0.5, 2, 3))
        width = WIDTHS[(step + self.number) % 4]
        camera = ml.Camera.look_at(origin, (0, 0.4, 0), fov_y=50, width=width, height=WIDTHS[step % 4])
        return renderer.render(scene, camera, how or HOW[(step + self.number) % len(HOW)], OUTPUTS)
