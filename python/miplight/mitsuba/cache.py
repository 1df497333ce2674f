"""Pictures that took long to compute, kept on disk by the hash of everything that they depend on."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from miplight.light import AreaLight

if TYPE_CHECKING:
    from miplight.camera import Camera
    from miplight.scene import Scene

__all__ = ["cache_folder", "content_key", "load", "store"]

# Raise it when the estimator changes what it computes: everything that was kept is then forgotten.
_FORMAT = 2
_MESH_ARRAYS = ("positions", "triangles", "normals", "uvs", "colors", "transform")
_AREA_FIELDS = ("corner", "edge_u", "edge_v", "radiance", "two_sided", "visible", "filter")
_SPOT_FIELDS = ("position", "target", "intensity", "cutoff")


def cache_folder() -> Path:
    """Where pictures are kept: ``MIPLIGHT_CACHE``, or ``miplight`` in the system's folder for caches."""
    named = os.environ.get("MIPLIGHT_CACHE")
    if named:
        return Path(named).expanduser()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", str(Path.home()))) / "miplight" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "miplight"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "miplight"


def content_key(scene: Scene, camera: Camera, **settings: Any) -> str:
    """Hash all that a picture depends on: geometry, materials, lights, camera, and `settings` by name.

    Names of meshes and lights do not count, nor does where an array came from.

    Returns
    -------
    str
        40 hexadecimal digits.
    """
    digest = hashlib.blake2b(digest_size=20)
    _feed(digest, "format", _FORMAT)
    for mesh in scene.meshes.values():
        for field in _MESH_ARRAYS:
            _feed(digest, field, getattr(mesh, field))
        _feed(digest, "shading", mesh.shading)
        for field in ("albedo", "specular", "shininess"):
            _feed(digest, field, getattr(mesh.material, field))
    for light in scene.lights.values():
        _feed(digest, "light", type(light).__name__)
        fields = _AREA_FIELDS if isinstance(light, AreaLight) else _SPOT_FIELDS
        for field in fields:
            _feed(digest, field, getattr(light, field))
    _feed(digest, "pose", camera.world_from_camera)
    _feed(digest, "intrinsics", camera.K)
    _feed(digest, "size", (camera.width, camera.height))
    for name in sorted(settings):
        _feed(digest, name, settings[name])
    return digest.hexdigest()


def load(key: str) -> dict[str, NDArray[Any]] | None:
    """Read the arrays kept under `key`; None if there are none, or they cannot be read."""
    try:
        with _path(key).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def store(key: str, arrays: Mapping[str, NDArray[Any]]) -> Path | None:
    """Keep arrays under `key`, as a whole or not at all; None if the folder cannot be written."""
    path = _path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, **dict(arrays))  # type: ignore[arg-type]
            Path(name).replace(path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError:
        return None
    return path


def _path(key: str) -> Path:
    return cache_folder() / "references" / f"{key}.npz"


def _feed(digest: Any, name: str, value: Any) -> None:
    """Add one named value; the shape goes in too, so that no two lists of values look alike."""
    if value is None or isinstance(value, (str, bool, int, float, tuple)):
        digest.update(f"{name}={value!r};".encode())
        return
    array = np.ascontiguousarray(value)
    digest.update(f"{name}:{array.dtype.str}{array.shape};".encode())
    digest.update(array.tobytes())
