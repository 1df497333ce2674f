"""Whole trimesh scenes, lists and files into a `Scene`: the work behind ``Scene.from_trimesh``."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from .camera import Camera
from .convert import TextureCache
from .errors import SceneError
from .mesh_input import as_transform, from_mesh, instance
from .validate import as_choice, fail

if TYPE_CHECKING:
    from .geometry import MeshInstance, Shading
    from .scene import Scene

__all__ = ["read_into"]


def read_into(scene: Scene, source: Any, shading: Shading) -> None:
    """Add everything of a trimesh scene, mesh, list of them, or file to a scene that is new."""
    as_choice(shading, "shading", ("smooth", "flat"))
    if isinstance(source, (str, Path)):
        source = _load(Path(source))
    items = list(source) if isinstance(source, (list, tuple)) else [source]
    for k, item in enumerate(items):
        if not isinstance(item, (trimesh.Scene, trimesh.Trimesh)):
            name = "source" if item is source else f"source[{k}]"
            fail(name, item, "a trimesh.Scene, a trimesh.Trimesh, a list of them, or a file's path")
    textures: TextureCache = {}
    for item in items:
        if isinstance(item, trimesh.Scene):
            _add_graph(scene, item, shading, textures)
        else:
            name = _free(scene, _own_name(item) or f"mesh_{len(scene.meshes)}")
            scene._insert(from_mesh(name, item, None, None, shading, textures))


def _load(path: Path) -> Any:
    if not path.is_file():
        raise SceneError(
            f"source is {str(path)!r}: no such file; allowed: a mesh or scene file that trimesh loads"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of loaders, about files that load all the same
            loaded = trimesh.load(str(path), process=False)
    except Exception as error:  # loaders raise whatever their parser stumbles over
        raise SceneError(
            f"source is {str(path)!r}, which cannot be read ({type(error).__name__}: {error}); "
            "allowed: a complete mesh or scene file that trimesh loads"
        ) from error
    # what loaders make of some files that were cut short
    if isinstance(loaded, trimesh.Scene) and not loaded.geometry:
        raise SceneError(f"source is {str(path)!r}, which holds no mesh; allowed: a complete file with one")
    return loaded


def _add_graph(scene: Scene, source: trimesh.Scene, shading: Shading, textures: TextureCache) -> None:
    first: dict[Any, MeshInstance] = {}  # by geometry name: what several nodes share is converted once
    for node in source.graph.nodes_geometry:
        matrix, geometry_name = source.graph[node]
        mesh = source.geometry[geometry_name]
        if not isinstance(mesh, trimesh.Trimesh):
            scene._add_note(f"{node!s} ({type(mesh).__name__}) is no triangle mesh and was left out")
            continue
        name = _free(scene, str(node).strip() or str(geometry_name))
        try:
            transform = as_transform(matrix)
        except SceneError as error:
            raise SceneError(f"mesh {name!r}: {error}") from error
        known = first.get(geometry_name)
        if known is None:
            made = first[geometry_name] = from_mesh(name, mesh, None, transform, shading, textures)
        else:
            made = instance(name, known.geometry, transform, known.material, shading, known.notes)
        scene._insert(made)
    camera = _camera(source)
    if camera is not None:
        scene.cameras[_free_key(scene.cameras, str(source.camera.name))] = camera


def _camera(source: trimesh.Scene) -> Camera | None:
    """Take over the camera that was set, with square pixels unless focal lengths in pixels were given."""
    if not source.has_camera or source.camera.name not in source.graph.nodes:
        return None
    camera = source.camera
    pose: NDArray[np.float64] = np.array(source.camera_transform, dtype=np.float64)
    scale = np.linalg.norm(
        pose[:3, :3], axis=0
    )  # of parent nodes: it moves the camera and has no other meaning
    pose[:3, :3] /= scale
    width, height = (int(n) for n in camera.resolution)
    if getattr(camera, "_focal_computed", True):
        # glTF knows only the vertical field of view, and trimesh's viewer uses only that, too
        return Camera(pose, float(camera.fov[1]), width, height)
    return Camera.from_intrinsics(camera.K, pose, width, height)


def _own_name(mesh: trimesh.Trimesh) -> str | None:
    name = mesh.metadata.get("name")
    return name.strip() or None if isinstance(name, str) else None


def _free(scene: Scene, name: str) -> str:
    return _free_key({**scene.meshes, **scene.lights}, name)


def _free_key(taken: Any, name: str) -> str:
    chosen, k = name, 1
    while chosen in taken:
        chosen, k = f"{name}_{k}", k + 1
    return chosen
