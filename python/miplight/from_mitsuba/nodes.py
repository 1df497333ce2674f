"""A parsed Mitsuba scene as a tree of nodes, with names for messages and absolute paths."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miplight.errors import SceneError

from .files import check_mesh, read_exr

__all__ = ["Document", "Node"]


class Node:
    """One object of the scene: kind ("Shape", "BSDF", …), plugin, id, and its properties by name."""

    def __init__(self, document: Document, index: int) -> None:
        self.document, self.index = document, index
        raw = document.raw[index]
        self.kind = str(raw.type).rsplit(".", 1)[-1]
        self.plugin = str(raw.props.plugin_name())
        identifier = str(raw.props.id())
        self.id = "" if identifier.startswith("_") else identifier
        self.folder = document.folder_of(raw)
        self.values: dict[str, Any] = {}
        for name, value in raw.props.items():
            is_node = type(value).__name__ == "ResolvedReference"
            self.values[name] = Node(document, int(value.index())) if is_node else value

    def children(self, kind: str | None = None) -> list[Node]:
        """Return child objects, of one kind or all."""
        nodes = [value for value in self.values.values() if isinstance(value, Node)]
        return [node for node in nodes if kind is None or node.kind == kind]

    def get(self, name: str, default: Any = None) -> Any:
        """Return a property, or `default` if the scene does not set it."""
        return self.values.get(name, default)

    def matrix(self, name: str = "to_world") -> NDArray[np.float64]:
        """Return a transform; the identity if the scene does not set it."""
        value = self.values.get(name)
        if value is None:
            return np.eye(4)
        matrix = np.array(value.matrix, dtype=np.float64)
        if not np.isfinite(matrix).all():
            raise SceneError(f"{name} is {matrix.tolist()}; allowed: finite numbers")
        return matrix

    def path(self) -> Path:
        """Return the file that a plugin reads; beside the scene or beside the file that names it."""
        name = Path(str(self.values.get("filename", "")))
        for folder in (self.document.folder, self.folder, Path.cwd()):
            if (folder / name).is_file():
                return folder / name
        raise SceneError(
            f"filename is {str(name)!r}, which is not in {self.document.folder}; allowed: a file that exists"
        )

    def _file(self) -> dict[str, Any]:
        """Return a plugin's file as ``load_dict`` takes it: by absolute path, or what was read of it."""
        path = self.path()
        if self.plugin == "bitmap" and path.suffix.lower() == ".exr":
            return {"bitmap": self.document.mi.Bitmap(read_exr(path))}
        check_mesh(path)
        return {"filename": str(path)}

    def as_dict(self, *leave_out: str) -> dict[str, Any]:
        """Return what ``mitsuba.load_dict`` takes, with files by absolute path."""
        result: dict[str, Any] = {"type": self.plugin}
        if self.plugin == "bitmap" and not {"filename", "bitmap", "data"} & set(self.values):
            raise SceneError("a bitmap has no filename; allowed: one that has")  # Mitsuba 3.9 crashes
        for name, value in self.values.items():
            if name in leave_out or (isinstance(value, Node) and value.kind in leave_out):
                continue
            if name == "filename":
                result |= self._file()
            else:
                result[name] = value.as_dict() if isinstance(value, Node) else value
        return result


class Document:
    """A parsed scene, and the notes that reading it collects."""

    def __init__(self, mi: Any, state: Any, name: str, folder: Path) -> None:
        self.mi, self.state, self.name, self.folder = mi, state, name, folder
        self.raw = list(state.nodes)
        self._notes: dict[str, list[str]] = {}
        self.root = Node(self, 0)

    @classmethod
    def parse(cls, mi: Any, source: Any, parameters: dict[str, Any]) -> Document:
        """Run Mitsuba's parser and resolve references; meshes are not merged.

        Raises
        ------
        SceneError
            With the parser's own message, which names file, line and what is wrong.
        """
        config = mi.parser.ParserConfig(mi.variant())
        config.merge_meshes = config.merge_equivalent = False
        parser = mi.parser
        try:
            if isinstance(source, dict):
                name, folder = "the dict", Path.cwd()
                state = parser.parse_dict(config, source)
            else:
                path = _existing(source)
                name, folder = path.name, path.parent
                texts = {key: str(value) for key, value in parameters.items()}
                state = parser.parse_file(config, str(path), **texts)
            parser.transform_upgrade(config, state)
            parser.transform_resolve_references(config, state)
        except SceneError:
            raise
        except Exception as error:  # the parser raises RuntimeError, the dict form several others
            raise SceneError(f"{name} is no Mitsuba scene: {error}") from error
        try:
            document = cls(mi, state, name, folder)
        except UnicodeDecodeError as error:  # of names and values, which the parser takes as they are
            raise SceneError(
                f"{name} is no Mitsuba scene: it has text that is not UTF-8 ({error})"
            ) from error
        if document.root.kind != "Scene":
            raise SceneError(f"{name} holds a {document.root.kind}; allowed: a scene")
        return document

    def folder_of(self, raw: Any) -> Path:
        """Return the folder of the file that a node stands in."""
        files = list(self.state.files)
        inside = 0 <= raw.file_index < len(files)
        return Path(str(files[raw.file_index])).resolve().parent if inside else self.folder

    def describe(self, node: Node) -> str:
        """Name a node for a message: its kind, id, plugin and file."""
        label = (
            f"{node.kind.lower()} {node.id!r} ({node.plugin}"
            if node.id
            else f"{node.kind.lower()} ({node.plugin}"
        )
        file = node.get("filename")
        return label + (f", {file})" if file else ")")

    def free_name(self, node: Node, fallback: str, taken: Iterable[str]) -> str:
        """Return the id of a node, its file or `fallback` as a name, numbered until it is free."""
        base = node.id or Path(str(node.get("filename", ""))).stem or fallback
        used, name, count = set(taken), base, 1
        while name in used:
            count += 1
            name = f"{base}_{count}"
        return name

    def note(self, text: str, name: str) -> None:
        """Remember something to report about the object `name`."""
        names = self._notes.setdefault(text, [])
        if name not in names:
            names.append(name)

    def notes(self) -> list[str]:
        """Return one line for each thing to report, with all names that it concerns."""
        return [f"{text}: {', '.join(names)}" for text, names in self._notes.items()]

    def instantiate(self, description: dict[str, Any]) -> Any:
        """Let Mitsuba make an object.

        Raises
        ------
        SceneError
            With Mitsuba's message.
        """
        try:
            return self.mi.load_dict(description)
        except Exception as error:  # missing and broken files, unknown plugins, bad values: all the same here
            raise SceneError(f"Mitsuba cannot load it: {error}") from error


def _existing(source: Any) -> Path:
    if not isinstance(source, (str, os.PathLike)):
        raise SceneError(f"source is a {type(source).__name__}; allowed: a path or a dict")
    path = Path(source)
    if not path.is_file():
        raise SceneError(
            f"source is {str(source)!r}, which is no file; allowed: a Mitsuba XML file or a dict"
        )
    return path.resolve()
