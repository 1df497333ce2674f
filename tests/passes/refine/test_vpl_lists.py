"""`vpl_lists`: what each virtual light lights at which level, against plain recursion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.passes.reference.pyramids import pyramid_record, sizes
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import VPL_LISTS, record
from tests.passes.reference.virtual_lists import Case, Lists, clear_limit, lists, random_case

STEM = "passes/refine/vpl_lists"
HEAD, LISTED = 4, 3
Words = NDArray[np.uint32]


class Run:
    """All batches of a case on the device."""

    def __init__(
        self, runner: Runner, case: Case, limit: float, lowest: int = 1, *, glossy: bool = True
    ) -> None:
        self.runner, self.case, self.lowest, self.glossy = runner, case, lowest, glossy
        self.levels = sizes(*case.size)
        texels = sum(row[3] for row in self.levels[1 : case.coarsest + 1])
        self.held = [np.zeros((texels, 4), np.float32) for _ in range(2)]
        self.left = np.zeros((*case.states[lowest].shape, len(case.lights)), bool)
        self.points, self.lights = case.points(), case.short_lights(limit)
        self.params: dict[str, NDArray[Any]] = {}
        self.tested = 0
        self.evaluations = np.zeros(2, np.uint32)

    def _call(self, entry: str, threads: int, level: int, **arrays: NDArray[Any]) -> dict[str, Any]:
        pyramid = pyramid_record(self.case.view, self.case.coarsest, self.lowest, level)
        constants = {"DISC": float(self.case.disc), "GLOSSY": float(self.glossy)} if entry == "test" else None
        given = {"texel_state": self.case.state, "pyramid": pyramid, **self.params}
        return self.runner(STEM, threads, entry=entry, constants=constants, **given, **arrays)

    def batch(self, first: int, count: int) -> Words:
        """One batch; the words of its masks."""
        case, words = self.case, -(-count // 32)
        start = self.levels[self.lowest][2]
        total = self.levels[case.coarsest][2] + self.levels[case.coarsest][3] - start
        numbers = {"first": first, "count": count, "words": words, "lowest": self.lowest}
        self.params = {"params": record(VPL_LISTS, reach=case.reach, **numbers)}
        masks, listed = np.zeros(HEAD + words * total, np.uint32), np.full(self.levels[1][3], 9, np.uint32)
        out = self._call("begin", self.levels[case.coarsest][3], 0, masks=masks, listed=listed)
        for level in range(case.coarsest, max(self.lowest, 2) - 1, -1):
            masks, listed = read(out, "masks", np.uint32), read(out, "listed", np.uint32)
            numbers_here = np.flatnonzero(listed[: self.levels[level][3]] & 1).astype(np.uint32)
            masks[LISTED] = len(numbers_here)
            self.tested += len(numbers_here)
            some = {"list": np.append(numbers_here, 0).astype(np.uint32)}
            threads = len(numbers_here) + 64
            out = self._call("test", threads, level, masks=masks, **some, **self._light())
            self.evaluations = read(out, "evaluations", np.uint32)
            for number, name in enumerate(("held_irradiance", "held_radiance")):
                self.held[number] = read(out, name, np.float32, -1, 4)
            masks = read(out, "masks", np.uint32)
            if level > self.lowest:
                listed = np.zeros(self.levels[1][3], np.uint32)
                out = self._call("split", threads, level, masks=masks, listed=listed, **some)
        masks = read(out, "masks", np.uint32)
        if self.lowest == 1:
            out = self._call("count", self.levels[1][3], 0, masks=masks, evaluations=self.evaluations)
            self.evaluations = read(out, "evaluations", np.uint32)
        return masks

    def _light(self) -> dict[str, NDArray[Any]]:
        held: dict[str, NDArray[Any]] = {"held_irradiance": self.held[0], "held_radiance": self.held[1]}
        held["evaluations"] = self.evaluations
        return {"points": self.points, "short_lights": self.lights, **held}

    def batches(self, *counts: int) -> Run:
        """So many virtual lights each."""
        rows, columns = self.case.states[self.lowest].shape
        for number, count in enumerate(counts):
            first = sum(counts[:number])
            masks = self.batch(first, count)
            words = -(-count // 32)
            lowest = masks[HEAD : HEAD + words * rows * columns].reshape(rows, columns, words)
            bits = (lowest[..., None] >> np.arange(32, dtype=np.uint32)) & 1
            self.left[..., first : first + count] = bits.reshape(rows, columns, -1)[..., :count] != 0
        return self

    def level(self, number: int, level: int) -> NDArray[np.float32]:
        """What is held there: irradiance, or radiance of lobes."""
        _, _, first, count = self.levels[level]
        start = first - self.levels[1][2]
        held = self.held[number][start : start + count]
        assert not held[:, 3].any()
        return held[:, :3].reshape(*self.case.states[level].shape, 3)


def agrees(run: Run, expected: Lists) -> None:
    """Bit by bit what is left, and within rounding what is held."""
    if run.lowest == 1:
        assert (run.left == expected.left).all()
    for level, (irradiance, radiance) in expected.bounds.items():
        assert_within(run.level(0, level), expected.irradiance[level], irradiance, f"irradiance of {level}")
        assert_within(run.level(1, level), expected.radiance[level], radiance, f"radiance of {level}")


CASES = [((37, 22), 4, 1), ((64, 40), 5, 1), ((24, 16), 3, 2), ((33, 17), 5, 3), ((20, 9), 1, 1)]


@pytest.mark.parametrize(("size", "coarsest", "lowest"), CASES)
@pytest.mark.parametrize("disc", [False, True])
def test_lists_agree_with_the_recursion(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], coarsest: int, lowest: int, disc: bool
) -> None:
    case = random_case(rng, size, coarsest, disc=disc, holes=0.003)
    limit = clear_limit(case, 0.6) if coarsest > 1 else 1.0
    expected = lists(case, limit, lowest)
    run = Run(runner, case, limit, lowest).batches(len(case.lights))
    agrees(run, expected)
    assert run.evaluations @ [1, 256] == expected.evaluations
    if coarsest == 1:
        assert not run.held[0].any()
        return
    for bound in expected.bounds.values():
        assert (bound[0].max() < 1e-3) & (bound[1].max() < 1e-1), "bounds that mean something"
    other = lists(case, 0.5 * limit, lowest)
    level = max(lowest, 2)
    assert_not_within(run.level(0, level), other.irradiance[level], other.bounds[level][0])
    assert_not_within(run.level(1, level), other.radiance[level], other.bounds[level][1])
    in_two = Run(runner, case, limit, lowest).batches(33, len(case.lights) - 33)
    agrees(in_two, expected)


def test_virtual_lights_differ_in_what_they_split(runner: Runner, rng: np.random.Generator) -> None:
    case = random_case(rng, (64, 40), 4, rough=0.0)
    limit = clear_limit(case, 0.7)
    run = Run(runner, case, limit).batches(len(case.lights))
    shares = run.left.mean(axis=(0, 1))
    assert shares.min() < 0.05 < 0.5 < shares.max()
    plain = Run(runner, case, limit, glossy=False).batches(len(case.lights))
    assert not plain.held[1].any()
    assert plain.left.sum() < run.left.sum(), "lobes split what irradiance leaves whole"
    assert not (plain.left & ~run.left).any()


def test_where_nothing_may_differ_all_is_left_and_where_all_may_nothing(
    runner: Runner, rng: np.random.Generator
) -> None:
    case = random_case(rng, (32, 32), 3, rough=0.0)
    none = Run(runner, case, -1.0).batches(len(case.lights))
    assert none.left.all()
    assert not none.held[0].any()
    every = Run(runner, case, 3e38).batches(len(case.lights))
    assert not every.left.any()
    assert every.tested == 16, "nothing below the coarsest level is looked at"
    assert (every.level(0, 2) > 0).any()
    assert not every.level(0, 1).any()
