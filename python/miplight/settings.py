"""Settings: every knob of a render, frozen, checked and documented from the core's one table."""

from __future__ import annotations

import html
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import FrozenInstanceError
from typing import Any

from ._table import KNOBS, PRESETS, SettingValue, checked, unknown
from .errors import SettingsError
from .validate import fail


class Settings:
    """Every knob of a render; frozen and keyword-only."""  # the whole text is put together below

    __slots__ = ("_base", "_values")

    _base: str
    _values: dict[str, SettingValue]

    def __init__(self, **changes: SettingValue) -> None:
        self._fill("", {name: knob.default for name, knob in KNOBS.items()} | checked(changes))

    def _fill(self, base: str, values: dict[str, SettingValue]) -> None:
        object.__setattr__(self, "_base", base)
        object.__setattr__(self, "_values", values)

    @classmethod
    def _make(cls, base: str, values: dict[str, SettingValue]) -> Settings:
        settings = cls.__new__(cls)
        settings._fill(base, values)
        return settings

    @classmethod
    def preset(cls, name: str) -> Settings:
        """Return the settings of a preset.

        Parameters
        ----------
        name
            One of the names that `miplight.presets()` lists.

        Raises
        ------
        SettingsError
            If there is no preset of this name (the nearest is suggested), or it is not available yet.
        """
        if not isinstance(name, str) or name not in PRESETS:
            raise unknown("preset", name, PRESETS)
        overrides = PRESETS[name]
        if overrides is None:
            there = ", ".join(repr(n) for n, found in PRESETS.items() if found is not None)
            raise SettingsError(f"preset {name!r} is not available yet; available: {there}")
        return cls._make(name, cls(**overrides)._values)

    @classmethod
    def from_dict(cls, values: Mapping[str, SettingValue]) -> Settings:
        """Settings from names and values, as `to_dict` gives them; what is missing keeps its default.

        Raises
        ------
        SettingsError
            For an unknown name or a value that is not allowed.
        """
        if not isinstance(values, Mapping):
            fail("values", values, "a mapping from setting names to values", SettingsError)
        return cls(**values)

    def to_dict(self) -> dict[str, SettingValue]:
        """Every setting by name; plain values that JSON can hold."""
        return dict(self._values)

    def replace(self, **changes: SettingValue) -> Settings:
        """Return a copy with `changes`.

        Raises
        ------
        SettingsError
            For an unknown name or a value that is not allowed.
        """
        return self._make(self._base, self._values | checked(changes))

    def __getattr__(self, name: str) -> Any:
        # only called for what is no method: a setting, or a slip
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._values[name]
        except KeyError:
            raise AttributeError(str(unknown("setting", name, KNOBS))) from None

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(f"settings are frozen; use settings.replace({name}={value!r})")

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(f"settings are frozen: {name!r} cannot be deleted")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._values})

    def __eq__(self, other: object) -> bool:
        return self._values == other._values if isinstance(other, Settings) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(sorted(self._values.items())))

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (self._base, dict(self._values))

    def __copy__(self) -> Settings:
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> Settings:
        return self

    def differences(self) -> dict[str, SettingValue]:
        """What differs from the preset that these settings started from (or from the defaults)."""
        start = Settings.preset(self._base) if self._base else Settings()
        return {name: value for name, value in self._values.items() if value != start._values[name]}

    def __repr__(self) -> str:
        changes = ", ".join(f"{name}={value!r}" for name, value in self.differences().items())
        if not self._base:
            return f"Settings({changes})"
        return f"Settings.preset({self._base!r})" + (f".replace({changes})" if changes else "")

    def _repr_html_(self) -> str:
        differing = self.differences()
        rows = []
        for name, value in self._values.items():
            cell = f"<b>{html.escape(repr(value))}</b>" if name in differing else html.escape(repr(value))
            knob = KNOBS[name]
            rows.append(
                f"<tr><td><code>{name}</code></td><td>{cell}</td>"
                f"<td>{html.escape(knob.unit)}</td><td>{html.escape(knob.doc)}</td></tr>"
            )
        head = "<tr><th>setting</th><th>value</th><th>unit</th><th>meaning</th></tr>"
        return f"<table><caption>{html.escape(repr(self))}</caption>{head}{''.join(rows)}</table>"


def _restore(base: str, values: dict[str, SettingValue]) -> Settings:
    # values are checked again: the table may have moved on since they were pickled
    return Settings._make(base if PRESETS.get(base) is not None else "", Settings(**values)._values)


def presets() -> dict[str, Settings]:
    """The presets that can be rendered now, by name.

    Returns
    -------
    dict of str to Settings
        Those whose passes exist. The other names of the papers are known to `Settings.preset`, which
        says that they are not available yet.
    """
    return {name: Settings.preset(name) for name, overrides in PRESETS.items() if overrides is not None}


def as_settings(settings: Settings | str | None) -> Settings:
    """Settings from what a `settings=` argument may be: `Settings`, the name of a preset, or None.

    Raises
    ------
    SettingsError
        For anything else, or a preset that is unknown or not available yet.
    """
    if settings is None:
        return Settings.preset("default")
    if isinstance(settings, str):
        return Settings.preset(settings)
    if isinstance(settings, Settings):
        return settings
    fail("settings", settings, "Settings, the name of a preset, or None", SettingsError)


def _docstring() -> str:
    lines = [
        "Every knob of a render; frozen and keyword-only.",
        "",
        "Two settings are equal when all their values are. Settings hash and pickle; `replace` makes a",
        "changed copy, `preset` names a starting point; an unknown name is an error that suggests the",
        "nearest one.",
        "A setting that is 'on' or 'off' also takes a bool.",
        "`Settings(...)` starts from the defaults below; `Settings.preset('default')` is what a render uses",
        "when it is given no settings.",
        "",
        "Parameters",
        "----------",
    ]
    for knob in KNOBS.values():
        kind = {"int": "int", "float": "float", "switch": "'off' or 'on'"}.get(knob.kind, "choice")
        lines.append(f"{knob.name} : {kind}, default {knob.default!r}")
        lines += textwrap.wrap(knob.summary(), 104, initial_indent="    ", subsequent_indent="    ")
    lines += [
        "",
        "Raises",
        "------",
        "SettingsError",
        "    For an unknown name or a value that is not allowed.",
    ]
    there = [name for name, overrides in PRESETS.items() if overrides is not None]
    lines += ["", "Notes", "-----", f"Presets available now: {', '.join(there)}."]
    return "\n".join(lines)


Settings.__doc__ = _docstring()
setattr(  # noqa: B010 -- a class has no such attribute for a type checker
    Settings,
    "__signature__",
    inspect.Signature(
        [
            inspect.Parameter(knob.name, inspect.Parameter.KEYWORD_ONLY, default=knob.default)
            for knob in KNOBS.values()
        ]
    ),
)
