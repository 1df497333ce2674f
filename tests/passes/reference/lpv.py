"""Light propagation volumes [KD10], in float64: injection, what faces pass, steps from cell to cell, look-up.

A flow is (3, z, y, x, 4): of each channel and cell the mean over directions and three components of the
net flow, as coefficients of spherical harmonics.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
VOLUME = np.dtype([("corner", "<f4", 3), ("edge", "<f4"), ("size", "<u4", 3), ("cells", "<u4")])
LPV_POINT = np.dtype(
    [
        ("normal", "<f4", 3),
        ("area", "<f4"),
        ("instance", "<u4"),
        ("triangle", "<u4"),
        ("u", "<f4"),
        ("v", "<f4"),
    ]
)
LPV_CELL = np.dtype([("cell", "<u4"), ("first", "<u4"), ("count", "<u4"), ("pad", "<u4")])
INJECT = np.dtype([("side", "<f4", 3), ("most", "<f4")])
PROPAGATE = np.dtype(
    [
        *((n, "<f4") for n in ("mean_of_mean", "mean_of_along", "along_of_mean", "along_of_along", "across")),
        ("most", "<f4"),
        ("reflected", "<f4"),
        ("first", "<u4"),
    ]
)
ENTER = np.dtype(
    [
        ("side", "<f4", 3),
        ("most", "<f4"),
        ("outer", "<u4", 3),
        ("outer_cells", "<u4"),
        ("first", "<u4", 3),
        ("pad", "<u4"),
    ]
)
BLOCKERS = np.dtype([("first", "<u4"), ("pad0", "<u4"), ("pad1", "<u4"), ("pad2", "<u4")])
LOOK_UP = np.dtype([("scale", "<f4"), ("pad0", "<u4"), ("pad1", "<u4"), ("pad2", "<u4")])

AXES = np.concatenate([np.stack([-axis, axis]) for axis in np.eye(3)])
"""Directions of the six faces, in the order of their bits."""
NOWHERE = 2.0
"""Where the way between two middles meets a surface that is not there."""
CLEAR = 1.1
"""How far before a surface light is left and looked up, in half cells as wide as along the normal."""


@dataclasses.dataclass
class Volume:
    """A grid of cubic cells."""

    corner: Array
    edge: float
    size: tuple[int, int, int]

    @property
    def cells(self) -> int:
        """How many."""
        return int(np.prod(self.size))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of arrays with an element a cell: x runs fastest."""
        return self.size[::-1]

    def record(self) -> NDArray[Any]:
        """As shaders see it."""
        made = np.zeros(1, VOLUME)
        made["corner"], made["edge"], made["size"], made["cells"] = (
            self.corner,
            self.edge,
            self.size,
            self.cells,
        )
        return made

    def middles(self) -> Array:
        """(z, y, x, 3)."""
        x, y, z = (np.arange(n) + 0.5 for n in self.size)
        grid = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1)
        return self.corner + grid * self.edge


def basis(w: Array) -> Array:
    """Two bands of real spherical harmonics at unit directions (n, 3), the second along x, y and z."""
    first = np.full((len(w), 1), np.sqrt(1 / (4 * np.pi)))
    return np.concatenate([first, np.sqrt(3 / (4 * np.pi)) * w], axis=1)


def square(middle: Array, u: Array, v: Array) -> tuple[Array, Array]:
    """Directions to points of a square with half-edges u and v, and their solid angles; exact quadrature."""
    x, weight = np.polynomial.legendre.leggauss(48)
    a, b = (g.ravel()[:, None] for g in np.meshgrid(x, x))
    points = middle + a * u + b * v
    far = np.linalg.norm(points, axis=1)
    w = points / far[:, None]
    normal = np.cross(u, v)
    return w, np.outer(weight, weight).ravel() * np.abs(w @ normal) / far**2


def faces_seen(face: int) -> list[tuple[int, Array, Array]]:
    """The other faces of the cell beyond `face`: number, directions from this cell's middle, solid angles."""
    along = AXES[face]
    seen = []
    for other in range(6):
        if other == face ^ 1:
            continue
        u, v = (0.5 * AXES[2 * axis + 1] for axis in range(3) if axis != other // 2)
        seen.append((other, *square(along + 0.5 * AXES[other], u, v)))
    return seen


@functools.cache
def passing(face: int) -> Array:
    """(4, 4): what arrives in the cell beyond `face` of each coefficient of this one, by faces [KD10]."""
    whole = np.zeros((4, 4))
    for other, w, angle in faces_seen(face):
        whole += np.outer(clamped_cosine(AXES[other]), angle @ basis(w))
    return whole


def directions() -> Array:
    """(24, 3): the middles of a cube's faces cut in four, by angle."""
    b = np.tan(np.pi / 8)
    made = [
        np.roll([s, t * b, u * b], axis)
        for axis in range(3)
        for s, t, u in itertools.product((-1, 1), (-1, 1), (-1, 1))
    ]
    found = np.array(made)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


POWERS = np.array([0.0, 1, 4, 16])
"""Of (1 + cos) / 2: lobes whose mean cosines are power / (power + 2)."""


def lobe(net: Array, cos: Array) -> Array:
    """Mixture of the two lobes of `POWERS` whose means are about `net`; its mean over all directions is 1."""
    means = POWERS / (POWERS + 2)
    parts = np.stack([np.interp(net, means, np.eye(4)[i]) for i in range(4)], axis=-1)
    held: Array = (parts * (POWERS + 1) * ((1 + cos[..., None]) / 2) ** POWERS).sum(axis=-1)
    return held


def leaving(flow: Array, transport: str, side: Array | None = None) -> Array:
    """(6, 3, z, y, x, 4): what leaves each cell through each of its faces.

    Lobes leave in 24 directions, none behind `side`; the flux in one goes through the faces ahead of it in
    the shares of its components. The net flow that 24 directions lack goes with each face's share.
    """
    if transport == "faces":
        return np.stack([flow @ passing(face).T for face in range(6)])
    w = directions()
    w = w if side is None else w[w @ side >= 0]
    mean, net = flow[..., 0], flow[..., 1:]
    share = np.linalg.norm(net, axis=-1) / np.sqrt(3) / np.maximum(mean, 1e-300)
    towards = net / np.maximum(np.linalg.norm(net, axis=-1), 1e-300)[..., None]
    each = lobe(share[..., None], towards @ w.T)
    each *= (mean / each.sum(axis=-1))[..., None]
    lack = net - np.sqrt(3) * each @ w
    made = []
    for face in range(6):
        through = each * np.maximum(w @ AXES[face], 0) / np.abs(w).sum(axis=1)
        flux_out = through.sum(axis=-1)
        part = (flux_out / np.maximum(mean, 1e-300))[..., None]
        made.append(np.concatenate([flux_out[..., None], np.sqrt(3) * through @ w + part * lack], axis=-1))
    return np.stack(made)


def clamped_cosine(normal: Array) -> Array:
    """A flux of 1 about a normal: intensity max(0, cos) / pi, by quadrature."""
    x, weight = np.polynomial.legendre.leggauss(16)
    phi = 2 * np.pi * (np.arange(16) + 0.5) / 16
    cos, share = np.repeat((x + 1) / 2, 16), np.repeat(weight * (x + 1) / 2, 16) / 16
    phi = np.tile(phi, 16)
    u = np.cross(normal, [0.577, 0.211, 0.789])
    u /= np.linalg.norm(u)
    sin = np.sqrt(1 - cos**2)
    around = np.cos(phi)[:, None] * u + np.sin(phi)[:, None] * np.cross(normal, u)
    mean: Array = share @ basis(sin[:, None] * around + cos[:, None] * normal)
    return mean


def coefficients() -> dict[str, float]:
    """What the shader has of `passing`."""
    up = passing(1)
    return {
        "mean_of_mean": up[0, 0],
        "mean_of_along": up[0, 1],
        "along_of_mean": up[1, 0],
        "along_of_along": up[1, 1],
        "across": up[2, 2],
    }


def flux(flow: Array) -> Array:
    """All that leaves each cell: the integral over all directions."""
    return flow[..., 0] * np.sqrt(4 * np.pi)


def limited(flow: Array, most: float) -> Array:
    """Net flow over all light of a cell, in units of a beam's, cut at `most`."""
    all_light = np.maximum(flux(flow), 0)
    net = np.linalg.norm(flow[..., 1:], axis=-1) * np.sqrt(4 * np.pi / 3)
    scale = np.where(net > most * all_light, most * all_light / np.maximum(net, 1e-300), 1)
    return np.concatenate([flow[..., :1], flow[..., 1:] * scale[..., None]], axis=-1)


def shifted(values: Array, face: int) -> Array:
    """Of each cell what the one beyond its face `face` has; zero outside. Cells on axes 1 to 3, x last."""
    axis = 3 - face // 2
    moved = np.zeros_like(values)
    to = [slice(None)] * values.ndim
    of = [slice(None)] * values.ndim
    to[axis], of[axis] = (slice(None, -1), slice(1, None)) if face % 2 else (slice(1, None), slice(None, -1))
    moved[tuple(to)] = values[tuple(of)]
    return moved


def step(
    flow: Array,
    open_faces: NDArray[np.uint32],
    transport: str,
    most: float = 1.0,
    reflected: float = 0.0,
    side: Array | None = None,
) -> tuple[Array, Array]:
    """One step of light: the flow after it, and (6, 3, z, y, x) the means that left."""
    after = np.zeros_like(flow)
    out = leaving(flow, transport, side)
    for face in range(6):
        is_open = (open_faces >> face & 1).astype(bool)[None, ..., None]
        through = shifted(out[face ^ 1], face)
        back = out[face][..., :1] * np.sqrt(4 * np.pi)
        after += np.where(is_open, through, reflected * back * clamped_cosine(AXES[face ^ 1]))
    return limited(after, most), out[..., 0]


def no_walls(volume: Volume) -> NDArray[np.uint32]:
    """Masks of open faces where nothing is but the volume's end."""
    return between(volume, np.zeros(volume.shape, int))


def between(volume: Volume, rooms: NDArray[np.int_]) -> NDArray[np.uint32]:
    """Masks of open faces where cells of different numbers are apart."""
    mask = np.zeros(volume.shape, np.uint32)
    for face in range(6):
        beyond = shifted(rooms[None] + 1.0, face)[0]
        mask |= (beyond == rooms + 1).astype(np.uint32) << face
    return mask


def inject(
    volume: Volume,
    cell: NDArray[Any],
    normals: Array,
    areas: Array,
    radiosity: Array,
    shared: bool,
    most: float,
    side: Array | None = None,
) -> Array:
    """What points leave in their cells: all, or of those that face `side` the square of that cosine."""
    part = np.ones(len(normals)) if side is None else np.maximum(normals @ side, 0) ** 2
    flow = np.zeros((3, volume.cells, 4))
    for c in np.unique(cell):
        mine = np.flatnonzero(cell == c)
        each = np.full(len(mine), volume.edge**2 / len(mine)) if shared else areas[mine]
        for p, area in zip(mine, each, strict=True):
            flow[:, c] += np.outer(part[p] * radiosity[p] * area, clamped_cosine(normals[p]))
    return limited(flow, most).reshape(3, *volume.shape, 4)


def enter(flow: Array, first: Array, passed: Array, met: Array, most: float, side: Array | None) -> Array:
    """`flow` of a volume inside, and what left the cells outside through its border, a fourth in each.

    `passed` (6, 3, z, y, x) and `met` are of the volume outside. Nothing from behind a surface that lies
    between a cell's middle and the border; only what flies towards `side`, if there is one.
    """
    size, outer = np.array(flow.shape[3:0:-1]), np.array(met.shape[:0:-1])
    entered = np.zeros_like(flow)
    for face, outwards in enumerate(AXES.astype(int)):
        axis = face // 2
        if side is not None and side @ outwards >= 0:
            continue
        for at in np.ndindex(*size):
            within = first + np.array(at) // 2
            beyond = within + outwards
            if at[axis] != (0, size[axis] - 1)[face % 2] or not 0 <= beyond[axis] < outer[axis]:
                continue
            surface = met[(axis, *np.minimum(within, beyond)[::-1])]
            if surface != NOWHERE and (surface if face % 2 == 0 else 1 - surface) < 0.5:
                continue
            mean = passed[(face ^ 1, slice(None), *beyond[::-1])] / 4
            lobe = np.sqrt(4 * np.pi) * clamped_cosine(AXES[face ^ 1])
            entered[(slice(None), *at[::-1])] += np.outer(mean, lobe)
    lit = entered[..., :1] > 0
    return np.where(lit, limited(flow + entered, most), flow)


def falling(normal: Array, passed: Array) -> Array:
    """Of means (6, ...) that left through faces, what falls on a surface of unit area and that normal.

    The net flow along the normal is what falls on its two sides apart; together they get what the sides of
    faces do, weighted by the squares of the normal. At least what falls against it by those squares, at
    most all.
    """
    against = [2 * axis + (normal[axis] < 0) for axis in range(3)]
    ways = np.stack([passed[face] for face in against], axis=-1).clip(0)
    back = np.stack([passed[face ^ 1] for face in against], axis=-1)
    front = np.stack([passed[face] for face in against], axis=-1)
    square, straight = normal**2, np.abs(normal)
    sides = (front - back) @ straight + (front + back) @ square
    held: Array = np.clip(0.5 * sides, ways @ square, ways @ straight)
    return held * np.sqrt(4 * np.pi)


def masks(volume: Volume, met: Array) -> NDArray[np.uint32]:
    """Masks of open faces; `met` (3, z, y, x) says where the way through each upper face meets a surface."""
    open_faces = np.zeros(volume.shape, np.uint32)
    for axis in range(3):
        free = met[axis] == NOWHERE
        free[(slice(None),) * (2 - axis) + (-1,)] = False
        open_faces |= free.astype(np.uint32) << (2 * axis + 1)
        open_faces |= shifted(free[None].astype(np.uint32), 2 * axis)[0] << (2 * axis)
    return open_faces


def surfaces(volume: Volume, rooms: NDArray[np.int_], where: float = 0.5) -> Array:
    """Surfaces between cells of different numbers, at `where` of the way from the lower one's middle."""
    met = np.full((3, *volume.shape), NOWHERE)
    for axis in range(3):
        beyond = shifted(rooms[None] + 1.0, 2 * axis + 1)[0]
        met[axis][(beyond != rooms + 1) & (beyond != 0)] = where
    return met


def own_cell(volume: Volume, place: Array, met: Array) -> NDArray[np.int_]:
    """The cell at a place, or beside it where a surface is between the place and the cell's middle."""
    own = np.floor(place).astype(int)
    for axis in range(3):
        side = 1 if place[axis] > own[axis] + 0.5 else -1
        if not 0 <= own[axis] + side < volume.size[axis]:
            continue
        lower = own.copy()
        lower[axis] += min(side, 0)
        surface = met[(axis, *lower[::-1])]
        beyond = side * (place[axis] - (lower[axis] + 0.5 + surface)) > 0
        if surface != NOWHERE and beyond:
            own[axis] += side
    return own


def look_up(
    volume: Volume, passed: Array, met: Array, origin: Array, normal_geo: Array, normal_shade: Array
) -> Array:
    """Irradiance at one point, of (6, 3, z, y, x) means that left through faces, over a face's area."""
    before = CLEAR * np.abs(normal_geo).sum() / 2
    place = (origin - volume.corner) / volume.edge + before * normal_geo
    place = np.clip(place, 0, np.array(volume.size) - 1e-3)
    own = own_cell(volume, place, met)
    mask = int(masks(volume, met)[tuple(own[::-1])])
    away = place - (own + 0.5)
    sides = np.where(away > 0, 1, -1)
    far = np.minimum(np.abs(away), 0.5)
    sums, shares = np.zeros((6, 3)), 0.0
    for corner in np.ndindex(2, 2, 2):
        at = own + sides * corner
        closed = [c and not mask >> (2 * axis + (sides[axis] > 0)) & 1 for axis, c in enumerate(corner)]
        if any(closed):
            continue
        middle = volume.corner + (at + 0.5) * volume.edge
        share = np.prod(np.where(corner, far, 1 - far))
        least = 0.0 if any(corner) else 0.05
        share *= np.clip(2 * (middle - origin) @ normal_geo / volume.edge, least, 1)
        if share > 0:
            sums += share * passed[:, :, at[2], at[1], at[0]]
            shares += share
    irradiance: Array = falling(normal_shade, sums) / volume.edge**2 / max(shares, 1e-6)
    return irradiance
