"""Places that are hard for shadows, or that must cost nothing: what a method is tried on."""

from __future__ import annotations

import numpy as np
import trimesh

from miplight.validate import as_choice, as_number

from .primitives import merge, mesh, quad, tube
from .rooms import Place, light_row, place_at
from .thin import fence, slats, wires

__all__ = ["bare_floor", "half_unlit", "wires_and_slats"]

_WHITE, _GREY = (0.8, 0.8, 0.8), (0.5, 0.5, 0.5)


def wires_and_slats(light: str = "small") -> trimesh.Scene:
    """Floor and wall under wires, a fence and a venetian blind: shadows thinner than what looks for them.

    At 256 × 256 pixels the wires are 0.3 to 2 pixels wide; they hang from a thousandth of the floor's size
    to a third of it above the floor. The blind lies below half of the light.

    Parameters
    ----------
    light : {"small", "wide"}
        0.15 or 2.0 wide, in the same place, with the same power.

    Returns
    -------
    trimesh.Scene
        Y is up; the floor is 6 × 6 at y = 0, centred on x = z = 0.
    """
    as_choice(light, "light", ("small", "wide"))
    place = Place()
    place.add("floor", quad((-3, 0, 3), (6, 0, 0), (0, 0, -6)), _WHITE)
    place.add("wall", quad((-3, 0, -3), (6, 0, 0), (0, 3, 0)), (0.7, 0.65, 0.6))
    strung = []
    for k, (height, radius) in enumerate(
        [(0.006, 0.003), (0.03, 0.004), (0.12, 0.006), (0.4, 0.01), (0.9, 0.014), (1.6, 0.02)]
    ):
        z = -1.8 + 0.35 * k
        ends = np.array([(-2.4, height + radius, z), (2.4, height + radius, z + 0.5)])
        strung.append(tube(ends, radius, sides=6))
    place.add("wires", merge(strung), (0.2, 0.2, 0.2))
    lines = wires(10, 5.0, radius=0.005, spacing=0.12, sag=0.4)
    place.add("lines", lines, (0.3, 0.3, 0.3), place_at(0, 1.9, -0.3, 25.0))
    place.add("fence", fence(3.0, 0.7, 30), (0.6, 0.5, 0.35), place_at(0.6, 0, 1.5, -12.0))
    # the blind lies flat below the light's left half, its slats half open
    flat = np.array([[1.0, 0, 0, -1.3], [0, 0, 1, 2.35], [0, -1, 0, 0.9], [0, 0, 0, 1]])
    place.add("blind", slats(14, 2.2, depth=0.07, spacing=0.13, tilt=50.0), _WHITE, flat)
    across = 0.15 if light == "small" else 2.0
    u, v = across * np.array((1.0, 0, 0)), across * np.array((0, 0.0, 0.6))
    corner = np.array((-0.2, 2.8, 0.1)) - u / 2 - v / 2
    lamp = light_row(corner, u, v, np.array((9.0, 8.5, 8.0)) * (2.0 / across) ** 2)
    view = {"origin": (0.4, 2.2, 5.6), "target": (0.0, 0.7, -0.6), "fov_y": 46.0}
    return place.finish(view, [lamp])


def bare_floor(size: float = 6.0) -> trimesh.Scene:
    """Floor with nothing on it, under one light: nothing can throw a shadow.

    Parameters
    ----------
    size : float, default 6.0
        Edge of the floor, which lies on y = 0 about the origin.
    """
    s = as_number(size, "size", above=0.0)
    place = Place()
    place.add("floor", quad((-s / 2, 0, s / 2), (s, 0, 0), (0, 0, -s)), _WHITE)
    lamp = light_row((-0.1 * s, 0.3 * s, -0.1 * s), (0.2 * s, 0, 0), (0, 0, 0.2 * s), (10.0, 9.0, 8.0))
    view = {"origin": (0.0, 0.28 * s, 0.6 * s), "target": (0.0, 0.0, 0.0), "fov_y": 45.0}
    return place.finish(view, [lamp])


def half_unlit() -> trimesh.Scene:
    """Floor of which one half lies behind the light, and ridges whose far slopes face away from it.

    The light stands upright at x = 0 and shines along +x; the view is from straight above.
    """
    place = Place()
    place.add("floor", quad((-4, 0, 4), (8, 0, 0), (0, 0, -8)), _WHITE)
    ridges = []
    for x in (1.4, 2.4, 3.4):
        near, top, far = (x - 0.3, 0.002, 0.0), (x, 0.5, 0.0), (x + 0.3, 0.002, 0.0)
        for left, right in ((near, top), (top, far)):
            half = np.array((0.0, 0.0, 3.0))
            corners = [left + half, right + half, right - half, left - half]
            ridges.append(mesh(corners, [(0, 1, 2), (0, 2, 3)]))
    place.add("ridges", merge(ridges), _GREY)
    lamp = light_row((0.0, 0.3, 1.5), (0, 0, -3.0), (0, 1.2, 0), (8.0, 8.0, 8.0))
    view = {"origin": (0.0, 9.0, 0.0), "target": (0.0, 0.0, 0.0), "up": (0.0, 0.0, -1.0), "fov_y": 45.0}
    return place.finish(view, [lamp])
