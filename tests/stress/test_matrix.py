"""The matrix of preset, light, material, indirect light and visibility: each renders, or says why not."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

import miplight as ml
from miplight._table import KNOBS
from tests.analytic.test_every_preset import LIGHTS, MATERIALS, _scene
from tests.stress.common import LONG, OUTPUTS, PRESETS, assert_sound, quick

CAMERA = ml.Camera.look_at((0, 2.2, 3.2), (0, 0.3, 0), fov_y=50, width=24, height=24)
INDIRECT = ["off", "splat", "gather", "clustered", "hierarchical", "lpv", "final-gather"]
VISIBILITY = ["none", "voxel", "ray", "shadow-map"]
Cell = tuple[str, str, str]


def _cells(preset: str, indirect: str) -> Iterator[Cell]:
    """Light, material and visibility: all, or each light once, so that every pair occurs somewhere."""
    if LONG:
        yield from itertools.product(LIGHTS, MATERIALS, VISIBILITY)
        return
    shift = PRESETS.index(preset) * len(INDIRECT) + INDIRECT.index(indirect)
    materials = list(MATERIALS)
    for k, light in enumerate(LIGHTS):
        yield light, materials[(k + shift) % 5], VISIBILITY[(k + shift // 5) % 4]


def _refused(preset: str, indirect: str, visibility: str) -> str:
    """What is documented not to go together: the word that a refusal must have, or none."""
    own = ml.Settings.preset(preset)
    if preset == "default" and visibility in ("voxel", "shadow-map"):
        return "visibility"
    if indirect == "final-gather" and own.indirect_visibility == "off":
        return "indirect_visibility"
    return ""


def test_every_choice_is_in_the_matrix() -> None:
    assert list(KNOBS["indirect"].choices) == INDIRECT
    assert set(KNOBS["visibility"].choices) == set(VISIBILITY)
    pairs = {
        pair
        for preset, indirect in itertools.product(PRESETS, INDIRECT)
        for cell in _cells(preset, indirect)
        for pair in itertools.combinations((preset, f"indirect {indirect}", *cell), 2)
    }
    wanted = [PRESETS, [f"indirect {name}" for name in INDIRECT], LIGHTS, MATERIALS, VISIBILITY]
    for one, other in itertools.combinations(wanted, 2):
        assert set(itertools.product(one, other)) <= pairs


@pytest.mark.parametrize("indirect", INDIRECT)
@pytest.mark.parametrize("preset", PRESETS)
def test_renders_or_says_why(renderer: ml.Renderer, preset: str, indirect: str) -> None:
    settings = quick(
        preset, light_samples=16, indirect=indirect, gather_rays=4, rsm_resolution=32, vpls=64,
        coarsest_vpls=16, lpv_resolution=16, lpv_samples=256, lpv_iterations=8,
    )  # fmt: skip
    for light, material, visibility in _cells(preset, indirect):
        cell = f"{light}, {material}, {visibility}"
        scene, how = _scene(LIGHTS[light], MATERIALS[material]), settings.replace(visibility=visibility)
        word = _refused(preset, indirect, visibility)
        if word:
            with pytest.raises(ml.SettingsError, match=rf"{word}.*allowed: |{word}.*\d{{3}}"):
                renderer.render(scene, CAMERA, how)
            continue
        frame = renderer.render(scene, CAMERA, how, OUTPUTS)
        assert_sound(frame)
        lit = frame.surface_mask
        bright = light != "none" and material not in ("black", "nearly a mirror")
        assert frame.direct[lit].any() >= bright, cell
        assert frame.indirect[lit].any() == (bright and indirect != "off"), cell
