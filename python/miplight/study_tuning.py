"""Settings of what a study found: of a row of a sweep, of a trial of a tuner, of a dict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ._table import KNOBS, PRESETS, unknown
from .errors import SettingsError
from .settings import Settings, as_settings
from .validate import fail

__all__ = ["settings_of"]

_ALLOWED = "a row of miplight.study.sweep, a trial with params, or a dict from settings to values"


def settings_of(row_or_trial: Any, base: Settings | str | None = None) -> Settings:
    """Make settings of a row of a sweep, of a trial of Optuna, or of a dict.

    Parameters
    ----------
    row_or_trial
        - A row of the table of `miplight.study.sweep`, such as ``table.iloc[0]`` or one that
          ``table.itertuples()`` gives: its settings and its preset; its other columns are left out.
        - A trial of Optuna, or anything else that has ``params``: a dict of what was suggested.
        - A dict from names of settings to values; also ``row.to_dict()``.

        ``"preset"`` may be among the names: the preset is then what the others change.
    base
        What keeps its value where nothing is said: `Settings` or the name of a preset; by default the preset
        ``"default"``. A preset in `row_or_trial` goes before it.

    Returns
    -------
    Settings
        Of a row with all its settings those that were rendered: they give the same bits again.

    Raises
    ------
    SettingsError
        For an unknown setting (the nearest is suggested) or preset, a value that is not allowed, a row that
        has no setting, or something else altogether.

    Notes
    -----
    Tables keep whole numbers as floats where a column has gaps: 64.0 is 64 for a setting that is a whole
    number. A gap in a row of a sweep is None where the setting may be None; elsewhere it is a setting that
    the version which wrote the table did not have, and it keeps its value in `base`.

    Examples
    --------
    >>> import miplight as ml
    >>> ml.study.settings_of({"preset": "area-2010", "light_samples": 64.0})
    Settings.preset('area-2010').replace(light_samples=64)
    >>> ml.study.settings_of({"bit_threshold": 16}, base="area-2010").bit_threshold
    16
    """
    values, is_row = _values(row_or_trial)
    preset = values.pop("preset", None)
    if is_row:
        # a row of settings that started from no preset has an empty name, or none that this version knows
        known = isinstance(preset, str) and PRESETS.get(preset) is not None
        start = Settings.preset(preset) if known else as_settings(base)
        return _restored(values, start, bool(known) or base is not None)
    start = as_settings(base if preset is None else preset)
    for name in values:
        if name not in KNOBS:
            raise unknown("setting", str(name), [*KNOBS, "preset"])
    return start.replace(**{name: _plain(name, value) for name, value in values.items()})


def _values(given: Any) -> tuple[dict[Any, Any], bool]:
    """Names and values, and whether they are a row, which has more columns than settings."""
    if hasattr(given, "_asdict"):
        return dict(given._asdict()), True
    if hasattr(given, "iloc"):
        if getattr(given, "ndim", 0) != 1:
            raise SettingsError("row_or_trial is a table; allowed: one row of it, as table.iloc[0]")
        return dict(given.items()), True
    if isinstance(given, Mapping):
        return dict(given), "point" in given
    params = getattr(given, "params", None)
    if not isinstance(params, Mapping):
        fail("row_or_trial", given, _ALLOWED, SettingsError)
    return dict(params), False


def _restored(row: Mapping[Any, Any], start: Settings, named: bool) -> Settings:
    """The settings in a row; whether they keep the name of the preset that `start` is."""
    found = {name: value for name, value in row.items() if name in KNOBS}
    if not found and not named:
        raise SettingsError(f"row_or_trial has none of the settings; allowed: {_ALLOWED}")
    there = {
        name: None if _is_gap(value) else _plain(name, value)
        for name, value in found.items()
        if KNOBS[name].nullable or KNOBS[name].default is None or not _is_gap(value)
    }
    changed = start.replace(**there)
    return changed if named else Settings(**changed.to_dict())


def _is_gap(value: Any) -> bool:
    """Whether a table has nothing here: None, NaN, or what pandas puts in its place."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return True
    return type(value).__name__ in ("NAType", "NaTType")


def _plain(name: str, value: Any) -> Any:
    """A value as settings take it: without NumPy's types, whole numbers whole."""
    value = value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value
    knob = KNOBS[name]
    whole = knob.kind == "int" or (bool(knob.choices) and all(isinstance(c, int) for c in knob.choices))
    return int(value) if whole and isinstance(value, float) and value.is_integer() else value
