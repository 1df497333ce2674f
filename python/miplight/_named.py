"""Views of a scene's parts by name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NoReturn, TypeVar

from .errors import SceneError
from .validate import nearest_name

__all__ = ["Named", "unknown_name"]

_Item = TypeVar("_Item")


class Named(Mapping[str, _Item]):
    """Live, read-only view; an unknown name is a `SceneError` that suggests the nearest one."""

    def __init__(self, items: dict[str, _Item], kind: str) -> None:
        self._items, self._kind = items, kind

    def __getitem__(self, name: str) -> _Item:
        try:
            return self._items[name]
        except (KeyError, TypeError):
            unknown_name(name, self._kind, self._items)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._items

    def get(self, name: str, default: Any = None) -> Any:
        """Return the item of that name, or `default`."""
        return self._items.get(name, default)

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._items))

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return repr(self._items)


def unknown_name(name: object, kind: str, names: Iterable[str]) -> NoReturn:
    """Raise the error for a name that nothing has."""
    known = list(names)
    hint = nearest_name(name, known) if isinstance(name, str) else ""
    listed = ", ".join(map(repr, known[:12])) + (", …" if len(known) > 12 else "")
    raise SceneError(f"no {kind} is named {name!r}{hint}; allowed: {listed or 'nothing, there is none'}")
