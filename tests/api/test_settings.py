"""Settings: the table, checks on names and values, presets, equality, pickling, documentation."""

from __future__ import annotations

import copy
import inspect
import json
import pickle
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import miplight as ml
from miplight import _core
from miplight._table import KNOBS, PRESETS, Knob

# what every preset sets and a study may sweep
NAMES = """direct indirect bounces indirect_visibility refine visibility visibility_reuse specular_visibility
    upsample form_factor light_samples light_pattern vpls coarsest_level finest_level depth_metric
    depth_threshold normal_metric normal_threshold illumination_threshold bit_threshold
    light_cut_threshold voxel_resolution voxel_bias interleave specular supersample seed target_error
    budget_ms""".split()
PAPERS = ("splatting-2009", "radiosity-2009", "hierarchical-2009", "area-2010", "area-2016")


def test_every_setting_of_the_surface_is_there() -> None:
    assert set(NAMES) <= set(ml.Settings().to_dict())


def test_defaults_come_from_the_core_and_pass_their_own_check() -> None:
    defaults = {spec["name"]: spec["default"] for spec in _core.setting_specs()}
    assert ml.Settings().to_dict() == defaults
    assert ml.Settings(**defaults) == ml.Settings()


@pytest.mark.parametrize("name", sorted(KNOBS))
def test_every_setting_is_documented(name: str) -> None:
    knob = KNOBS[name]
    assert knob.doc.endswith(".")
    assert len(knob.doc) > 10
    assert f"{name} :" in (ml.Settings.__doc__ or "")
    assert name in inspect.signature(ml.Settings).parameters


def test_help_shows_ranges_defaults_and_what_is_not_there_yet() -> None:
    text = inspect.getdoc(ml.Settings) or ""
    assert "light_samples : int, default 256" in text
    assert "Not available yet." in text
    assert "brute-force" in text


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"light_sample": 4}, ["light_sample", "did you mean 'light_samples'"]),
        ({"qqqq": 4}, ["qqqq", "known: direct, indirect"]),
        ({"light_samples": 0}, ["'light_samples' is 0", "from 1 up to 4096"]),
        ({"light_samples": 4097}, ["4097", "up to 4096"]),
        ({"light_samples": 2.5}, ["2.5", "whole number"]),
        ({"light_samples": True}, ["True", "whole number"]),
        ({"light_samples": "many"}, ["'many'", "whole number"]),
        ({"light_samples": None}, ["None", "whole number"]),
        ({"light_samples": np.array([4, 4])}, ["[4, 4]", "whole number"]),
        ({"seed": -1}, ["-1", "from 0"]),
        ({"supersample": 3}, ["3", "1, 2, 4"]),
        ({"supersample": True}, ["True", "1, 2, 4"]),
        ({"supersample": "2"}, ["'2'", "1, 2, 4"]),
        ({"direct": "of"}, ["'of'", "did you mean 'off'"]),
        ({"direct": 1}, ["is 1", "'off', 'on'"]),
        ({"light_pattern": "jitter"}, ["'jitter'", "did you mean 'jittered'"]),
        ({"indirect": "lvp"}, ["'lvp'", "did you mean 'lpv'"]),
        ({"lpv_resolution": 129}, ["129", "from 16 up to 128"]),
        ({"lpv_most_flow": 0}, ["is 0", "above 0"]),
        ({"vpls": 0}, ["'vpls' is 0", "from 1 up to 1048576"]),
        ({"rsm_resolution": 100}, ["100", "16, 32, 64"]),
        ({"coarsest_vpls": 100}, ["100", "1, 4, 16"]),
        ({"vpl_radius": 0}, ["is 0", "above 0"]),
        ({"surface_modulation": 1.5}, ["1.5", "up to 1"]),
        ({"light_cut_threshold": None}, ["None", "a number"]),
        ({"depth_threshold": -0.5}, ["-0.5", "from 0", "or None"]),
        ({"coarsest_level": 17}, ["17", "up to 16"]),
        ({"specular": "yes"}, ["'yes'", "'off', 'on'"]),
        ({"interleave": 3}, ["3", "from 1 up to 2"]),
        ({"illumination_threshold": -0.1}, ["-0.1", "from 0", "or None"]),
        ({"bit_threshold": 0}, ["'bit_threshold' is 0", "from 1 up to 4096", "or None"]),
        ({"bit_threshold": 2.5}, ["2.5", "whole number"]),
        ({"voxel_resolution": 8}, ["8", "from 16 up to 2048"]),
        ({"voxel_slices": None}, ["None", "a multiple of 32"]),
        ({"voxel_march": "steps"}, ["'steps'", "'uniform', 'dda'"]),
        ({"voxel_bias": -1.0}, ["-1.0", "from 0"]),
        ({"visibility": "voxels"}, ["'voxels'", "did you mean 'voxel'"]),
        ({"lobe_samples": 24}, ["24", "9, 25, 49"]),
        ({"target_error": 0.01}, ["'target_error'", "not available yet", "0.01"]),
        ({"budget_ms": 5}, ["'budget_ms'", "not available yet"]),
        ({"budget_ms": float("nan")}, ["nan", "a number above 0"]),
        ({"budget_ms": -1.0}, ["-1.0", "a number above 0"]),
    ],
)
def test_what_is_refused_says_why(changes: dict[str, Any], parts: list[str]) -> None:
    base = ml.Settings(seed=7)
    for attempt in (lambda: ml.Settings(**changes), lambda: base.replace(**changes)):
        with pytest.raises(ml.SettingsError) as caught:
            attempt()
        for part in parts:
            assert part in str(caught.value)
    assert base == ml.Settings(seed=7)


def test_positional_arguments_are_refused() -> None:
    with pytest.raises(TypeError):
        ml.Settings("on")  # type: ignore[call-arg]


def test_switches_take_bools_and_numpy_numbers_become_plain() -> None:
    assert ml.Settings(direct=False) == ml.Settings(direct="off")
    assert ml.Settings(direct=np.bool_(True)).direct == "on"
    samples = ml.Settings(light_samples=np.int64(64)).light_samples
    assert samples == 64
    assert type(samples) is int
    assert ml.Settings(supersample=np.uint8(2)).supersample == 2
    assert ml.Settings().specular == "on"
    assert ml.Settings(specular=False).specular == "off"


def test_frozen() -> None:
    settings = ml.Settings()
    with pytest.raises(FrozenInstanceError, match=r"replace\(seed=3\)"):
        settings.seed = 3
    with pytest.raises(FrozenInstanceError):
        del settings.seed
    settings.to_dict()["seed"] = 3
    assert settings.seed == 0


def test_misspelt_attribute_suggests() -> None:
    with pytest.raises(AttributeError, match="light_samples"):
        _ = ml.Settings().light_sample
    assert not hasattr(ml.Settings(), "_repr_mimebundle_")


def test_equality_hash_and_copies() -> None:
    one, two = ml.Settings(seed=1), ml.Settings().replace(seed=1)
    assert one == two
    assert hash(one) == hash(two)
    assert one != ml.Settings(seed=2)
    assert one != {"seed": 1}
    assert copy.deepcopy(one) == one
    assert len({one, two, ml.Settings()}) == 2


@given(
    seed=st.integers(0, 2**32 - 1),
    light_samples=st.integers(1, 4096),
    direct=st.booleans(),
    supersample=st.sampled_from([1, 2, 4]),
)
def test_round_trips(seed: int, light_samples: int, direct: bool, supersample: int) -> None:
    changes = {"seed": seed, "light_samples": light_samples, "direct": direct, "supersample": supersample}
    settings = ml.Settings.preset("brute-force").replace(**changes)
    assert ml.Settings.from_dict(json.loads(json.dumps(settings.to_dict()))) == settings
    assert pickle.loads(pickle.dumps(settings)) == settings
    assert eval(repr(settings), {"Settings": ml.Settings}) == settings


def test_from_dict_checks_and_fills_in() -> None:
    assert ml.Settings.from_dict({"seed": 4}) == ml.Settings(seed=4)
    with pytest.raises(ml.SettingsError, match="did you mean 'seed'"):
        ml.Settings.from_dict({"sed": 4})
    with pytest.raises(ml.SettingsError, match="mapping"):
        ml.Settings.from_dict([("seed", 4)])  # type: ignore[arg-type]


def test_repr_shows_the_preset_and_what_differs() -> None:
    assert repr(ml.Settings()) == "Settings()"
    settings = ml.Settings.preset("brute-force")
    assert repr(settings) == "Settings.preset('brute-force')"
    assert repr(settings.replace(seed=3)) == "Settings.preset('brute-force').replace(seed=3)"
    page = settings.replace(seed=3)._repr_html_()
    assert "<b>3</b>" in page
    assert all(name in page for name in NAMES)


def test_presets_lists_what_can_be_rendered() -> None:
    assert {"area-2010", "brute-force", "default"} <= set(ml.presets())
    for name, settings in ml.presets().items():
        assert settings == ml.Settings.preset(name)


def test_area_2010_is_incremental_refinement_with_voxels() -> None:
    area = ml.Settings.preset("area-2010")
    assert area.refine == area.visibility_reuse == "incremental"
    assert area.visibility == "voxel"
    assert (area.lobe_samples, area.specular_visibility) == (81, "ray")
    assert (area.interleave, area.light_pattern, area.upsample) == (2, "grid", "edge-aware")
    assert (area.illumination_threshold, area.bit_threshold) == (0.1, 128)
    assert area.replace(illumination_threshold=None, bit_threshold=None).bit_threshold is None


def test_unknown_presets_suggest() -> None:
    with pytest.raises(ml.SettingsError, match="did you mean 'brute-force'"):
        ml.Settings.preset("bruteforce")
    with pytest.raises(ml.SettingsError, match="brute-force"):
        ml.Settings.preset(3)  # type: ignore[arg-type]


def test_presets_that_are_not_there_yet_say_so() -> None:
    assert set(PAPERS) <= set(PRESETS)
    waiting = [name for name, overrides in PRESETS.items() if overrides is None]
    for name in waiting:
        with pytest.raises(ml.SettingsError, match=f"'{name}' is not available yet; available: .*'default'"):
            ml.Settings.preset(name)
        assert name not in ml.presets()


def test_float_settings_become_floats_and_bounds_hold() -> None:
    row = {"name": "bias", "kind": "float", "default": 0.5, "choices": [], "available": [], "minimum": 0.0}
    row |= {"maximum": 2.0, "exclusive_minimum": True, "nullable": False, "unit": "voxels", "doc": "Bias."}
    knob = Knob.from_core(row | {"source": "[X Eq. 1]"})
    assert type(knob.check(1)) is float
    assert knob.check(2.0) == 2.0
    assert knob.summary() == "Bias. Unit: voxels. Allowed: a number above 0 up to 2. [X Eq. 1]"
    for bad in (0.0, 2.1, float("inf"), "1", None):
        with pytest.raises(ml.SettingsError, match="a number above 0 up to 2"):
            knob.check(bad)
