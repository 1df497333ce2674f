"""Files that Mitsuba is not left to read unseen: it crashes on some that are damaged."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from miplight.errors import SceneError

__all__ = ["check_mesh", "read_exr"]


def check_mesh(path: Path) -> None:
    """Look at the corners of a PLY file: Mitsuba 3.9 follows those beyond the last vertex.

    Raises
    ------
    SceneError
        If there are such, or the file is damaged in another way.
    """
    if path.suffix.lower() != ".ply":
        return
    head, end, body = path.read_bytes().partition(b"end_header")
    plain = bytes(byte if byte < 128 else ord("?") for byte in head)  # comments are in any encoding
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = trimesh.load(io.BytesIO(plain + end + body), file_type="ply", process=False)
    except Exception as error:  # the parser raises whatever it stumbles over
        raise SceneError(
            f"{path.name} cannot be read ({type(error).__name__}: {error}); allowed: a whole PLY file"
        ) from error
    faces, count = np.asarray(getattr(mesh, "faces", ())), len(getattr(mesh, "vertices", ()))
    beyond = faces[(faces < 0) | (faces >= count)]
    if beyond.size:
        raise SceneError(
            f"{path.name} is damaged: a triangle has vertex {int(beyond[0])}; allowed: 0 to {count - 1}"
        )


def read_exr(path: Path) -> NDArray[Any]:
    """Read an EXR image with the OpenEXR package: Mitsuba 3.9 ends the process where one is cut short.

    Returns
    -------
    (h, w, c) float16 or float32
        Channels R G B, or Y alone.

    Raises
    ------
    SceneError
        If the file is damaged or has other channels.
    """
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
        names = "RGB" if "R" in channels else "Y"
        return np.stack([channels[name] for name in names], axis=-1)
    except Exception as error:  # it raises whatever its reader stumbles over
        raise SceneError(
            f"{path.name} cannot be read ({type(error).__name__}: {error}); allowed: a whole EXR file "
            "with R, G and B, or Y"
        ) from error
