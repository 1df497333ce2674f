"""The table of settings as Python sees it: one `Knob` per row of the core's table, and checks on values.

Nothing here states a default, a range or a name: all of that comes from `miplight._core.setting_specs`.
"""

from __future__ import annotations

import math
import numbers
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from . import _core
from .errors import SettingsError
from .validate import fail, nearest_name, show

SettingValue: TypeAlias = str | int | float | bool | None


def unknown(what: str, name: object, known: Iterable[str]) -> SettingsError:
    """Make the error for a name that does not exist: it suggests the nearest one, or lists all."""
    names = list(known)
    hint = nearest_name(name, names) if isinstance(name, str) else ""
    return SettingsError(f"there is no {what} {show(name)}{hint or '; known: ' + ', '.join(names)}")


@dataclass(frozen=True)
class Knob:
    """One setting: what it may be, what it is by default, and what it means."""

    name: str
    kind: str
    default: SettingValue
    choices: tuple[SettingValue, ...]
    available: tuple[SettingValue, ...]
    minimum: float | None
    maximum: float | None
    exclusive_minimum: bool
    nullable: bool
    pending: bool
    unit: str
    doc: str
    source: str
    multiple_of: int = 1

    @classmethod
    def from_core(cls, spec: Mapping[str, Any]) -> Knob:
        """Read one row of `_core.setting_specs()`."""
        choices = tuple(spec["choices"] or ())
        switch = set(choices) == {"off", "on"}
        return cls(
            name=spec["name"],
            kind="switch" if switch else spec["kind"],
            default=spec["default"],
            choices=("off", "on") if spec["kind"] == "switch" and not choices else choices,
            available=tuple(spec["available"] or ()),
            minimum=spec["minimum"],
            maximum=spec["maximum"],
            exclusive_minimum=bool(spec["exclusive_minimum"]),
            nullable=bool(spec["nullable"]),
            pending=bool(spec.get("pending", False)),
            unit=spec["unit"] or "",
            doc=spec["doc"],
            source=spec["source"] or "",
            multiple_of=spec.get("multiple_of", 1),
        )

    def check(self, value: object) -> SettingValue:
        """`value` in its canonical form.

        Raises
        ------
        SettingsError
            If the value has the wrong type, is out of range, or belongs to what is not available yet.
        """
        if value is None and (self.nullable or self.default is None):
            return None
        if isinstance(value, (bool, np.bool_)) and self.kind == "switch":
            value = "on" if value else "off"
        checked = self._choice(value) if self.choices else self._number(value)
        if checked == self.default:
            return checked
        if self.pending:
            raise SettingsError(
                f"setting {self.name!r} is not available yet: {show(value)} was given; "
                f"leave it at its default, {self.default!r}"
            )
        if self.available and checked not in self.available:
            raise SettingsError(
                f"{self.name}={value!r} is not available yet; available: {_listed(self.available)}"
            )
        return checked

    def _choice(self, value: object) -> SettingValue:
        if isinstance(value, numbers.Integral) and not isinstance(value, bool):
            value = int(value)
        # `True == 1` and `1.0 == 1`: a choice must also have the choice's type
        for choice in self.choices:
            if type(choice) is type(value) and choice == value:
                return choice
        hint = nearest_name(value, map(str, self.choices)) if isinstance(value, str) else ""
        fail(self._title, value, self.allowed() + hint, SettingsError)

    @property
    def _title(self) -> str:
        return f"setting {self.name!r}"

    def _number(self, value: object) -> SettingValue:
        try:
            if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
                raise TypeError
            number = operator.index(value) if self.kind == "int" else float(value)  # type: ignore[arg-type]
        except TypeError:
            fail(self._title, value, self.allowed(), SettingsError)
        below = self.minimum is not None and (
            number < self.minimum or (self.exclusive_minimum and number == self.minimum)
        )
        above = self.maximum is not None and number > self.maximum
        if below or above or not math.isfinite(number) or self._between(number):
            fail(self._title, value, self.allowed(), SettingsError)
        return number

    def _between(self, number: float) -> bool:
        """True for a number between two multiples of what has to divide it."""
        return self.multiple_of > 1 and number % self.multiple_of != 0

    def allowed(self) -> str:
        """What the setting may be, in words."""
        if self.choices:
            also = " (or a bool)" if self.kind == "switch" else ""
            return _listed(self.choices) + also
        kind = "a whole number" if self.kind == "int" else "a number"
        if self.multiple_of > 1:
            kind = f"a multiple of {self.multiple_of}"
        parts = []
        if self.minimum is not None:
            parts.append(
                f"above {self.minimum:g}" if self.exclusive_minimum else f"from {_plain(self.minimum)}"
            )
        if self.maximum is not None and self.maximum < 1e300:
            parts.append(f"up to {_plain(self.maximum)}")
        return " ".join([kind, *parts]) + (" or None" if self.nullable or self.default is None else "")

    def summary(self) -> str:
        """What the setting does, its unit, its range and its source, as one paragraph."""
        text = self.doc
        if self.unit:
            text += f" Unit: {self.unit}."
        text += f" Allowed: {self.allowed()}."
        if self.pending:
            text += " Not available yet."
        elif len(self.available) < len(self.choices) and self.available:
            text += f" Available now: {_listed(self.available)}."
        return f"{text} {self.source}".rstrip()


def _plain(number: float) -> str:
    return str(int(number)) if float(number).is_integer() else f"{number:g}"


def _listed(values: Iterable[SettingValue]) -> str:
    return ", ".join(repr(v) for v in values)


KNOBS: dict[str, Knob] = {knob.name: knob for knob in map(Knob.from_core, _core.setting_specs())}
"""Every setting by name, in the order in which they are documented."""

PRESETS: dict[str, dict[str, Any] | None] = dict(_core.presets())
"""Overrides of each preset; `None` where the name is known but the preset is not available yet."""


def checked(changes: Mapping[str, object]) -> dict[str, SettingValue]:
    """`changes` with every name known and every value in its canonical form.

    Raises
    ------
    SettingsError
        For an unknown name (the nearest is suggested) or a value that is not allowed.
    """
    values = {}
    for name, value in changes.items():
        knob = KNOBS.get(name)
        if knob is None:
            raise unknown("setting", name, KNOBS)
        values[name] = knob.check(value)
    return values
