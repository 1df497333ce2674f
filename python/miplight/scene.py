"""Meshes, lights and cameras: everything that a frame is rendered from."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from ._named import Named, unknown_name
from .camera import Camera
from .errors import SceneError
from .geometry import MeshInstance, Shading
from .light import AreaLight, Light, SpotLight
from .material import Material
from .mesh_input import as_transform, deform, from_arrays, from_mesh, recolor
from .report import MeshReport, SceneReport
from .validate import as_name, fail

if TYPE_CHECKING:
    from . import _core

__all__ = ["Scene"]


class Scene:
    """Triangle meshes with materials, area and spot lights, and cameras by name.

    A scene may be changed between renders and shared by threads: a render takes it as it is when it is
    called. A method that raises leaves the scene as it was. Scenes pickle.

    Examples
    --------
    >>> import miplight as ml, trimesh
    >>> scene = ml.Scene()
    >>> scene.add_mesh(trimesh.creation.icosphere(), name="ball", material=ml.Material((0.8, 0.7, 0.6)))
    'ball'
    >>> scene.add_light(ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), radiance=(12, 12, 12)), name="tv")
    'tv'
    >>> scene.lights["tv"].radiance = (6.0, 6.0, 6.0)
    >>> scene
    <Scene: 1 mesh, 1,280 triangles, 1 light, 0 cameras>
    """

    def __init__(self) -> None:
        self._meshes: dict[str, MeshInstance] = {}
        self._lights: dict[str, Light] = {}
        self._notes: list[str] = []
        self.cameras: dict[str, Camera] = {}
        """Cameras of the file that the scene came from, by name; yours to add to."""
        self._lock = threading.RLock()

    # -- where scenes come from

    @classmethod
    def from_trimesh(cls, source: Any, *, shading: Shading = "smooth") -> Scene:
        """Take over a trimesh scene, a mesh, a list of them, or a file that trimesh loads.

        Transforms, base colours, base-colour textures and vertex or face colours come along, and the camera
        if one was set; the same geometry at several nodes is stored once. Emissive and transparent materials
        are reported in `report`, not lit. How materials are read is documented in `miplight.convert`.

        Parameters
        ----------
        source : trimesh.Scene, trimesh.Trimesh, list of either, str or Path
            A file is loaded with ``process=False``, so that its vertices stay as they are.
        shading : {"smooth", "flat"}, default "smooth"
            Interpolate vertex normals (of the file, or else computed), or use face normals.

        Raises
        ------
        SceneError
            For another type, a file that is missing or broken, and for each mesh as `add_mesh` does.
        """
        from .trimesh_scene import read_into

        scene = cls()
        read_into(scene, source, shading)
        return scene

    @classmethod
    def from_mitsuba(cls, source: Any) -> Scene:
        """Take over a Mitsuba scene: an XML file or the dict that ``mitsuba.load_dict`` takes.

        Meshes, diffuse and rough BSDFs (mapping documented in `miplight.from_mitsuba`), rectangle and spot
        emitters and perspective cameras come along; the rest is refused or reported by name. Needs the
        package ``mitsuba``.

        Raises
        ------
        SceneError
            For a file that is missing or broken and for what cannot be rendered.
        """
        from . import from_mitsuba

        scene: Scene = from_mitsuba.load(source)
        return scene

    # -- adding

    def add_mesh(
        self,
        mesh: trimesh.Trimesh,
        name: str | None = None,
        material: Material | None = None,
        transform: ArrayLike | None = None,
        shading: Shading = "smooth",
    ) -> str:
        """Add a trimesh mesh.

        Parameters
        ----------
        mesh : trimesh.Trimesh
            Its arrays are copied. Triangles without area or with vertices that are not finite are dropped and
            counted in `report`.
        name : str, optional
            Unique among meshes and lights; ``mesh_0``, ``mesh_1``, … by default.
        material : Material, optional
            By default what the mesh's own visual says (see `miplight.convert`); a material given here
            replaces it, vertex colours included.
        transform : array_like, (4, 4), optional
            ``world_from_object``; the identity by default. It may mirror and stretch, but not flatten.
        shading : {"smooth", "flat"}, default "smooth"
            Interpolate the mesh's vertex normals, or use face normals.

        Returns
        -------
        str
            The name.

        Raises
        ------
        SceneError
            If the mesh is no ``trimesh.Trimesh``, is empty, has an index out of range or no triangle left;
            for a duplicate name, a singular transform, or an image-valued albedo without UVs.
        """
        with self._lock:
            chosen = self._free_name(name, "mesh")
            return self._insert(from_mesh(chosen, mesh, material, transform, shading, {}))

    def add_arrays(
        self,
        positions: ArrayLike,
        triangles: ArrayLike,
        *,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        name: str | None = None,
        material: Material | None = None,
        transform: ArrayLike | None = None,
        shading: Shading = "smooth",
    ) -> str:
        """Add a mesh from plain arrays of any dtype, order and stride.

        Parameters
        ----------
        positions : (V, 3)
            Vertices, scene units; float64 is kept exactly.
        triangles : (F, 3)
            Indices of their corners.
        normals : (V, 3), optional
            Shading normals of any length; by default averaged over the faces around each vertex. Flat meshes
            need none.
        uvs : (V, 2), optional
            Texture coordinates, v = 0 at the bottom of the image.
        colors : (V, 3) floats in [0, 1], optional
            Linear RGB that multiplies the material's albedo.
        name, material, transform, shading
            As for `add_mesh`; the default material is white if there are `colors`, else grey.

        Returns
        -------
        str
            The name.

        Raises
        ------
        SceneError
            As for `add_mesh`, and for arrays of a wrong shape.
        """
        arrays = {
            "positions": positions,
            "triangles": triangles,
            "normals": normals,
            "uvs": uvs,
            "colors": colors,
        }
        with self._lock:
            chosen = self._free_name(name, "mesh")
            return self._insert(from_arrays(chosen, arrays, material, transform, shading))

    def add_light(self, light: Light, name: str | None = None) -> str:
        """Add a light. The scene keeps the very object: change its properties and the next render shows it.

        Parameters
        ----------
        light : AreaLight or SpotLight
        name : str, optional
            Unique among meshes and lights; ``light_0``, ``light_1``, … by default.

        Returns
        -------
        str
            The name.

        Raises
        ------
        SceneError
            For another type or a duplicate name.
        """
        if not isinstance(light, (AreaLight, SpotLight)):
            fail("light", light, "an AreaLight or a SpotLight")
        with self._lock:
            chosen = self._free_name(name, "light")
            self._lights[chosen] = light
            return chosen

    # -- changing

    def set_transform(self, name: str, transform: ArrayLike) -> None:
        """Move a mesh: ``world_from_object``, (4, 4), any dtype. No BVH of a mesh is rebuilt for it.

        Raises
        ------
        SceneError
            For an unknown name or a matrix that is not affine, not finite or singular.
        """
        with self._lock:
            self._meshes[name] = self.meshes[name].moved(as_transform(transform))

    def set_vertices(self, name: str, vertices: ArrayLike, normals: ArrayLike | None = None) -> None:
        """Deform a mesh: new vertices for the same triangles. Only this mesh's BVH is built again.

        Parameters
        ----------
        name : str
        vertices : (V, 3)
            As many as before, any dtype, object space. Triangles dropped before may come back and the
            reverse.
        normals : (V, 3), optional
            Shading normals; by default smooth normals are computed anew (vertices that shared position and
            normal keep sharing one).

        Raises
        ------
        SceneError
            For an unknown name, a wrong shape, no triangle left, or normals for a flat mesh.
        """
        with self._lock:
            self._meshes[name] = deform(self.meshes[name], vertices, normals)

    def set_material(self, name: str, material: Material) -> None:
        """Give a mesh another material; it replaces vertex colours, too.

        Raises
        ------
        SceneError
            For an unknown name, another type, or an image-valued albedo on a mesh without UVs.
        """
        with self._lock:
            self._meshes[name] = recolor(self.meshes[name], material)

    def remove(self, name: str) -> None:
        """Take a mesh or a light out of the scene.

        Raises
        ------
        SceneError
            For an unknown name.
        """
        with self._lock:
            for parts in (self._meshes, self._lights):
                if isinstance(name, str) and name in parts:
                    del parts[name]
                    return
            unknown_name(name, "mesh or light", [*self._meshes, *self._lights])

    # -- looking

    @property
    def meshes(self) -> Mapping[str, MeshInstance]:
        """Meshes by name, in the order they were added: a live view, read-only."""
        return Named(self._meshes, "mesh")

    @property
    def lights(self) -> Mapping[str, Any]:
        """Lights (`AreaLight` or `SpotLight`) by name, in the order they were added.

        A live view: change their properties and the next render shows it.
        """
        return Named(self._lights, "light")

    @property
    def report(self) -> SceneReport:
        """What became of the input: triangles kept and dropped per mesh, and what was left out of a file."""
        with self._lock:
            meshes = {name: _report(mesh) for name, mesh in self._meshes.items()}
            return SceneReport(meshes, tuple(self._notes))

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """Box of all meshes and visible area lights, world space: float64 of shape (2, 3), or None."""
        with self._lock:
            boxes = [mesh.bounds for mesh in self._meshes.values()]
            lights = list(self._lights.values())
        boxes += [light.bounds for light in lights if isinstance(light, AreaLight) and light.visible]
        if not boxes:
            return None
        corners = np.array(boxes)
        return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])

    def copy(self) -> Scene:
        """Return an independent scene, with lights of its own; immutable geometry and textures are shared."""
        with self._lock:
            scene = Scene()
            scene._meshes = dict(self._meshes)
            scene._lights = {name: light.copy() for name, light in self._lights.items()}
            scene._notes = list(self._notes)
            scene.cameras = dict(self.cameras)
            return scene

    def __repr__(self) -> str:
        with self._lock:
            triangles = sum(mesh.geometry.core.report["triangles"] for mesh in self._meshes.values())
            counts = [
                _count(len(self._meshes), "mesh", "meshes"),
                _count(triangles, "triangle"),
                _count(len(self._lights), "light"),
                _count(len(self.cameras), "camera"),
            ]
        return f"<Scene: {', '.join(counts)}>"

    def _repr_html_(self) -> str:
        lights = "".join(
            f"<li>{escape(name)}: {escape(repr(light))}</li>" for name, light in self.lights.items()
        )
        cameras = "".join(f"<li>{escape(name)}: {escape(repr(c))}</li>" for name, c in self.cameras.items())
        title = escape(repr(self).strip("<>"))
        return f"<b>{title}</b>{self.report._repr_html_()}<ul>{lights}{cameras}</ul>"

    def __getstate__(self) -> dict[str, Any]:
        with self._lock:
            state = {key: value for key, value in self.__dict__.items() if key != "_lock"}
            return {key: value.copy() for key, value in state.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.RLock()

    # -- for the rest of the package

    def _core_snapshot(self) -> _core.Snapshot:
        """Take the scene as it is now, for one render: handles only, no geometry is copied."""
        from . import _core

        with self._lock:
            instances = [mesh._core_instance() for mesh in self._meshes.values()]
            lights = list(self._lights.items())
        area = [light._core_light(name) for name, light in lights if isinstance(light, AreaLight)]
        spot = [light._core_light(name) for name, light in lights if isinstance(light, SpotLight)]
        return _core.Snapshot(instances, area, spot)

    def _insert(self, mesh: MeshInstance) -> str:
        with self._lock:
            self._free_name(mesh.name, "mesh")
            self._meshes[mesh.name] = mesh
            return mesh.name

    def _add_note(self, note: str) -> None:
        """Add a line on the scene as a whole to `report`."""
        with self._lock:
            self._notes.append(note)

    def _free_name(self, name: str | None, kind: str) -> str:
        taken = {**self._meshes, **self._lights}
        if name is None:
            k = len(self._meshes if kind == "mesh" else self._lights)
            while f"{kind}_{k}" in taken:
                k += 1
            return f"{kind}_{k}"
        if as_name(name) in taken:
            raise SceneError(f"name is {name!r}, which is taken; allowed: a name that no mesh or light has")
        return name


def _report(mesh: MeshInstance) -> MeshReport:
    counts = mesh.geometry.core.report
    return MeshReport(counts["triangles"], counts["degenerate"], counts["not_finite"], mesh.notes)


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number:,} {one if number == 1 else many or one + 's'}"
