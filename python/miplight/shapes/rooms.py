"""Simple places: a Cornell-like room, and towers that shade one another."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from miplight.validate import as_bool, as_count, as_number, as_vector

from .primitives import box, merge, quad

__all__ = ["Place", "light_row", "paint", "room", "towers"]


class Place:
    """Collects painted parts into a trimesh scene; equal geometry is stored once."""

    def __init__(self) -> None:
        self.scene = trimesh.Scene()

    def add(
        self,
        name: str,
        mesh: trimesh.Trimesh,
        color: ArrayLike | None = None,
        at: ArrayLike | list[NDArray[np.float64]] | None = None,
    ) -> None:
        """Add a part, painted if a colour is given; `at` is a transform, or a list of one an instance."""
        if color is not None:
            paint(mesh, color)
        if not isinstance(at, list):
            self.scene.add_geometry(mesh, geom_name=name, node_name=name, transform=at)
            return
        self.scene.geometry[name] = mesh
        for k, transform in enumerate(at):
            self.scene.graph.update(f"{name}_{k}", matrix=transform, geometry=name)

    def finish(self, view: dict[str, object], lights: list[NDArray[np.float64]]) -> trimesh.Scene:
        """Return the scene with its camera and lights as metadata."""
        self.scene.metadata["view"] = view
        self.scene.metadata["lights"] = np.array(lights)
        return self.scene


def paint(mesh: trimesh.Trimesh, color: ArrayLike) -> trimesh.Trimesh:
    """Give a mesh a diffuse base colour, linear RGB in [0, 1] (kept by trimesh as multiples of 1/255)."""
    factor = [*np.asarray(color, dtype=np.float64).tolist(), 1.0]
    material = PBRMaterial(baseColorFactor=factor, metallicFactor=0.0, roughnessFactor=1.0)
    mesh.visual = TextureVisuals(uv=getattr(mesh.visual, "uv", None), material=material)
    return mesh


def light_row(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, radiance: ArrayLike
) -> NDArray[np.float64]:
    """Row of 12 numbers for one area light."""
    return np.concatenate([np.asarray(part, dtype=np.float64) for part in (corner, edge_u, edge_v, radiance)])


def place_at(x: float, y: float, z: float, turn: float = 0.0, scale: float = 1.0) -> NDArray[np.float64]:
    """Matrix that scales, turns about y by `turn` degrees, and moves."""
    c, s = np.cos(np.radians(turn)) * scale, np.sin(np.radians(turn)) * scale
    return np.array([[c, 0, s, x], [0, scale, 0, y], [-s, 0, c, z], [0, 0, 0, 1.0]])


def room(size: ArrayLike = (4.0, 3.0, 4.0), *, boxes: bool = True, open_front: bool = True) -> trimesh.Scene:
    """Cornell-like room, its floor on y = 0 and centred on x = z = 0, with a light under the ceiling.

    Parameters
    ----------
    size : array_like, (3,), default (4, 3, 4)
        Width along x, height along y, depth along z.
    boxes : bool, default True
        Two boxes on the floor.
    open_front : bool, default True
        Leave out the wall at +z, where the camera is.

    Returns
    -------
    trimesh.Scene
        Parts floor, ceiling, back, left (red), right (green), and front, tall_box, low_box where asked for.
    """
    w, h, d = as_vector(size, "size")
    white, red, green = (0.8, 0.8, 0.8), (0.6, 0.1, 0.1), (0.1, 0.4, 0.1)
    place = Place()
    place.add("floor", quad((-w / 2, 0, d / 2), (w, 0, 0), (0, 0, -d)), white)
    place.add("ceiling", quad((-w / 2, h, -d / 2), (w, 0, 0), (0, 0, d)), white)
    place.add("back", quad((-w / 2, 0, -d / 2), (w, 0, 0), (0, h, 0)), white)
    place.add("left", quad((-w / 2, 0, d / 2), (0, 0, -d), (0, h, 0)), red)
    place.add("right", quad((w / 2, 0, -d / 2), (0, 0, d), (0, h, 0)), green)
    if not as_bool(open_front, "open_front"):
        place.add("front", quad((w / 2, 0, d / 2), (-w, 0, 0), (0, h, 0)), white)
    if as_bool(boxes, "boxes"):
        tall, low = (0.28 * w, 0.6 * h, 0.28 * d), (0.28 * w, 0.28 * h, 0.28 * d)
        tall_box, low_box = box(tall, (0, tall[1] / 2, 0)), box(low, (0, low[1] / 2, 0))
        place.add("tall_box", tall_box, white, place_at(-0.18 * w, 0, -0.15 * d, 17.0))
        place.add("low_box", low_box, white, place_at(0.19 * w, 0, 0.16 * d, -16.0))
    lamp = light_row((-0.15 * w, 0.995 * h, -0.15 * d), (0.3 * w, 0, 0), (0, 0, 0.3 * d), (12.0, 11.0, 9.0))
    inside = 0.48 * d if not open_front else 0.5 * d + 1.2 * h
    view = {
        "origin": (0.0, h / 2, inside),
        "target": (0.0, h / 2, 0.0),
        "fov_y": 45.0 if open_front else 75.0,
    }
    return place.finish(view, [lamp])


def towers(count: int = 100, size: float = 10.0, tallest: float = 2.5, seed: int = 0) -> trimesh.Trimesh:
    """City of box towers that shade one another, on a square of ground: 12 · count + 2 triangles.

    Parameters
    ----------
    count : int, default 100
        Towers, on a jittered grid.
    size, tallest : float
        Edge of the ground, which lies on y = 0 about the origin; height of the tallest tower.
    seed : int, default 0
    """
    count, size = as_count(count, "count"), as_number(size, "size", above=0.0)
    tallest = as_number(tallest, "tallest", above=0.0)
    random = np.random.default_rng(as_count(seed, "seed", at_least=0))
    across = int(np.ceil(np.sqrt(count)))
    cell = size / across
    parts = [quad((-size / 2, 0, size / 2), (size, 0, 0), (0, 0, -size))]
    for k in range(count):
        x, z = ((np.array([k % across, k // across]) + 0.5) * cell - size / 2) + random.uniform(
            -0.12, 0.12, 2
        ) * cell
        wide, deep = random.uniform(0.35, 0.7, 2) * cell
        high = tallest * random.uniform(0.1, 1.0) ** 2
        parts.append(box((wide, high, deep), (x, high / 2, z)))
    return merge(parts)
