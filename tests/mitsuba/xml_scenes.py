"""Mitsuba scenes as XML files, for tests."""

from __future__ import annotations

from pathlib import Path


def scene_of(*bodies: str) -> str:
    return '<scene version="3.0.0">' + "".join(bodies) + "</scene>"


def write(folder: Path, *bodies: str) -> Path:
    path = folder / "scene.xml"
    path.write_text(scene_of(*bodies), encoding="utf-8")
    return path
