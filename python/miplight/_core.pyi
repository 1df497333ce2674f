"""The Rust core. `miplight` wraps it; nothing here is meant to be used directly."""

from collections.abc import Callable
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "AreaLight",
    "Frame",
    "Instance",
    "KernelRunner",
    "Mesh",
    "Renderer",
    "Snapshot",
    "SpotLight",
    "Texture",
    "adapters",
    "presets",
    "setting_specs",
    "version",
]

@final
class Mesh:
    def __new__(
        cls,
        positions: NDArray[np.float64],
        triangles: NDArray[np.uint32],
        normals: NDArray[np.float32] | None = None,
        uvs: NDArray[np.float32] | None = None,
        colors: NDArray[np.float32] | None = None,
        name: str = ...,
    ) -> Mesh: ...
    @property
    def id(self) -> int: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    @property
    def report(self) -> dict[str, int]: ...
    def with_positions(
        self, positions: NDArray[np.float64], normals: NDArray[np.float32] | None = None
    ) -> Mesh: ...

@final
class Texture:
    def __new__(cls, texels: NDArray[np.float32]) -> Texture: ...
    @property
    def id(self) -> int: ...
    @property
    def shape(self) -> tuple[int, int]: ...

@final
class Instance:
    def __new__(
        cls,
        name: str,
        mesh: Mesh,
        world_from_object: NDArray[np.float64],
        smooth: bool,
        albedo: tuple[float, float, float],
        texture: Texture | None,
        vertex_colors: bool,
        lobe: tuple[float, float, float, float],
    ) -> Instance: ...

@final
class AreaLight:
    def __new__(
        cls,
        name: str,
        corner: tuple[float, float, float],
        edge_u: tuple[float, float, float],
        edge_v: tuple[float, float, float],
        radiance: tuple[float, float, float] | Texture,
        two_sided: bool,
        visible: bool,
        linear_filter: bool,
    ) -> AreaLight: ...

@final
class SpotLight:
    def __new__(
        cls,
        name: str,
        position: tuple[float, float, float],
        target: tuple[float, float, float],
        intensity: tuple[float, float, float],
        cutoff_degrees: float,
    ) -> SpotLight: ...

@final
class Snapshot:
    def __new__(
        cls, instances: list[Instance], area_lights: list[AreaLight], spot_lights: list[SpotLight]
    ) -> Snapshot: ...

@final
class Renderer:
    def __new__(cls, adapter: str, trace: str = "auto") -> Renderer: ...
    @property
    def adapter(self) -> dict[str, Any]: ...
    def render(
        self,
        snapshot: Snapshot,
        camera: dict[str, Any],
        settings: dict[str, Any],
        keep: list[str],
        check: Callable[[], None] | None = None,
    ) -> Frame: ...
    def plan(
        self, snapshot: Snapshot, camera: dict[str, Any], settings: dict[str, Any]
    ) -> dict[str, Any]: ...
    def close(self) -> None: ...

@final
class Frame:
    def read(self, name: str) -> NDArray[Any]: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def stats(self) -> dict[str, Any]: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...

@final
class KernelRunner:
    def __new__(cls, adapter: str) -> KernelRunner: ...
    def run(
        self,
        stem: str,
        entry: str,
        inputs: dict[str, NDArray[np.uint8]],
        threads: int,
        groups: bool = False,
        text: str | None = None,
        constants: dict[str, float] | None = None,
    ) -> dict[str, NDArray[np.uint8]]: ...

def adapters() -> list[dict[str, Any]]: ...
def setting_specs() -> list[dict[str, Any]]: ...
def presets() -> dict[str, dict[str, Any] | None]: ...
def version() -> str: ...
