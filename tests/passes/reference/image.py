"""Order of work in an image, and the pinhole camera."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .structs import VIEW, record

TILE = 8


def tile_order(width: int, height: int) -> NDArray[np.int64]:
    """(column, row) of every place of the tile order, (n, 2): tiles row by row, pixels row by row in each."""
    across, down = -(-width // TILE), -(-height // TILE)
    columns, rows = np.meshgrid(np.arange(across * TILE), np.arange(down * TILE))
    places = np.stack([columns, rows], axis=-1).reshape(down, TILE, across, TILE, 2)
    ordered: NDArray[np.int64] = places.transpose(0, 2, 1, 3, 4).reshape(-1, 2)
    return ordered


def pixel_numbers(width: int, height: int) -> NDArray[np.int64]:
    """Number of the pixel at every place of the tile order, −1 outside of the image."""
    at = tile_order(width, height)
    inside = (at[:, 0] < width) & (at[:, 1] < height)
    return np.where(inside, at[:, 1] * width + at[:, 0], -1)


def rotation(rng: np.random.Generator) -> NDArray[np.float64]:
    """A random rotation, (3, 3)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    turned: NDArray[np.float64] = q * np.linalg.det(q)
    return turned


def random_view(rng: np.random.Generator, width: int, height: int) -> NDArray[Any]:
    """A camera somewhere, its principal point off the middle, its pixels not square."""
    right, up, backward = rotation(rng)
    tiled = len(tile_order(width, height))
    focal = max(width, height) * rng.uniform(0.6, 1.5, 2)
    middle = np.array([width, height]) * rng.uniform(0.3, 0.7, 2)
    return record(
        VIEW,
        eye=rng.normal(size=3) * 5,
        width=width,
        right=right,
        height=height,
        up=up,
        backward=backward,
        fx=focal[0],
        fy=focal[1],
        cx=middle[0],
        cy=middle[1],
        tiled=tiled,
    )


def view_directions(view: NDArray[Any], at: NDArray[np.int64]) -> NDArray[np.float64]:
    """Directions through the centres of pixels (column, row), whose component along the view is 1.

    x = (column + 1/2 − cx) / fx to the right, y = (row + 1/2 − cy) / fy downwards, looking along −backward.
    """
    v = {name: view[name][0].astype(np.float64) for name in VIEW.names or ()}
    x = (at[:, 0] + 0.5 - v["cx"]) / v["fx"]
    y = (at[:, 1] + 0.5 - v["cy"]) / v["fy"]
    camera_from_pixel = np.stack([x, -y, np.full(len(at), -1.0)], axis=-1)
    scene_from_camera = np.stack([v["right"], v["up"], v["backward"]], axis=-1)
    directions: NDArray[np.float64] = camera_from_pixel @ scene_from_camera.T
    return directions
