"""Procedural geometry for demos, tests and measurements: always the same triangles for the same arguments.

`color_card` and `video_frame` are pictures for lights.

Single shapes are `trimesh.Trimesh`, whole places are `trimesh.Scene` with base colours (and shared geometry
where things repeat); both go into `Scene.add_mesh` and `Scene.from_trimesh`. Y is up, lengths are in metres
or so. Hard edges have split vertices, so that smooth shading keeps them hard.

A place also says how to look at it: ``scene.metadata["view"]`` are the keywords of `Camera.look_at`, and
``scene.metadata["lights"]`` is (N, 12) float64, a row per area light: corner, edge_u, edge_v, radiance.

>>> import miplight as ml
>>> place = ml.shapes.room()
>>> scene = ml.Scene.from_trimesh(place)
>>> camera = ml.Camera.look_at(**place.metadata["view"], width=64, height=48)
"""

from __future__ import annotations

from .colonnade import colonnade
from .hard_places import bare_floor, half_unlit, wires_and_slats
from .interior import cluttered_interior
from .primitives import box, lathe, merge, quad, tube
from .rooms import room, towers
from .screens import color_card, video_frame
from .sphere import displaced_sphere
from .thin import crossing_ribbon, fence, slats, wires

__all__ = [
    "bare_floor",
    "box",
    "cluttered_interior",
    "colonnade",
    "color_card",
    "crossing_ribbon",
    "displaced_sphere",
    "fence",
    "half_unlit",
    "lathe",
    "merge",
    "quad",
    "room",
    "slats",
    "towers",
    "tube",
    "video_frame",
    "wires",
    "wires_and_slats",
]
