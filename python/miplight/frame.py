"""A rendered frame: images, fragment maps and statistics, read from the GPU when they are used."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import frame_files, light_volume, notebook
from ._table import unknown
from .errors import DeviceError, SettingsError
from .fragments import Fragments
from .light_volume import LightVolume
from .settings import Settings
from .stats import Stats
from .virtual_lights import VirtualLights

if TYPE_CHECKING:
    from . import _core

IMAGES = (
    "image",
    "direct",
    "indirect",
    "position",
    "normal",
    "albedo",
    "depth",
    "light_mask",
    "surface_mask",
)
"""Outputs that are one array with a row a pixel row."""
OUTPUTS = (*IMAGES, "fragments", "statistics", "stats")
"""What `outputs=` of a render may name."""
MAPS = ("level_map", "reason_map")
"""The arrays behind the output `fragments`."""


class Frame:
    """What a render gives. Made by `Renderer.render`, `render` and `Frame.load`.

    Images have row 0 at the top, are linear, and are read back once: those that `outputs` asked for at once,
    the others when they are first used. Until the renderer renders again, that is: then an output that was
    not read is a `DeviceError` that says so. An array that was read is the frame's own; copy it before
    changing it.
    """

    def __init__(
        self,
        arrays: Mapping[str, NDArray[Any]],
        stats: Mapping[str, Any],
        settings: Mapping[str, Any],
        size: tuple[int, int],
        source: _core.Frame | None = None,
        lock: AbstractContextManager[Any] | None = None,
        origin: str = "",
        lost: Iterable[str] = (),
    ) -> None:
        self._arrays = dict(arrays)
        self._fragments: Fragments | None = None
        self._stats = dict(stats)
        self._readback_ms = float(stats["readback_ms"])
        self._settings = dict(settings)
        self._size = size
        self._source = source
        self._lock = lock or threading.Lock()
        self._process = os.getpid()
        self._origin = origin
        self._lost = tuple(lost)

    # images

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 radiance, W·sr⁻¹·m⁻²: lights seen directly + `direct` + `indirect`."""
        return self["image"]

    @property
    def direct(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 radiance reflected once: light that comes straight from the lights."""
        return self["direct"]

    @property
    def indirect(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 radiance reflected more than once; zeros where indirect light is off."""
        return self["indirect"]

    @property
    def position(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 world position of the point seen; zeros where nothing is seen."""
        return self["position"]

    @property
    def normal(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 unit shading normal, turned to the viewer; zeros where nothing is seen."""
        return self["normal"]

    @property
    def albedo(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 linear diffuse reflectance; zeros where nothing is seen."""
        return self["albedo"]

    @property
    def depth(self) -> NDArray[np.float32]:
        """(H, W) float32 distance along the view axis, scene units; inf where nothing is seen."""
        return self["depth"]

    @property
    def light_mask(self) -> NDArray[np.bool_]:
        """(H, W) bool: a light is seen, from either side."""
        return self["light_mask"]

    @property
    def surface_mask(self) -> NDArray[np.bool_]:
        """(H, W) bool: a surface that is no light is seen."""
        return self["surface_mask"]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """An output or a kept resource by its name.

        Raises
        ------
        SettingsError
            If the frame has nothing of this name.
        DeviceError
            If it was not read before the renderer rendered again.
        """
        return self._array(name)

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays that the frame has: outputs and kept resources."""
        there = dict.fromkeys((*self._arrays, *self._lost))
        if self._source is not None:
            there |= dict.fromkeys(self._source.names)
        return tuple(there)

    @property
    def width(self) -> int:
        """Pixels in a row."""
        return self._size[0]

    @property
    def height(self) -> int:
        """Rows."""
        return self._size[1]

    def _array(self, name: str) -> NDArray[Any]:
        array = self._arrays.get(name)
        if array is not None:
            return array
        if name not in self.names:
            where = f" ({self._origin})" if self._origin else ""
            raise SettingsError(f"{unknown('array', name, self.names)}{where}")
        if self._source is None:
            raise DeviceError(f"{name!r} was not read before the frame was saved or pickled")
        if os.getpid() != self._process:
            raise DeviceError(f"{name!r} was not read before this process was forked")
        with self._lock:
            # another thread may have read it meanwhile
            if name not in self._arrays:
                start = time.perf_counter()
                self._arrays[name] = self._source.read(name)
                self._readback_ms += 1000.0 * (time.perf_counter() - start)
        return self._arrays[name]

    def _read(self, names: Iterable[str]) -> None:
        for name in names:
            self._array(name)

    @property
    def _more_maps(self) -> tuple[str, ...]:
        """Maps of the fragments of indirect light and of lobes, as far as the frame has them."""
        maps = (prefix + name for prefix in ("indirect_", "specular_") for name in MAPS)
        return tuple(name for name in maps if name in self.names)

    def _read_kept(self, names: Iterable[str]) -> None:
        """Inner resources, as far as there is something: a scene that nothing lights has none."""
        asked = tuple(names)
        more = light_volume.NAMES if light_volume.NAMES[0] in asked else ()
        for name in dict.fromkeys((*asked, *more)):
            with contextlib.suppress(SettingsError):
                self._array(name)

    def _read_all(self) -> dict[str, NDArray[Any]]:
        """Every array that can still be read."""
        for name in self.names:
            try:
                self._array(name)
            except DeviceError:  # the renderer went on; what was read stays
                break
        return dict(self._arrays)

    # maps and numbers

    @property
    def fragments(self) -> Fragments:
        """The fragments of the direct light."""
        if self._fragments is None:
            self._fragments = self._fragments_of("")
        return self._fragments

    @property
    def indirect_fragments(self) -> Fragments | None:
        """The fragments of the indirect light; None where indirect light is off."""
        if self._settings.get("indirect", "off") == "off":
            return None
        return self._fragments_of("indirect_")

    @property
    def virtual_lights(self) -> VirtualLights | None:
        """Reflective shadow maps and virtual lights; None where indirect light has another source.

        Ask for them with ``keep=("rsm", "virtual_lights")`` (with `indirect` hierarchical ``keep=("rsm",)``),
        or read them before the renderer renders again.
        """
        if "rsm" not in self.names:
            return None
        listed = self["virtual_lights"] if "virtual_lights" in self.names else None
        return VirtualLights.of(self["rsm"], listed)

    @property
    def volume(self) -> LightVolume | None:
        """What went through the propagation volume; None where indirect light has another source.

        Ask for it with ``keep=("volume",)``, or read it before the renderer renders again.
        """
        if light_volume.NAMES[0] not in self.names:
            return None
        return LightVolume.of(*(self[name] for name in light_volume.NAMES))

    @property
    def specular_fragments(self) -> Fragments | None:
        """The fragments of the specular pass; None where it did not run."""
        return self._fragments_of("specular_") if "specular_level_map" in self.names else None

    def _fragments_of(self, prefix: str) -> Fragments:
        level_map, reason_map = (self._array(prefix + name) for name in MAPS)
        refined = self._settings.get("refine", "none") != "none"
        if prefix != "indirect_":
            refined = refined and self._settings.get("direct_refine", "same") == "same"
        coarsest = int(self._settings.get("coarsest_level") or 0) if refined else 0
        extra = int(self._stats.get(prefix + "extra_samples", 0))
        return Fragments(level_map, reason_map, extra, coarsest)

    @property
    def settings(self) -> Settings:
        """The settings with everything resolved: rendering with them again gives the same bits."""
        return Settings.from_dict(self._settings)

    @property
    def stats(self) -> Stats:
        """Times of the passes, counts, and what was left out or rebuilt."""
        return Stats.from_dict(self._stats | {"readback_ms": self._readback_ms})

    # pictures and files

    def _png(self, exposure: float | None) -> bytes:
        stops = notebook.checked_exposure(exposure)
        if stops is None:
            mask = self._arrays.get("surface_mask")
            stops = notebook.auto_exposure(self.image, mask if mask is not None else ~self._looks_at_light())
        return notebook.png_bytes(notebook.to_srgb8(self.image, stops))

    def _looks_at_light(self) -> NDArray[np.bool_]:
        level_map = self._arrays.get("level_map")
        if level_map is None or level_map.shape != self.image.shape[:2]:
            return np.zeros(self.image.shape[:2], np.bool_)
        return np.asarray(level_map >= 254)

    def show(self, exposure: float | None = None) -> None:
        """Show the image: in the notebook if one runs, else in a window.

        Parameters
        ----------
        exposure
            Stops: radiance is multiplied by 2^exposure before it is encoded as sRGB. By default one that
            suits the lit surfaces.

        Raises
        ------
        SettingsError
            If `exposure` is no number.
        """
        png = self._png(exposure)
        if not notebook.display_png(png):
            notebook.display_window(png, f"{self.width} × {self.height}, {self.stats.total_ms:.1f} ms")

    def save(self, path: str | os.PathLike[str], exposure: float | None = None) -> Path:
        """Write the frame to a file; the suffix says what.

        Parameters
        ----------
        path
            ``.npz``: everything, for `Frame.load`. ``.exr``: the image as 32-bit floats, with the settings in
            the header. ``.png``: an 8-bit sRGB picture for people.
        exposure
            Stops, for ``.png`` alone; by default one that suits the lit surfaces.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        SceneError
            If the suffix is none of these.
        SettingsError
            If `exposure` is no number, or given for a file that is no picture.
        OSError
            If the file cannot be written.
        """
        target = Path(path)
        suffix = frame_files.checked_suffix(target, frame_files.SAVED)
        if suffix == ".png":
            target.write_bytes(self._png(exposure))
        elif exposure is not None:
            raise SettingsError(f"exposure is {exposure!r} for {target.name}; only .png pictures are exposed")
        elif suffix == ".exr":
            frame_files.write_exr(target, self.image, self._settings, self.stats.to_dict())
        else:
            frame_files.write_npz(target, self._read_all(), self._settings, self.stats.to_dict(), self._size)
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Frame:
        """Read a frame that `save` wrote as ``.npz`` (everything) or ``.exr`` (the image; of any origin).

        Raises
        ------
        SceneError
            If there is no such file, its suffix is neither, or it is not what its suffix says or cut short.
        """
        source = Path(path)
        suffix = frame_files.checked_suffix(frame_files.checked_file(source), (".npz", ".exr"))
        read = frame_files.read_exr if suffix == ".exr" else frame_files.read_npz
        arrays, settings, stats, size = read(source)
        return cls(arrays, stats, settings, size, origin=f"loaded from {source.name}")

    def __getstate__(self) -> dict[str, Any]:
        arrays = self._read_all()
        return {
            "arrays": arrays,
            "lost": [name for name in self.names if name not in arrays],
            "stats": self.stats.to_dict(),
            "settings": self._settings,
            "size": self._size,
            "origin": self._origin or "pickled",
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        Frame.__init__(self, **state)

    def __repr__(self) -> str:
        stats = self.stats
        read = ", ".join(self._arrays)
        return (
            f"<Frame {self.width} × {self.height}, {stats.total_ms:.1f} ms on {stats.adapter}; read: {read}>"
        )

    def _repr_png_(self) -> bytes:
        return self._png(None)

    def _repr_html_(self) -> str:
        return notebook.frame_html(self._png(None), repr(self), self.stats._repr_html_())
