"""The files that hold frames: NumPy archives (everything) and OpenEXR (the image)."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError
from .stats import Stats
from .validate import fail

Parts: TypeAlias = tuple[dict[str, NDArray[Any]], dict[str, Any], dict[str, Any], tuple[int, int]]
"""Arrays, settings, statistics, (width, height)."""

_FORMAT = "miplight-frame-1"
_NO_STATS: dict[str, Any] = {
    "total_ms": 0.0,
    "stages": {},
    "readback_ms": 0.0,
    "rays": 0,
    "light_evaluations": 0,
    "skipped": {},
    "empty": [],
    "rebuilt": [],
    "adapter": "unknown",
}


SAVED = (".exr", ".png", ".npz")
"""Suffixes that a frame can be written to."""


def checked_suffix(path: Path, allowed: tuple[str, ...]) -> str:
    """The lower-case suffix of `path`.

    Raises
    ------
    SceneError
        If it is none of `allowed`.
    """
    suffix = path.suffix.lower()
    if suffix not in allowed:
        fail("path", str(path), f"a file name that ends in {', '.join(allowed)}")
    return suffix


def checked_file(path: Path) -> Path:
    """`path`, if it is a file.

    Raises
    ------
    SceneError
        If it is not.
    """
    if not path.is_file():
        fail("path", str(path), "a file that exists")
    return path


def write_npz(
    path: Path,
    arrays: Mapping[str, NDArray[Any]],
    settings: Mapping[str, Any],
    stats: Mapping[str, Any],
    size: tuple[int, int],
) -> None:
    """Write every array, with settings and statistics as JSON."""
    about = {"format": _FORMAT, "settings": dict(settings), "stats": dict(stats), "size": list(size)}
    # written whole or not at all: a full disk must not leave half an archive under the final name
    buffer = io.BytesIO()
    named: dict[str, Any] = {f"array:{name}": array for name, array in arrays.items()}
    np.savez_compressed(buffer, about=np.array(json.dumps(about)), **named)
    path.write_bytes(buffer.getvalue())


def read_npz(path: Path) -> Parts:
    """Read what `write_npz` wrote.

    Raises
    ------
    SceneError
        If the file is no such archive, or cut short.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            about = json.loads(str(archive["about"]))
            arrays = {key.removeprefix("array:"): archive[key] for key in archive.files if key != "about"}
        if about["format"] != _FORMAT:
            raise ValueError(f"format {about['format']!r}")
        width, height = about["size"]
        return _whole(arrays, about["settings"], about["stats"], (int(width), int(height)))
    except Exception as error:  # zip, zlib, NumPy and JSON raise whatever they stumble over
        raise SceneError(f"{path} is not a frame that Frame.save wrote, or is cut short: {error}") from error


def _whole(arrays: dict[str, NDArray[Any]], settings: Any, stats: Any, size: tuple[int, int]) -> Parts:
    """The parts of a frame, if they fit together; a `ValueError` or `TypeError` if not."""
    if not isinstance(settings, dict) or not isinstance(stats, dict):
        raise TypeError("settings and statistics are no tables")
    Stats.from_dict(stats)
    width, height = size
    image = arrays.get("image")
    if image is not None and image.shape != (height, width, 3):
        raise ValueError(f"the image has shape {image.shape}; allowed: {(height, width, 3)}")
    return arrays, settings, stats, size


def write_exr(
    path: Path, image: NDArray[np.float32], settings: Mapping[str, Any], stats: Mapping[str, Any]
) -> None:
    """Write the image as 32-bit float R, G, B; settings and statistics go into the header as JSON."""
    import OpenEXR

    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "miplight:settings": json.dumps(dict(settings)),
        "miplight:stats": json.dumps(dict(stats)),
    }
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(image, np.float32)}).write(str(path))


def read_exr(path: Path) -> Parts:
    """Read the R, G, B channels of an EXR file.

    Raises
    ------
    SceneError
        If it has no such channels, or is cut short.
    """
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels, header = file.channels(), dict(file.header())
            image = np.stack([channels[name].pixels for name in "RGB"], axis=-1).astype(np.float32)
        settings = json.loads(header.get("miplight:settings", "{}"))
        stats = json.loads(header.get("miplight:stats", "null")) or _NO_STATS
        height, width = image.shape[:2]
        return _whole({"image": image}, settings, stats, (width, height))
    except Exception as error:  # the reader raises whatever it stumbles over, and so does JSON
        raise SceneError(f"{path} is not an EXR file with R, G and B, or is cut short: {error}") from error
