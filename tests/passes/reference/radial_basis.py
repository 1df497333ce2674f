"""From fragments to pixels by radial basis functions in float64 [KJ16 Sec. 3.1.5], and as its text has it."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .pyramids import depths, pixel_width
from .refining import CULLED
from .structs import SURFACE
from .upsampling import MOST_OFF, MOST_TURNED, Case

Array = NDArray[np.float64]
C, CLOSE, LEAST_PIVOT = 2.0, 0.125, 1e-4


@dataclasses.dataclass
class Sample:
    """A fragment beside a pixel: the middle that it was shaded at, in pixels, its width, its light."""

    place: Array
    width: float
    light: Array


class Surface:
    """Which pixels lie on the surface that a pixel sees, and whether that is clear of rounding."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.width = pixel_width(case.view) * np.maximum(depths(case.view, case.g.position), 1e-30)
        self.clear = True

    def same(self, pixel: int, other: int, width: float) -> bool:
        """Near its plane, facing its way."""
        g = self.case.g
        off = abs(g.geometric[pixel] @ (g.position[other] - g.position[pixel])) / (
            MOST_OFF * width * self.width[pixel]
        )
        turned = np.linalg.norm(g.normal[other] - g.normal[pixel]) / MOST_TURNED
        self.clear &= bool(min(abs(off - 1), abs(turned - 1)) > 1e-3)
        return bool(g.kind[other] == SURFACE and off < 1 and turned < 1)


def samples_of(surface: Surface, pixel: int, most: int) -> list[Sample]:
    """The fragments nearest to a pixel on its surface: of each neighbour the one at the nearest pixel."""
    case = surface.case
    columns, rows, _, _ = case.levels[0]
    levels = case.level_map.ravel()
    level = int(levels[pixel])
    y, x = divmod(pixel, columns)
    found: list[Sample] = []
    for k in range(9):
        r, c = (y >> level) + k // 3 - 1, (x >> level) + k % 3 - 1
        wide, high, _, _ = case.levels[level]
        if not (0 <= r < high and 0 <= c < wide):
            continue
        last = min((r + 1) << level, rows) - 1, min((c + 1) << level, columns) - 1
        ny, nx = int(np.clip(y, r << level, last[0])), int(np.clip(x, c << level, last[1]))
        own = int(levels[ny * columns + nx])
        if own > case.coarsest or not surface.same(pixel, ny * columns + nx, 2.0**level):
            continue
        across, _, first, _ = case.levels[own]
        at = case.at[first + (ny >> own) * across + (nx >> own)]
        if at in (0, CULLED):
            continue
        middle = (np.array([nx >> own, ny >> own]) + 0.5) * 2**own + (0.5 if own else 0)
        found.append(Sample(middle, 2.0**own, case.light[at - 1]))
    here = np.array([x, y]) + 0.5
    chosen: list[Sample] = []
    while len(chosen) < most:
        left = [s for s in found if all(np.linalg.norm(s.place - t.place) > CLOSE * 2**level for t in chosen)]
        if not left:
            break
        chosen.append(min(left, key=lambda s: float(((s.place - here) ** 2).sum())))  # the first of equals
    return chosen


def _basis(a: Array, b: Array, width: float) -> float:
    return float(np.exp(-((a - b) ** 2).sum() / (C * width**2)))


def _shaded(case: Case) -> list[tuple[int, int, Array, Array]]:
    """Pixel, level, own light and place of all that belong to a fragment."""
    columns = case.levels[0][0]
    out = []
    for pixel in np.flatnonzero(case.level_map.ravel() <= case.coarsest):
        level = int(case.level_map.ravel()[pixel])
        y, x = divmod(int(pixel), columns)
        across, _, first, _ = case.levels[level]
        own = case.light[case.at[first + (y >> level) * across + (x >> level)] - 1]
        out.append((int(pixel), level, own, np.array([x, y]) + 0.5))
    return out


def rbf(case: Case, most: int = 3) -> tuple[Array, NDArray[np.bool_]]:
    """Ordinary kriging of the nearest samples, in their range; and where rounding cannot decide."""
    image, clear = np.zeros((len(case.g.kind), 3)), np.ones(len(case.g.kind), bool)
    for pixel, level, own, here in _shaded(case):
        image[pixel] = own
        if level == 0:
            continue
        surface, width = Surface(case), 2.0**level
        chosen = samples_of(surface, pixel, most)
        phi = np.array([_basis(here, s.place, width) for s in chosen])
        matrix = np.array([[_basis(s.place, t.place, width) for t in chosen] for s in chosen])
        pivots = np.diag(np.linalg.cholesky(matrix)) ** 2
        light = np.stack([s.light for s in chosen])
        if pivots.min() > LEAST_PIVOT:
            n = len(chosen)
            bordered = np.block([[matrix, np.ones((n, 1))], [np.ones((1, n)), np.zeros((1, 1))]])
            weights = np.linalg.solve(bordered, np.append(phi, 1.0))[:n]
        else:
            weights = phi / phi.sum()
        image[pixel] = np.clip(weights @ light, light.min(0), light.max(0))
        clear[pixel] = surface.clear and abs(np.log(pivots.min() / LEAST_PIVOT)) > 0.1
    return image, clear


def rbf_paper(case: Case) -> tuple[Array, NDArray[np.bool_]]:
    """[KJ16 Eqs. 1 to 3] with each sample's own width in its column; levels up to 2 are copied."""
    image, clear = np.zeros((len(case.g.kind), 3)), np.ones(len(case.g.kind), bool)
    for pixel, level, own, here in _shaded(case):
        image[pixel] = own
        if level <= 2:
            continue
        surface = Surface(case)
        chosen = samples_of(surface, pixel, 3)
        clear[pixel] = surface.clear
        phi = np.array([_basis(here, s.place, s.width) for s in chosen])
        light = np.stack([s.light for s in chosen])
        if len(chosen) == 2:
            image[pixel] = phi @ light / phi.sum()
        elif len(chosen) == 3:
            matrix = np.array([[_basis(s.place, t.place, t.width) for t in chosen] for s in chosen])
            volume = abs(np.linalg.det(matrix))
            clear[pixel] &= abs(volume / LEAST_PIVOT - 1) > 0.01
            if volume > LEAST_PIVOT:
                image[pixel] = phi @ np.linalg.solve(matrix, light)
    return image, clear
