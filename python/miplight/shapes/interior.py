"""A room full of things: about a hundred thousand triangles that hide one another from the window's light."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.random import Generator
from numpy.typing import NDArray

from miplight.validate import as_count

from .primitives import box, grid_faces, lathe, merge, mesh, quad, tube
from .rooms import Place, light_row, place_at
from .sphere import displaced_sphere
from .thin import slats

__all__ = ["cluttered_interior"]

WIDTH, HEIGHT, DEPTH = 5.0, 2.8, 4.4


def cluttered_interior(triangles: int = 100_000, seed: int = 0) -> trimesh.Scene:
    """Study: a window behind a blind, a table laid for four, shelves of books, plants and things about.

    Parameters
    ----------
    triangles : int, default 100,000
        75,000 or more, met within 1 %; the rock on its stand takes what the rest leaves.
    seed : int, default 0
        Where the small things lie, and their sizes and colours.

    Returns
    -------
    trimesh.Scene
        Y is up, metres; the floor is at y = 0 and centred on x = z = 0. ``metadata["view"]`` looks into
        the room from its open side; ``metadata["lights"]`` are the window and a lamp above the table.
    """
    budget = as_count(triangles, "triangles", at_least=75_000)
    random = np.random.default_rng(as_count(seed, "seed", at_least=0))
    place = Place()
    _add_shell(place)
    _add_table(place)
    _add_shelves(place, random)
    _add_plants(place, random)
    _add_floor_things(place, random)
    scene = place.scene
    rest = sum(len(scene.geometry[scene.graph[node][1]].faces) for node in scene.graph.nodes_geometry)
    stand = lathe(
        [(0.0, 0.0), (0.2, 0.0), (0.2, 0.0), (0.2, 0.04), (0.05, 0.1), (0.04, 0.6), (0.14, 0.7)], 24
    )
    place.add("stand", stand, (0.25, 0.17, 0.1), place_at(-1.9, 0, 0.9))
    rock = displaced_sphere(max(20, budget - rest - len(stand.faces)), radius=0.26, amplitude=0.6, seed=7)
    place.add("rock", rock, (0.55, 0.5, 0.45), place_at(-1.9, 0.94, 0.9))
    window = light_row((WIDTH / 2 + 0.25, 0.85, -1.2), (0, 0, 2.4), (0, 1.5, 0), (16.0, 17.0, 19.0))
    lamp = light_row((-0.12, 2.02, -0.22), (0.24, 0, 0), (0, 0, 0.24), (28.0, 20.0, 11.0))
    view = {"origin": (-0.9, 1.5, 4.3), "target": (0.1, 0.95, -0.4), "fov_y": 48.0}
    return place.finish(view, [window, lamp])


def _add_shell(place: Place) -> None:
    """Floor boards, walls with a window opening, ceiling, blind, skirting, pictures."""
    w, h, d = WIDTH, HEIGHT, DEPTH
    boards = [
        box((0.138, 0.02, d), (-w / 2 + 0.07 + 0.14 * k, -0.01 - 0.001 * (k % 3), 0))
        for k in range(round(w / 0.14))
    ]
    place.add("boards", merge(boards), (0.42, 0.27, 0.15))
    place.add("ceiling", quad((-w / 2, h, -d / 2), (w, 0, 0), (0, 0, d)), (0.8, 0.8, 0.78))
    place.add("back", quad((-w / 2, 0, -d / 2), (w, 0, 0), (0, h, 0)), (0.72, 0.68, 0.58))
    place.add("left", quad((-w / 2, 0, d / 2), (0, 0, -d), (0, h, 0)), (0.36, 0.48, 0.5))
    x, t = w / 2, 0.16  # the wall with the window, in four boxes around the opening
    frame = [
        box((t, 0.8, d), (x + t / 2, 0.4, 0)),
        box((t, h - 2.4, d), (x + t / 2, (h + 2.4) / 2, 0)),
        box((t, 1.6, d / 2 - 1.3), (x + t / 2, 1.6, -(d / 2 + 1.3) / 2)),
        box((t, 1.6, d / 2 - 1.3), (x + t / 2, 1.6, (d / 2 + 1.3) / 2)),
    ]
    place.add("right", merge(frame), (0.72, 0.68, 0.58))
    bars = [box((0.05, 1.6, 0.05), (x + 0.1, 1.6, z)) for z in (-0.43, 0.43)]
    bars += [box((0.05, 0.05, 2.6), (x + 0.1, y, 0)) for y in (1.33, 1.87)]
    place.add("bars", merge(bars), (0.7, 0.7, 0.7))
    place.add("blind", slats(22, 2.5, 0.05, 0.05, 25.0), (0.75, 0.7, 0.55), place_at(x - 0.05, 1.3, 0, 90.0))
    skirting = [box((w, 0.1, 0.02), (0, 0.05, -d / 2 + 0.01)), box((0.02, 0.1, d), (-w / 2 + 0.01, 0.05, 0))]
    place.add("skirting", merge(skirting), (0.75, 0.75, 0.72))
    frames = [box((0.5, 0.66, 0.03), (0.9 + 0.62 * k, 1.75, -d / 2 + 0.02)) for k in range(2)]
    place.add("frames", merge(frames), (0.12, 0.09, 0.06))
    inside = [quad((0.7 + 0.62 * k, 1.47, -d / 2 + 0.037), (0.4, 0, 0), (0, 0.56, 0)) for k in range(2)]
    place.add("pictures", merge(inside), (0.7, 0.55, 0.35))


def _add_table(place: Place) -> None:
    """Table, four chairs, cups, bowls, a lamp shade on its wire."""
    wood = (0.45, 0.28, 0.15)
    leg = lathe(
        [
            (0.0, 0.0),
            (0.025, 0.0),
            (0.04, 0.06),
            (0.03, 0.12),
            (0.045, 0.3),
            (0.03, 0.5),
            (0.05, 0.6),
            (0.05, 0.7),
        ],
        20,
    )
    legs = [_moved(leg, x, 0, z) for x in (-0.75, 0.75) for z in (-0.4, 0.4)]
    place.add("table", merge([box((1.8, 0.04, 1.0), (0, 0.72, 0)), *legs]), wood, place_at(0, 0, -0.1))
    seat = [box((0.42, 0.03, 0.42), (0, 0.45, 0))]
    seat += [
        tube([(x, 0, z), (x * 0.9, 0.44, z * 0.9)], 0.016, 10) for x in (-0.19, 0.19) for z in (-0.19, 0.19)
    ]
    seat += [
        tube([(x, 0.45, -0.19), (x, 0.8, -0.24), (x, 0.92, -0.28)], 0.012, 8)
        for x in np.linspace(-0.18, 0.18, 7)
    ]
    seat += [box((0.44, 0.06, 0.03), (0, 0.93, -0.285))]
    turns = [(-0.5, 0.62, 175.0), (0.45, 0.7, 190.0), (-0.45, -0.85, 5.0), (0.5, -0.8, -20.0)]
    place.add("chair", merge(seat), (0.5, 0.2, 0.12), [place_at(x, 0, z, turn) for x, z, turn in turns])
    cup = lathe(
        [(0.0, 0.0), (0.03, 0.0), (0.042, 0.03), (0.045, 0.09), (0.041, 0.088), (0.036, 0.03), (0.0, 0.01)],
        28,
    )
    cups = [
        place_at(x, 0.74, z, 0, 1.1) for x, z in ((-0.5, 0.25), (0.45, 0.22), (-0.4, -0.42), (0.55, -0.4))
    ]
    place.add("cup", cup, (0.75, 0.75, 0.72), cups)
    t = np.linspace(0, 1, 18)
    outside = np.stack([0.05 + 0.12 * np.sqrt(t), 0.1 * t**1.5], axis=-1)
    bowl = lathe([(0.0, 0.0), *outside, *(outside[::-1] - (0.008, -0.006)), (0.0, 0.006)], 40)
    place.add("bowl", bowl, (0.2, 0.3, 0.42), place_at(0.0, 0.74, -0.1))
    ring = [(0.0, 0.09, 0.0)]
    ring += [(0.07 * np.cos(a), 0.055, 0.07 * np.sin(a)) for a in np.arange(5) * 2 * np.pi / 5]
    fruit = [_moved(displaced_sphere(500, 0.037, 0.1, k), *p) for k, p in enumerate(ring)]
    place.add("fruit", merge(fruit), (0.6, 0.22, 0.06), place_at(0.0, 0.76, -0.1))
    plate = lathe([(0.0, 0.0), (0.08, 0.0), (0.13, 0.018), (0.128, 0.021), (0.08, 0.005), (0.0, 0.005)], 48)
    plates = [place_at(x, 0.741, z) for x, z in ((-0.62, 0.1), (0.6, 0.05), (-0.25, -0.35), (0.28, 0.2))]
    place.add("plate", plate, (0.78, 0.77, 0.74), plates)
    shade = lathe(
        [(0.08, 2.3), (0.10, 2.27), (0.26, 2.04), (0.255, 2.04), (0.095, 2.268), (0.075, 2.298)], 64
    )
    wire = tube([(0, 2.3, 0), (0, HEIGHT, 0)], 0.006, 8)
    place.add("shade", merge([shade, wire]), (0.6, 0.12, 0.08), place_at(0, 0, -0.1))


def _add_shelves(place: Place, random: Generator) -> None:
    """Shelves against the back wall, filled with books in six colours, some of them leaning."""
    left, width, base = -2.3, 2.4, -DEPTH / 2 + 0.16
    levels = [0.08 + 0.42 * k for k in range(6)]
    boards = [box((width, 0.025, 0.3), (left + width / 2, y, base)) for y in levels]
    boards += [box((0.025, 2.2, 0.3), (left + width * part, 1.1, base)) for part in (0, 0.5, 1)]
    place.add("shelves", merge(boards), (0.3, 0.18, 0.1))
    colors = [
        (0.5, 0.1, 0.08),
        (0.1, 0.2, 0.4),
        (0.12, 0.3, 0.15),
        (0.55, 0.45, 0.2),
        (0.35, 0.3, 0.28),
        (0.6, 0.55, 0.45),
    ]
    books: list[list[trimesh.Trimesh]] = [[] for _ in colors]
    for y in levels[:-1]:
        for start in (left + 0.03, left + width / 2 + 0.03):
            x, end = start, start + width / 2 - 0.08
            while x < end - 0.06:
                thick, high, deep = (
                    random.uniform(0.015, 0.045),
                    random.uniform(0.2, 0.36),
                    random.uniform(0.16, 0.24),
                )
                lean = random.uniform(4, 12) if random.uniform() < 0.08 else 0.0
                book = _book(thick, high, deep, lean)
                x += 0.002 + thick + high * np.sin(np.radians(lean))
                books[random.integers(len(colors))].append(
                    _moved(book, x - thick, y + 0.0135, base - 0.13 + deep / 2)
                )
                x += 0.15 if random.uniform() < 0.04 else 0.0
    for k, (part, color) in enumerate(zip(books, colors, strict=True)):
        place.add(f"books_{k}", merge(part), color)


def _book(thick: float, high: float, deep: float, lean: float) -> trimesh.Trimesh:
    """Cover of three boards around a block of pages that stands back: 48 triangles."""
    parts = [box((0.002, high, deep), (side * thick / 2, high / 2, 0)) for side in (-1, 1)]
    parts += [
        box((thick, high, 0.002), (0, high / 2, deep / 2)),
        box((thick - 0.004, high - 0.008, deep - 0.006), (0, high / 2, 0)),
    ]
    book = merge(parts)
    c, s = np.cos(np.radians(lean)), np.sin(np.radians(lean))
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return mesh(book.vertices @ turn.T, book.faces, book.visual.uv)


def _add_plants(place: Place, random: Generator) -> None:
    """Two pots with arching leaves, and a hanging one."""
    pot = lathe(
        [
            (0.0, 0.0),
            (0.12, 0.0),
            (0.12, 0.0),
            (0.17, 0.28),
            (0.19, 0.28),
            (0.19, 0.33),
            (0.165, 0.33),
            (0.15, 0.27),
            (0.0, 0.27),
        ],
        40,
    )
    spots = [place_at(2.1, 0, -1.75), place_at(-2.1, 0, 1.7, 0, 0.8)]
    place.add("pot", pot, (0.55, 0.3, 0.18), spots)
    leaves = [_leaf(random, reach=random.uniform(0.3, 0.75)) for _ in range(70)]
    place.add("leaves", merge(leaves), (0.12, 0.32, 0.08), [m @ place_at(0, 0.27, 0) for m in spots])


def _leaf(random: Generator, reach: float) -> trimesh.Trimesh:
    """Curved blade without thickness that rises from the origin and bends over: 96 triangles."""
    t, across = np.meshgrid(np.linspace(0, 1, 13), np.linspace(-1, 1, 5), indexing="ij")
    wide = 0.045 * np.sin(np.pi * np.clip(t, 0.02, 1)) ** 0.7 + 0.002
    out, up = reach * t**1.6, reach * (1.6 * t - random.uniform(0.6, 1.3) * t**2.4)
    x, y, z = out, up + 0.25 * wide * across**2 * 2, wide * across
    turn = random.uniform(0, 2 * np.pi)
    c, s = np.cos(turn), np.sin(turn)
    points = np.stack([c * x + s * z, y, -s * x + c * z], axis=-1)
    return mesh(points.reshape(-1, 3), grid_faces(13, 5))


def _add_floor_things(place: Place, random: Generator) -> None:
    """Wavy rug, a basket of woven hoops, a heap of bricks, balls, a chest."""
    u, v = np.meshgrid(np.linspace(-1, 1, 71), np.linspace(-1, 1, 51), indexing="ij")
    wave = 0.012 + 0.006 * np.sin(9 * u + 3 * v) * np.sin(7 * v) + 0.02 * np.clip(u * v - 0.75, 0, 1)
    rug = np.stack([v * 0.9, wave, u * 1.3], axis=-1).reshape(-1, 3)
    place.add("rug", mesh(rug, grid_faces(71, 51)), (0.5, 0.14, 0.12), place_at(0.2, 0, 0.5, 80.0))
    hoops = [_hoop(0.2 + 0.05 * np.sin(2.2 * t), 0.02 + 0.33 * t) for t in np.linspace(0, 1, 18)]
    place.add("basket", merge(hoops), (0.55, 0.4, 0.2), place_at(1.7, 0, 1.1))
    bricks = []
    for k in range(60):
        x, z = random.normal(0, 0.22, 2)
        size = random.choice([0.03, 0.04, 0.06], 3)
        turned = box(size).apply_transform(
            place_at(x, size[1] / 2 + 0.03 * (k % 3) * (k > 30), z, random.uniform(0, 90))
        )
        bricks.append(mesh(turned.vertices, turned.faces))
    place.add("bricks", merge(bricks), (0.6, 0.5, 0.1), place_at(0.9, 0.03, 1.25))
    spots = random.uniform((-1.6, 0.9), (0.4, 1.8), (7, 2))
    balls = [place_at(x, 0.06, z, scale=0.06) for x, z in spots]
    place.add("ball", displaced_sphere(1280, 1.0, 0.0), (0.15, 0.25, 0.5), balls)
    chest = [box((0.9, 0.34, 0.45), (0, 0.17, 0))]
    chest += [box((0.94, 0.015, 0.012), (0, y, 0.231)) for y in np.linspace(0.03, 0.31, 6)]
    lid = np.linspace(0, np.pi, 17)
    arc = np.stack([np.zeros(17), 0.34 + 0.16 * np.sin(lid), -0.225 * np.cos(lid)], axis=-1)
    half = np.array([0.45, 0.0, 0.0])
    chest.append(mesh(np.vstack([arc - half, arc + half]), grid_faces(2, 17)[:, ::-1]))
    place.add(
        "chest",
        merge([mesh(part.vertices, part.faces) for part in chest]),
        (0.35, 0.2, 0.1),
        place_at(1.85, 0, 0.1, -80),
    )


def _hoop(radius: float, height: float) -> trimesh.Trimesh:
    angle = np.linspace(0, 2 * np.pi, 73)
    path = np.stack(
        [radius * np.cos(angle), height + 0.008 * np.sin(18 * angle), radius * np.sin(angle)], axis=-1
    )
    return tube(path, 0.009, 6)


def _moved(part: trimesh.Trimesh, x: float, y: float, z: float) -> trimesh.Trimesh:
    offset: NDArray[np.float64] = np.array([x, y, z], dtype=np.float64)
    return mesh(part.vertices + offset, part.faces, getattr(part.visual, "uv", None))
