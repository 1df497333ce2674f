"""Fragments to upsample, and how the passes are run on them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.passes.reference import upsampling
from tests.passes.reference.gbuffers import GBuffer, plane_gbuffer, wavy_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.lights import Spot
from tests.passes.reference.pyramids import pyramid_record, texels
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import Runner, assert_not_within, assert_within, read
from tests.passes.reference.structs import row
from tests.passes.reference.upsampling import Case
from tests.passes.refine.test_one_pass import refine

Array = NDArray[np.float64]
SIZES = [(37, 21), (64, 48), (1, 19), (23, 1)]


def fragments(
    runner: Runner, rng: np.random.Generator, view: NDArray[Any], g: GBuffer, coarsest: int, **limits: Any
) -> Case:
    """Fragments of a G-buffer under a spot from beside the eye, with random irradiance."""
    eye, backward, up = (view[name][0].astype(np.float64) for name in ("eye", "backward", "up"))
    light = Spot(eye + backward * 0.1 + up, -backward, np.ones(3), 0.1)
    found = refine(runner, view, g, [light], coarsest, **limits)
    t = texels(view, g, max(coarsest, 1))
    made = Case(view, g, t, coarsest, found.level_map, found.at.copy(), np.zeros((0, 3)))
    for number, (level, line, column) in enumerate(found.fragments):
        columns, _, first, _ = made.levels[level]
        made.at[first + (line >> level) * columns + (column >> level)] = number + 1
    made.light = rng.uniform(0, 2, (max(len(found.fragments), 1), 3)).astype(np.float32).astype(np.float64)
    return made


def random_case(
    runner: Runner,
    rng: np.random.Generator,
    size: tuple[int, int],
    coarsest: int = 4,
    holes: float = 0.01,
) -> Case:
    """A bumpy surface with a step in it, holes, and fragments of every level."""
    view = random_view(rng, *size)
    g = wavy_gbuffer(rng, view, holes=holes, step=0.5)
    limits = {
        "depth_threshold": 1.0,
        "normal_threshold": 0.6,
        "metrics": (3, 2),
    }
    return fragments(runner, rng, view, g, coarsest, **limits)


def quilt_case(rng: np.random.Generator, size: tuple[int, int], coarsest: int = 4) -> Case:
    """A wall with fragments of every level anywhere, a few of them culled."""
    view = random_view(rng, *size)
    g = plane_gbuffer(view, 0.0)
    levels = np.full(size[::-1], 254, np.uint32)
    made = Case(
        view, g, texels(view, g, coarsest), coarsest, levels, np.zeros(0, np.uint32), np.zeros((0, 3))
    )
    made.at = np.zeros(sum(level[3] for level in made.levels[: coarsest + 1]), np.uint32)
    count = 0
    todo = [(coarsest, texel) for texel in range(made.levels[coarsest][3])]
    while todo:
        level, texel = todo.pop()
        columns, _, first, _ = made.levels[level]
        row, column = divmod(texel, columns)
        if level > 0 and rng.uniform() < 0.4:
            wide, high, _, _ = made.levels[level - 1]
            below = [(2 * row + down, 2 * column + right) for down in (0, 1) for right in (0, 1)]
            todo += [(level - 1, r * wide + c) for r, c in below if r < high and c < wide]
            continue
        culled = rng.uniform() < 0.05
        count += not culled
        made.at[first + texel] = CULLED if culled else count
        block = np.s_[row << level : (row + 1) << level, column << level : (column + 1) << level]
        levels[block] = 254 if culled else level
    made.light = rng.uniform(0, 2, (max(count, 1), 3)).astype(np.float32).astype(np.float64)
    return made


def bindings(case: Case, *names: str, level: int = 0) -> dict[str, NDArray[Any]]:
    """What the kernels read, by name."""
    t, flat = case.texels, np.zeros(len(case.texels.count), np.uint32)
    means = np.stack([row(t.position, t.count), row(t.normal, flat), row(t.geometric, flat)], axis=1)
    given = {
        "pyramid": pyramid_record(case.view, case.coarsest, level=level),
        "view": case.view,
        "fragment_at": case.at,
        "fragment_irradiance": np.pad(case.light, ((0, 0), (0, 1))).astype(np.float32),
        "level_map": case.level_map.ravel().astype(np.uint32),
        "means": means.reshape(-1, 4),
        **case.g.rows(),
    }
    return {name: given[name] for name in ("pyramid", *names)}


class Steps:
    """Runs the kernels of one upsampler, one after the other."""

    def __init__(self, runner: Runner, stem: str, case: Case) -> None:
        self.runner, self.stem, self.case = runner, f"passes/upsample/{stem}", case
        self.illumination = np.full((len(case.texels.count), 4), 9, np.float32)

    def guide(self) -> None:
        """What texels from level 1 on are asked."""
        self.guides = np.full((2 * len(self.case.texels.count), 4), 9, np.float32)
        above = sum(count for *_, count in self.case.levels[1 : self.case.coarsest + 1])
        if above:
            given = bindings(self.case, "view", "means")
            out = self.runner(self.stem, above, entry="guide", guides=self.guides, **given)
            self.guides = read(out, "guides", np.float32, -1, 4)

    def level(self, entry: str, level: int, *names: str, **more: NDArray[Any]) -> None:
        """One level of `illumination`."""
        count = self.case.levels[level][3]
        given = bindings(self.case, *names, level=level)
        out = self.runner(self.stem, count, entry=entry, illumination=self.illumination, **given, **more)
        self.illumination = read(out, "illumination", np.float32, -1, 4)

    def pixels(
        self, entry: str, *names: str, levels: bool = True, **more: NDArray[Any]
    ) -> NDArray[np.float32]:
        """The image, (n, 3)."""
        count = len(self.case.g.kind)
        given = bindings(self.case, *names)
        if levels:
            given["illumination"] = self.illumination
        before = np.full((count, 4), 9, np.float32)
        out = self.runner(self.stem, count, entry=entry, direct_irradiance=before, **given, **more)
        return read(out, "direct_irradiance", np.float32, count, 4)[:, :3]


def run(runner: Runner, stem: str, case: Case) -> NDArray[np.float32]:
    """The image of an upsampler by name, (n, 3)."""
    steps = Steps(runner, stem, case)
    own = ("fragment_at", "fragment_irradiance")
    if stem == "nearest":
        return steps.pixels("main", *own, "level_map", levels=False)
    if stem == "bilinear":
        for level in range(1, case.coarsest + 1):
            steps.level("pull", level, *own)
        for level in range(case.coarsest - 1, 0, -1):
            steps.level("push", level)
        return steps.pixels("pixels", *own, "level_map")
    steps.guide()
    for level in range(case.coarsest, 0, -1):
        steps.level("level", level, *own, "means", guides=steps.guides)
    return steps.pixels("pixels", *own, "g_position", "g_normal", "g_geometric", guides=steps.guides)


def constant(case: Case, value: float) -> Array:
    """All fragments alike; what the image should be, (n, 3)."""
    case.light = np.full_like(case.light, value)
    return np.where(case.shaded[:, None], value, 0.0) * np.ones(3)


def check_image(
    runner: Runner, rng: np.random.Generator, stem: str, size: tuple[int, int], coarsest: int, bound: float
) -> None:
    """An upsampler against the reference of its name, on a random case."""
    reference = getattr(upsampling, stem)
    case = random_case(runner, rng, size, coarsest)
    found = run(runner, stem, case)
    assert_within(found, reference(case), bound, "irradiance")
    assert not found[~case.shaded & (case.g.kind != 1)].any(), "what sees no surface has no light"
    case.light = case.light[:, [1, 2, 0]]
    assert_not_within(found, reference(case), bound)


def check_constant(runner: Runner, rng: np.random.Generator, stem: str) -> None:
    """Where all fragments have the same light all pixels have it."""
    case = random_case(runner, rng, (53, 38))
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    found = run(runner, stem, case)
    assert_within(found[case.shaded], expected[case.shaded], 1e-6, "irradiance")


def step_case(runner: Runner, rng: np.random.Generator, column: int = 29) -> tuple[Case, NDArray[np.bool_]]:
    """Two walls that face the camera, the right one (from `column` on) farther off, light 1 and 0."""
    view = random_view(rng, 64, 32)
    g = plane_gbuffer(view, 0.0)
    left = np.arange(64 * 32) % 64 < column
    eye = view["eye"][0].astype(np.float64)
    g.position[~left] = eye + 1.5 * (g.position[~left] - eye)
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25, "metrics": (3, 2)}
    case = fragments(runner, rng, view, g, 4, **limits)
    numbers = np.arange(64 * 32).reshape(32, 64)
    for level, (columns, rows, first, _) in enumerate(case.levels[:5]):
        for line in range(rows):
            for place in range(columns):
                at = case.at[first + line * columns + place]
                if at:
                    case.light[at - 1] = left[numbers[line << level, place << level]]
    return case, left
