"""What a view offers to change, as plain values for a page: each control a list of labelled stops."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from miplight._table import KNOBS, Knob, SettingValue, unknown
from miplight.errors import SettingsError
from miplight.settings import Settings, presets
from miplight.validate import fail

KNOBS_SHOWN = ("light_samples", "coarsest_level", "bit_threshold", "illumination_threshold", "indirect")
"""Settings that a view offers by default."""
OVERLAYS = ("off", "levels", "reasons", "indirect levels")
"""What may lie over the picture."""
GIVEN = "as given"
"""Stands among the presets for settings that are none of them."""
STOPS = tuple(step / 4 for step in range(-24, 25))
"""Stops of exposure and of a light: from 1/64 to 64, in quarters of a factor of two."""

_LEVELS = range(9)
_POWERS = tuple(2**step for step in range(13))
_NUMBERS = tuple(digit * 10.0**power for power in range(-3, 2) for digit in (1, 2, 5))


def checked_knobs(names: Iterable[str]) -> tuple[str, ...]:
    """Names of settings that a view may offer.

    Raises
    ------
    SettingsError
        If one is unknown.
    """
    listed = (names,) if isinstance(names, str) else tuple(names)
    for name in listed:
        if not isinstance(name, str):
            fail("knobs", name, "names of settings", SettingsError)
        if name not in KNOBS:
            raise unknown("setting", name, KNOBS)
    return listed


def preset_name(settings: Settings) -> str:
    """Name of the preset that these settings are, or `GIVEN`."""
    return next((name for name, preset in presets().items() if preset == settings), GIVEN)


def control(name: str, label: str, stops: Iterable[Any], title: str, *, slider: bool) -> dict[str, Any]:
    """Describe a control: its name, how it looks, its stops and their labels, and what it does."""
    values = list(stops)
    return {
        "name": name,
        "label": label,
        "kind": "slider" if slider else "select",
        "stops": values,
        "labels": [stop_label(value) for value in values],
        "title": title,
    }


def stop_label(value: SettingValue) -> str:
    """Value of a stop in words."""
    if value is None:
        return "never"
    return f"{value:g}" if isinstance(value, float) else str(value)


def knob_control(name: str, value: SettingValue) -> dict[str, Any]:
    """Describe the control of a setting that is `value` now."""
    knob = KNOBS[name]
    stops = [knob.default] if knob.pending else list(knob.available or knob.choices) or _numbers(knob)
    if value not in stops:
        stops = sorted([*stops, value], key=_order)
    return control(name, name.replace("_", " "), stops, knob.summary(), slider=not knob.choices)


def _numbers(knob: Knob) -> list[SettingValue]:
    """Stops for a setting that is a number: levels one by one, counts by powers of two, others 1, 2, 5."""
    lowest = -math.inf if knob.minimum is None else knob.minimum
    highest = math.inf if knob.maximum is None else knob.maximum
    of_kind: Iterable[float] = _NUMBERS
    if knob.kind == "int":
        of_kind = _LEVELS if knob.unit == "level" else _POWERS
    stops: list[SettingValue] = [
        number
        for number in of_kind
        if (lowest < number if knob.exclusive_minimum else lowest <= number)
        and number <= highest
        and (knob.multiple_of == 1 or number % knob.multiple_of == 0)
    ]
    return [*stops, None] if knob.nullable else stops


def _order(value: Any) -> tuple[int, float]:
    """Numbers by size, then words as they come, None last."""
    if value is None:
        return 2, 0.0
    return (0, float(value)) if isinstance(value, (int, float)) else (1, 0.0)
