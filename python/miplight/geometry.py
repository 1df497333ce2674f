"""Triangles of a mesh and where they stand: the records that a `Scene` holds. Both are immutable.

Equal geometry is stored once: meshes with the same arrays share one `Geometry`, and so one BVH, whether they
come from an instanced scene graph, from several ``add_mesh`` calls or from another scene.
"""

from __future__ import annotations

import dataclasses
import hashlib
import threading
import weakref
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .material import Material
from .normals import mend_normals, smooth_normals, smoothing_groups
from .validate import freeze

if TYPE_CHECKING:
    from . import _core

__all__ = ["Geometry", "MeshInstance", "Shading"]

Shading: TypeAlias = Literal["smooth", "flat"]

_FIELDS = ("positions", "triangles", "normals", "uvs", "colors")
_STORE: weakref.WeakValueDictionary[bytes, Geometry] = weakref.WeakValueDictionary()
_STORE_LOCK = threading.Lock()


class Geometry:
    """Checked arrays of one mesh in object space, with the core's handle that owns its BVH.

    Parameters
    ----------
    positions : (V, 3) float64
    triangles : (F, 3) uint32
    normals : (V, 3) float32 or None
        Unit shading normals; None for a mesh that is shaded flat.
    uvs : (V, 2) float32 or None
    colors : (V, 3) float32 or None
        Linear RGB factors of the albedo.
    """

    __slots__ = ("__weakref__", "_groups", "colors", "core", "normals", "positions", "triangles", "uvs")

    def __init__(
        self,
        positions: NDArray[np.float64],
        triangles: NDArray[np.uint32],
        normals: NDArray[np.float32] | None,
        uvs: NDArray[np.float32] | None,
        colors: NDArray[np.float32] | None,
        *,
        name: str,
        core: _core.Mesh | None = None,
    ) -> None:
        from . import _core

        self.positions, self.triangles, self.normals = positions, triangles, normals
        self.uvs, self.colors = uvs, colors
        for array in (positions, triangles, normals, uvs, colors):
            if array is not None:
                array.flags.writeable = False
        self.core = core or _core.Mesh(positions, triangles, normals, uvs, colors, name)
        self._groups: NDArray[np.intp] | None = None

    @classmethod
    def shared(
        cls,
        positions: NDArray[np.float64],
        triangles: NDArray[np.uint32],
        normals: NDArray[np.float32] | None,
        uvs: NDArray[np.float32] | None,
        colors: NDArray[np.float32] | None,
        *,
        name: str,
    ) -> Geometry:
        """Return the geometry with these arrays, a new one only if there is none yet."""
        arrays = (positions, triangles, normals, uvs, colors)
        digest = hashlib.blake2b(digest_size=20)
        for field, array in zip(_FIELDS, arrays, strict=True):
            if array is not None:
                digest.update(f"{field}{array.shape}".encode())
                digest.update(np.ascontiguousarray(array).data)
        key = digest.digest()
        with _STORE_LOCK:
            found = _STORE.get(key)
        if found is None:
            made = cls(*arrays, name=name)
            with _STORE_LOCK:
                found = _STORE.setdefault(key, made)
        return found

    def deformed(
        self, positions: NDArray[np.float64], normals: NDArray[np.float32] | None, name: str
    ) -> Geometry:
        """Return the same triangles with other vertices; smooth normals are computed anew unless given.

        Vertices that shared position and normal keep sharing one, so UV seams stay smooth and hard edges
        hard.
        """
        groups = self._groups
        if self.normals is not None and normals is None:
            if groups is None:
                groups = self._groups = smoothing_groups(self.positions, self.normals)
            computed = smooth_normals(positions, self.triangles, groups)
            normals, _ = mend_normals(computed, positions, self.triangles)
        core = self.core.with_positions(positions, normals)
        made = Geometry(positions, self.triangles, normals, self.uvs, self.colors, name=name, core=core)
        made._groups = groups
        return made

    def used_positions(self) -> NDArray[np.float64]:
        """Return the vertices of the triangles whose corners are finite: (N, 3) float64."""
        finite: NDArray[np.bool_] = np.asarray(np.isfinite(self.positions).all(axis=1))
        used = np.zeros(len(self.positions), dtype=np.bool_)
        used[self.triangles[finite[self.triangles].all(axis=1)]] = True
        return self.positions[used]

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, tuple(getattr(self, field) for field in _FIELDS)


def _restore(*arrays: Any) -> Geometry:
    return Geometry.shared(*arrays, name="")


@dataclasses.dataclass(frozen=True, eq=False)
class MeshInstance:
    """One mesh of a scene, as ``scene.meshes[name]`` returns it; the scene's ``set_…`` methods replace it.

    Attributes
    ----------
    name : str
    geometry : Geometry
        Arrays, possibly shared with other instances.
    transform : (4, 4) float64
        ``world_from_object``, column vectors.
    material : Material
    shading : {"smooth", "flat"}
    use_colors : bool
        Whether the vertex colours multiply the material's albedo.
    notes : tuple of str
        What was changed or left out when the mesh was taken over.
    """

    name: str
    geometry: Geometry
    transform: NDArray[np.float64]
    material: Material
    shading: Shading
    use_colors: bool = False
    notes: tuple[str, ...] = ()
    _cache: dict[str, Any] = dataclasses.field(default_factory=dict, init=False, repr=False)

    @property
    def positions(self) -> NDArray[np.float64]:
        """Vertices in object space: read-only float64 of shape (V, 3)."""
        return self.geometry.positions

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Corners as they were given, before any was dropped: read-only uint32 of shape (F, 3)."""
        return self.geometry.triangles

    @property
    def normals(self) -> NDArray[np.float32] | None:
        """Unit shading normals in object space, read-only float32 of shape (V, 3); None if shaded flat."""
        return self.geometry.normals

    @property
    def uvs(self) -> NDArray[np.float32] | None:
        """Texture coordinates, v = 0 at the bottom: read-only float32 of shape (V, 2), or None."""
        return self.geometry.uvs

    @property
    def colors(self) -> NDArray[np.float32] | None:
        """Linear RGB that multiplies the albedo: read-only float32 of shape (V, 3), or None."""
        return self.geometry.colors if self.use_colors else None

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Box of the used vertices in world space: float64 of shape (2, 3)."""
        if "bounds" not in self._cache:
            points = self.geometry.used_positions() @ self.transform[:3, :3].T + self.transform[:3, 3]
            self._cache["bounds"] = np.array([points.min(axis=0), points.max(axis=0)])
        bounds: NDArray[np.float64] = self._cache["bounds"]
        return bounds

    def __repr__(self) -> str:
        count = len(self.triangles)
        return f"<MeshInstance {self.name!r}: {count:,} triangles, {self.shading}, {self.material!r}>"

    def moved(self, transform: NDArray[np.float64]) -> MeshInstance:
        """Return the same mesh elsewhere."""
        return dataclasses.replace(self, transform=transform)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_cache": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        freeze(self.transform)  # pickling forgets it

    def _core_instance(self) -> _core.Instance:
        """Return the instance on the core's side, made once: the record never changes."""
        if "core" not in self._cache:
            from . import _core

            self._cache["core"] = _core.Instance(
                self.name,
                self.geometry.core,
                self.transform,
                self.shading == "smooth",
                self.material._core_albedo(),
                self.material._core_texture(),
                self.use_colors,
                self.material._core_lobe(),
            )
        instance: _core.Instance = self._cache["core"]
        return instance
