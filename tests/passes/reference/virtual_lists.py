"""Lists of fragments of virtual lights in float64: what surfaces reflect of each, and where it is split."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gbuffers import GBuffer, wavy_gbuffer
from .image import random_view
from .nodes import middle_pixel
from .pyramids import sizes
from .refining import LIT, ROUGH_DEPTH, texel_states
from .structs import SHADED_POINT, SURFACE, VIRTUAL_LIGHT

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
FAR = 3.0e38


@dataclasses.dataclass
class Case:
    """A bumpy surface with lobes, seen by a camera, and virtual lights before it."""

    view: NDArray[Any]
    g: GBuffer
    lobes: Array  # a row an instance: reflectance, exponent
    instance: NDArray[np.int64]
    lights: NDArray[Any]
    states: list[NDArray[np.int64]]
    coarsest: int
    disc: bool
    reach: float = FAR

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the image."""
        return int(self.view["width"][0]), int(self.view["height"][0])

    @property
    def state(self) -> NDArray[np.uint32]:
        """Of all texels."""
        return np.concatenate([state.ravel() for state in self.states]).astype(np.uint32)

    def middles(self, level: int) -> NDArray[np.int64]:
        """Pixel that stands for each texel of a level; of one that sees nothing its first."""
        width, height = self.size
        numbers, side = np.arange(width * height).reshape(height, width), 2**level
        found = np.zeros(self.states[level].shape, np.int64)
        for row, column in np.ndindex(found.shape):
            block = numbers[row * side : (row + 1) * side, column * side : (column + 1) * side].ravel()
            lit = self.states[level][row, column] & LIT
            found[row, column] = middle_pixel(self.view, self.g, block) if lit else block[0]
        return found

    def surface(self, pixels: NDArray[np.int64]) -> Array:
        """Reflectance and exponent of the lobes there."""
        found: Array = self.lobes[self.instance[pixels]]
        return found

    def mirror(self, pixels: NDArray[np.int64]) -> Array:
        """Middle of the lobe."""
        along = self.g.origin[pixels] - self.view["eye"][0].astype(np.float64)
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        normal = self.g.normal[pixels]
        turned: Array = along - 2 * (along * normal).sum(-1, keepdims=True) * normal
        return turned

    def shares(self, pixels: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """Irradiance a unit of flux, the lobe times it, and the same without cosines; (…, lights)."""
        origin, surface = self.g.origin[pixels], self.surface(pixels)
        d = self.lights["position"].astype(np.float64) - origin[..., None, :]
        far = np.linalg.norm(d, axis=-1)
        w = d / far[..., None]
        shade = (w * self.g.normal[pixels][..., None, :]).sum(-1)
        across = (w * self.g.geometric[pixels][..., None, :]).sum(-1)
        leaves = -(w * self.lights["normal"].astype(np.float64)).sum(-1)
        lit = (shade > 0) & (across > 0) & (leaves > 0) & (far < self.reach)
        lit &= (self.g.kind[pixels] == SURFACE)[..., None]
        bare = 1 / (np.pi * far**2 + self.lights["area"] * self.disc)
        share = np.where(lit, shade * leaves * bare, 0)
        cosine, n = (w * self.mirror(pixels)[..., None, :]).sum(-1), surface[..., 3:]
        power = np.where(cosine > 0, np.maximum(cosine, 1e-30) ** n, 0)
        return share, share * power * (n + 2) / (2 * np.pi), bare

    def light(self, pixels: NDArray[np.int64]) -> tuple[Array, Array]:
        """Irradiance and radiance of the lobe of each virtual light; (…, lights, 3)."""
        flux = self.lights["flux"].astype(np.float64)
        share, lobe, _ = self.shares(pixels)
        return share[..., None] * flux, lobe[..., None] * flux * self.surface(pixels)[..., None, :3]

    def bounds(self, pixels: NDArray[np.int64]) -> tuple[Array, Array]:
        """What rounding may do to the two, (…, 3): all virtual lights together."""
        flux = self.lights["flux"].astype(np.float64)
        share, lobe, bare = self.shares(pixels)
        n = self.surface(pixels)[..., 3:]
        count = len(self.lights)
        irradiance = ((4e-6 * bare + (count + 20) * 6e-8 * share)[..., None] * flux).sum(-2)
        sharp = 4e-6 * (n + 4) * (n + 2) / (2 * np.pi) * bare + (count + 20) * 6e-8 * lobe
        return irradiance, (sharp[..., None] * flux).sum(-2) * self.surface(pixels)[..., :3]

    def points(self) -> NDArray[Any]:
        """Shading points of the texels from level 1 on, as the device holds them."""
        rows = []
        for level in range(1, self.coarsest + 1):
            pixels = self.middles(level).ravel()
            found = np.zeros(len(pixels), SHADED_POINT)
            for name, values in (
                ("origin", self.g.origin),
                ("normal_shade", self.g.normal),
                ("normal_geo", self.g.geometric),
            ):
                found[name] = values[pixels]
            found["mirror"] = self.mirror(pixels)
            for column, name in enumerate(("red", "green", "blue", "exponent")):
                found[name] = self.surface(pixels)[:, column]
            found[(self.states[level].ravel() & LIT) == 0] = 0
            rows.append(found)
        return np.concatenate(rows)

    def short_lights(self, limit: float) -> NDArray[np.float32]:
        """Three rows a virtual light, with the difference that each may have."""
        rows = self.lights.view(np.float32).reshape(-1, 4, 4)[:, :3].copy()
        rows[:, 2, 3] = limit
        return rows.reshape(-1, 4)


def random_case(
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int,
    count: int = 40,
    *,
    disc: bool = True,
    rough: float = 0.1,
    holes: float = 0.0,
) -> Case:
    """Virtual lights between the eye and the surface; some of the texels are rough."""
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=holes)
    v = {name: view[name][0].astype(np.float64) for name in ("eye", "right", "up", "backward")}
    lights = np.zeros(count, VIRTUAL_LIGHT)
    aside = rng.uniform(-1, 1, (count, 2))
    depth = rng.uniform(-1, 1.5, count)
    place = v["eye"] + aside[:, :1] * v["right"] + aside[:, 1:] * v["up"] - depth[:, None] * v["backward"]
    normal = -v["backward"] + 0.4 * rng.normal(size=(count, 3))
    lights["position"], lights["area"] = place, rng.uniform(0.01, 0.3, count)
    lights["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    lights["flux"] = rng.lognormal(0, 1, (count, 3))
    lobes = np.array([[0.3, 0.2, 0.4, 8], [0, 0, 0, 0], [0.5, 0.6, 0.4, 40]], np.float32).astype(np.float64)
    texels = sum(row[3] for row in sizes(*size)[1 : coarsest + 1])
    bits = ROUGH_DEPTH * (rng.uniform(size=texels) < rough)
    states = texel_states(view, g, np.where(g.kind == SURFACE, LIT, 0), bits, coarsest)
    return Case(view, g, lobes, rng.integers(0, 3, len(g.kind)), lights, states, coarsest, disc)


@dataclasses.dataclass
class Lists:
    """What is left for the texels of the lowest level, and what the others hold; images a level."""

    left: Flags
    irradiance: dict[int, Array]
    radiance: dict[int, Array]
    bounds: dict[int, tuple[Array, Array]]
    evaluations: int
    finest: NDArray[np.int64]
    """Level of the finest fragment of any virtual light at each pixel."""


def change(case: Case, level: int) -> Array:
    """Largest difference of what is reflected, middle to children, (rows, columns, lights)."""

    def looks(pixels: NDArray[np.int64]) -> Array:
        irradiance, radiance = case.light(pixels)
        return np.stack([irradiance.mean(-1), np.pi * radiance.mean(-1)])

    own, below = looks(case.middles(level)), looks(case.middles(level - 1))
    found = np.zeros(own.shape[1:])
    for row, column in np.ndindex(case.states[level - 1].shape):
        if case.states[level - 1][row, column] & LIT:
            at = row // 2, column // 2
            apart = np.abs(below[:, row, column] - own[:, at[0], at[1]]).max(0)
            found[at] = np.maximum(found[at], apart)
    return found


def lists(case: Case, limit: float, lowest: int = 1) -> Lists:
    """Level by level: what differs by more than the limit, or is rough, goes to the children."""
    top = case.states[case.coarsest]
    given = np.repeat(((top & LIT) != 0)[..., None], len(case.lights), axis=-1)
    finest: NDArray[np.int64] = np.full(case.size[::-1], case.coarsest - 1)
    out = Lists(given, {}, {}, {}, 0, finest)
    for level in range(case.coarsest, max(lowest, 2) - 1, -1):
        shape = case.states[level - 1].shape
        rough = ((case.states[level] & ROUGH_DEPTH) != 0)[..., None]
        out.evaluations += 5 * int((given & ~(rough & (level > lowest))).sum())
        splits = (rough | (change(case, level) > limit)) & (level > lowest)

        def spread(flags: Flags, shape: tuple[int, ...] = shape) -> Flags:
            return np.repeat(np.repeat(flags, 2, axis=0), 2, axis=1)[: shape[0], : shape[1]]

        lit = ((case.states[level - 1] & LIT) != 0)[..., None]
        kept = spread(given & ~splits) & lit
        side = 2 ** (level - 1)
        here = np.repeat(np.repeat(kept.any(-1), side, axis=0), side, axis=1)
        finest[here[: case.size[1], : case.size[0]]] = level - 1
        irradiance, radiance = case.light(case.middles(level - 1))
        out.irradiance[level - 1] = (irradiance * kept[..., None]).sum(-2)
        out.radiance[level - 1] = (radiance * kept[..., None]).sum(-2)
        out.bounds[level - 1] = case.bounds(case.middles(level - 1))
        given = spread(given & splits) & lit
    out.left = given
    if lowest == 1:
        rows, columns = np.nonzero(case.states[0] & LIT)
        out.evaluations += int(given[rows // 2, columns // 2].sum())
        some = given[rows // 2, columns // 2].any(-1)
        finest[rows[some], columns[some]] = 0
    return out


def clear_limit(case: Case, share: float) -> float:
    """A limit that about `share` of the differences are below of, as far from any of them as possible."""
    every = [change(case, level).ravel() for level in range(2, case.coarsest + 1)]
    values = np.unique(np.concatenate(every))
    values = values[values > 0]
    middle, reach = int(share * len(values)), max(len(values) // 10, 1)
    near = values[max(middle - reach, 0) : middle + reach]
    widest = int(np.argmax(near[1:] / near[:-1]))
    assert near[widest + 1] / near[widest] > 1 + 1e-4
    return float(np.sqrt(near[widest] * near[widest + 1]))


def interpolated(case: Case, held: dict[int, Array]) -> Array:
    """What the levels hold, at every pixel: between the four children of a texel, or each for its own."""
    width, height = case.size
    total = np.zeros((height, width, 3))
    for level, image in held.items():
        for row, column in np.ndindex(height, width):
            parent = row >> (level + 1), column >> (level + 1)
            four = [(2 * parent[0] + k // 2, 2 * parent[1] + k % 2) for k in range(4)]
            rows, columns = image.shape[:2]
            whole = all(r < rows and c < columns and case.states[level][r, c] & LIT for r, c in four)
            if not whole or case.states[level + 1][parent] & ROUGH_DEPTH:
                total[row, column] += image[row >> level, column >> level]
                continue
            weights = []
            for at, first, length in ((row, four[0][0], height), (column, four[0][1], width)):
                starts = [n << level for n in (first, first + 1)]
                low, high = (s + min(2**level, length - s) // 2 for s in starts)
                weights.append((at - low) / (high - low))
            y, x = weights
            a, b, c, d = (image[at] for at in four)
            mixed = (1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d)
            total[row, column] += np.maximum(mixed, 0)
    return total
