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
LARGE, SLOTS, BIAS, TOP = 3, 32, 4096, 5


@dataclasses.dataclass
class Sample:
    """What a pixel may take light from: where it lies, in pixels, the level of its fragment and its light."""

    place: Array
    level: int
    light: Array


@dataclasses.dataclass
class Extras:
    """Light of the extra samples of each texel from level 3 on, thrice, and which there are.

    (3 n, 3, 3) and (3 n, 3): on upper and left sides, on the image's last column, on its last row.
    """

    light: Array
    there: NDArray[np.bool_]


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


def middle(case: Case, level: int, row: int, column: int) -> Array:
    """Column and row of the pixel in the middle of a texel, as far as that lies in the image."""
    wide, high, _, _ = case.levels[0]
    x, y = column << level, row << level
    return np.array([x + min(1 << level, wide - x) // 2, y + min(1 << level, high - y) // 2], np.float64)


def fragment_at(case: Case, x: int, y: int) -> tuple[int, Sample] | None:
    """The fragment that holds a pixel, and its number, if it is one that is lit."""
    columns = case.levels[0][0]
    level = int(case.level_map.ravel()[y * columns + x])
    if level > case.coarsest:
        return None
    across, _, first, _ = case.levels[level]
    number = int(case.at[first + (y >> level) * across + (x >> level)])
    if number in (0, CULLED):
        return None
    return number, Sample(middle(case, level, y >> level, x >> level), level, case.light[number - 1])


def _around(width: int) -> list[tuple[int, int]]:
    """Places outside of a square, clockwise: from each corner on, and four on the side that follows."""
    steps = [-1, *((2 * k - 1) * width // 8 for k in (1, 2, 3, 4))]
    back = [width - 1 - step for step in steps]
    top, right = [(x, -1) for x in steps], [(width, y) for y in steps]
    return top + right + [(x, width) for x in back] + [(-1, y) for y in back]


def _on_border(width: int, last: tuple[int, int]) -> list[tuple[int, int]]:
    """Places of extra samples: its own three, and those of fragments to the right and below.

    No further than the image's last column and row, each once.
    """
    half, right, below = width // 2, min(width, last[0]), min(width, last[1])
    own = [(half, 0), (0, 0), (0, half)]
    places = [*own, (right, 0), (right, half), (0, below), (half, below), (right, below)]
    return list(dict.fromkeys(places))


def places_of(case: Case, level: int, row: int, column: int) -> dict[tuple[int, int], tuple[int, int]]:
    """Set and number of the extra sample at each pixel, (x, y), of a fragment that has one."""
    columns, rows, _, _ = case.levels[0]
    (x, y), half = (column << level, row << level), 1 << level >> 1
    wanted = [((x + half, y), (0, 0)), ((x, y), (0, 1)), ((x, y + half), (0, 2))]
    right, below = (column + 1) << level >= columns, (row + 1) << level >= rows
    if right and below:
        wanted.append(((columns - 1, rows - 1), (1, 2)))
    if right:
        wanted += [((columns - 1, y), (1, 0)), ((columns - 1, y + half), (1, 1))]
    if below:
        wanted += [((x, rows - 1), (2, 0)), ((x + half, rows - 1), (2, 1))]
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for pixel, sample in wanted:
        if pixel[0] < columns and pixel[1] < rows:
            found.setdefault(pixel, sample)
    return found


def border_samples(
    case: Case, level: int, row: int, column: int, extras: Extras | None = None
) -> tuple[list[Sample], bool]:
    """What the pixels of a large fragment choose from, its own middle first; and whether that is clear."""
    columns, rows, _, _ = case.levels[0]
    first, width = (column << level, row << level), 1 << level
    found = fragment_at(case, *_some_pixel(case, level, row, column))
    assert found is not None
    own, sample = found
    samples, surface = [sample], Surface(case)
    at = int(sample.place[1]) * columns + int(sample.place[0])
    if case.g.kind[at] != SURFACE:
        return samples, True
    before = earliest = own
    for dx, dy in _around(width):
        x, y = first[0] + dx, first[1] + dy
        if not (0 <= x < columns and 0 <= y < rows):
            continue
        beside = fragment_at(case, x, y)
        if beside is None or not surface.same(at, y * columns + x, width):
            continue
        if beside[0] not in (before, earliest):
            samples.append(beside[1])
            earliest = beside[0] if earliest == own else earliest
            before = beside[0]
    last = columns - 1 - first[0], rows - 1 - first[1]
    texels = sum(level[3] for level in case.levels[LARGE : case.coarsest + 1])
    for dx, dy in _on_border(width, last) if extras is not None else []:
        x, y = first[0] + dx, first[1] + dy
        if not (x < columns and y < rows):
            continue
        there = int(case.level_map.ravel()[y * columns + x])
        if not LARGE <= there <= case.coarsest or not surface.same(at, y * columns + x, width):
            continue
        found_at = places_of(case, there, y >> there, x >> there).get((x, y))
        if extras is not None and found_at is not None:
            number, which = found_at
            across, _, first_texel, _ = case.levels[there]
            texel = first_texel + (y >> there) * across + (x >> there) - case.levels[LARGE][2]
            if extras.there[number * texels + texel, which]:
                light = extras.light[number * texels + texel, which]
                samples.append(Sample(np.array([x, y], np.float64), 0, light))
    return samples, surface.clear


def _some_pixel(case: Case, level: int, row: int, column: int) -> tuple[int, int]:
    """A pixel of a fragment."""
    columns = case.levels[0][0]
    block = case.level_map[row << level : (row + 1) << level, column << level : (column + 1) << level]
    line, place = np.argwhere(block == level)[0]
    assert columns > 0
    return (column << level) + int(place), (row << level) + int(line)


def large_fragments(case: Case) -> list[tuple[int, int, int, int]]:
    """Row of its list, level, row and column of every fragment from level 3 on."""
    found = []
    for level in range(LARGE, case.coarsest + 1):
        columns, _, first, count = case.levels[level]
        at = case.at[first : first + count]
        for texel in np.flatnonzero((at != 0) & (at != CULLED)):
            row = first + int(texel) - case.levels[LARGE][2]
            found.append((row, level, *divmod(int(texel), columns)))
    return found


def border_words(case: Case, extras: Extras | None = None) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """The lists as the shader keeps them, (texels · 32, 4), and which are clear."""
    texels = sum(level[3] for level in case.levels[LARGE : case.coarsest + 1])
    words, clear = np.zeros((texels, SLOTS, 4), np.uint32), np.ones(texels, bool)
    for row, level, line, column in large_fragments(case):
        samples, clear[row] = border_samples(case, level, line, column, extras)
        for slot, sample in enumerate(samples):
            x, y = (sample.place - np.array([column << level, line << level])).astype(int) + BIAS
            words[row, slot, :3] = sample.light.astype(np.float32).view(np.uint32)
            words[row, slot, 3] = y << 13 | x
        words[row, SLOTS - 1, 3] = len(samples)
    return words.reshape(-1, 4), clear


def nearest_of(samples: list[Sample], here: Array, most: int, close: float) -> list[Sample]:
    """The nearest, none within `close` of another, of the five that are nearest at all.

    Places are whole pixels, so that the squares of distances are exact; of equals the first comes first.
    """
    far = np.array([((s.place - here) ** 2).sum() for s in samples])
    chosen: list[Sample] = []
    for k in np.lexsort((np.arange(len(far)), far))[:TOP]:
        if len(chosen) < most and all(np.linalg.norm(samples[k].place - t.place) > close for t in chosen):
            chosen.append(samples[k])
    return chosen


def _beside(case: Case, surface: Surface, pixel: int, most: int) -> list[Sample]:
    """Of a fragment of level 1 or 2: itself, and those beyond the sides that are nearer, and beyond both."""
    columns, rows, _, _ = case.levels[0]
    y, x = divmod(pixel, columns)
    found = fragment_at(case, x, y)
    assert found is not None
    own, width = found[1], 1 << found[1].level
    first = [(v >> own.level) << own.level for v in (x, y)]
    outside = [first[k] - 1 if v < own.place[k] else first[k] + width for k, v in enumerate((x, y))]
    samples = [own]
    for ox, oy in [(outside[0], y), (x, outside[1]), (outside[0], outside[1])][: most - 1]:
        inside = 0 <= ox < columns and 0 <= oy < rows
        if inside and surface.same(pixel, oy * columns + ox, width):
            beside = fragment_at(case, ox, oy)
            if beside is not None and all((beside[1].place != s.place).any() for s in samples):
                samples.append(beside[1])
    return samples


def _basis(a: Array, b: Array, width: float) -> float:
    return float(np.exp(-((a - b) ** 2).sum() / (C * width**2)))


def _shaded(case: Case) -> list[tuple[int, int, Array, Array]]:
    """Pixel, level, own light and place of all that belong to a fragment."""
    columns = case.levels[0][0]
    out = []
    for pixel in np.flatnonzero(case.level_map.ravel() <= case.coarsest):
        y, x = divmod(int(pixel), columns)
        found = fragment_at(case, x, y)
        assert found is not None
        out.append((int(pixel), found[1].level, found[1].light, np.array([x, y], np.float64)))
    return out


def _lists(case: Case, extras: Extras | None) -> dict[tuple[int, int, int], tuple[list[Sample], bool]]:
    return {
        (level, row, column): border_samples(case, level, row, column, extras)
        for _, level, row, column in large_fragments(case)
    }


def rbf(case: Case, most: int = 3, extras: Extras | None = None) -> tuple[Array, NDArray[np.bool_]]:
    """Ordinary kriging of the nearest samples, in their range; and where rounding cannot decide."""
    image, clear = np.zeros((len(case.g.kind), 3)), np.ones(len(case.g.kind), bool)
    lists = _lists(case, extras)
    for pixel, level, own, here in _shaded(case):
        image[pixel] = own
        if level == 0:
            continue
        width = 2.0**level
        if level >= LARGE:
            samples, sure = lists[level, int(here[1]) >> level, int(here[0]) >> level]
            chosen = nearest_of(samples, here, most, CLOSE * width)
            clear[pixel] = sure
        else:
            surface = Surface(case)
            chosen = _beside(case, surface, pixel, most)
            clear[pixel] = surface.clear
        phi = np.array([_basis(here, s.place, width) for s in chosen])
        matrix = np.array([[_basis(s.place, t.place, width) for t in chosen] for s in chosen])
        # two samples at one place have a pivot of zero, or of a rounding
        pivots = np.diag(np.linalg.cholesky(matrix + 1e-15 * np.eye(len(chosen)))) ** 2
        light = np.stack([s.light for s in chosen])
        if pivots.min() > LEAST_PIVOT:
            n = len(chosen)
            bordered = np.block([[matrix, np.ones((n, 1))], [np.ones((1, n)), np.zeros((1, 1))]])
            weights = np.linalg.solve(bordered, np.append(phi, 1.0))[:n]
        else:
            weights = phi / phi.sum()
        image[pixel] = np.clip(weights @ light, light.min(0), light.max(0))
        clear[pixel] &= bool(abs(np.log(pivots.min() / LEAST_PIVOT)) > 0.1)
    return image, clear


def rbf_paper(case: Case, extras: Extras | None = None) -> tuple[Array, NDArray[np.bool_]]:
    """[KJ16 Eqs. 1 to 3] with one width, that of the pixel's fragment; levels up to 2 are copied."""
    image, clear = np.zeros((len(case.g.kind), 3)), np.ones(len(case.g.kind), bool)
    lists = _lists(case, extras)
    for pixel, level, own, here in _shaded(case):
        image[pixel] = own
        if level < LARGE:
            continue
        samples, sure = lists[level, int(here[1]) >> level, int(here[0]) >> level]
        chosen = nearest_of(samples, here, 3, 0.0)
        clear[pixel] = sure
        phi = np.array([_basis(here, s.place, 2.0**level) for s in chosen])
        light = np.stack([s.light for s in chosen])
        if len(chosen) == 2:
            image[pixel] = phi @ light / max(phi.sum(), 1e-30)
        elif len(chosen) == 3:
            matrix = np.array([[_basis(s.place, t.place, 2.0**level) for t in chosen] for s in chosen])
            volume = abs(np.linalg.det(matrix))
            clear[pixel] &= abs(volume / LEAST_PIVOT - 1) > 0.01
            if volume > LEAST_PIVOT:
                image[pixel] = phi @ np.linalg.solve(matrix, light)
    return image, clear
