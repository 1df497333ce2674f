"""The renderer: one adapter, used by any number of scenes, cameras and threads, one frame at a time."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from . import _core
from ._table import unknown
from .camera import Camera
from .errors import DeviceError, SceneError, SettingsError
from .frame import MAPS, OUTPUTS, Frame
from .plan import Plan
from .settings import Settings, as_settings
from .validate import as_matrix, as_numbers, fail

if TYPE_CHECKING:
    from types import TracebackType

    from .scene import Scene

DEFAULT_OUTPUTS = ("image", "fragments", "statistics", "light_mask", "surface_mask")

_warned = threading.Lock()
# The process that opened the first device: neither a driver's threads nor ours survive a fork.
_opened_by: list[int] = []


class SoftwareAdapterWarning(UserWarning):
    """The adapter is software: everything works, slower than on a GPU. Given once per process."""


TRACE_FORMS = ("auto", "native", "wgsl")


class Renderer:
    """Renders scenes on one adapter.

    A renderer keeps pipelines, uploaded geometry and the last frame, so that what did not change is not built
    again. It may be shared by threads, which take turns. After `close`, or in a process that was forked from
    the one that made it, every use is a `DeviceError`.

    Parameters
    ----------
    adapter
        ``"auto"`` (a GPU if there is one), ``"gpu"``, ``"cpu"`` (software), or part of an adapter's name as
        in `adapters`.
    trace
        Who answers rays: ``"native"`` code on all cores, ``"wgsl"`` on the adapter, or ``"auto"``: native on
        a software adapter, where it is several times faster for the same answers.

    Raises
    ------
    SettingsError
        For another `trace`.
    DeviceError
        If no adapter fits, it cannot be opened, or this process was forked from one that had opened a
        renderer.
    """

    def __init__(self, adapter: str = "auto", trace: str = "auto") -> None:
        if not isinstance(adapter, str):
            fail("adapter", adapter, "'auto', 'gpu', 'cpu' or part of an adapter's name", DeviceError)
        if trace not in TRACE_FORMS:
            fail("trace", trace, " or ".join(repr(form) for form in TRACE_FORMS), SettingsError)
        _check_not_forked()
        self._core = _core.Renderer(adapter, trace)
        self._adapter: dict[str, Any] = dict(self._core.adapter)
        self._lock = threading.RLock()
        self._process = os.getpid()
        if self._adapter["software"]:
            _warn_once(self._adapter["name"])

    @property
    def adapter(self) -> dict[str, Any]:
        """The adapter: name, backend, driver, device_type, software, trace (the form of its rays), limits."""
        return dict(self._adapter)

    def render(
        self,
        scene: Scene,
        camera: Camera,
        settings: Settings | str | None = None,
        outputs: Iterable[str] = DEFAULT_OUTPUTS,
        keep: Iterable[str] = (),
    ) -> Frame:
        """Render one frame.

        Parameters
        ----------
        scene
            Taken as it is now; changing it later does not change this frame.
        camera
            From where, and the size of the image.
        settings
            `Settings`, the name of a preset, or None for the default.
        outputs
            What is read back at once: ``image direct indirect position normal albedo depth light_mask
            surface_mask fragments statistics``. The rest is read when it is first used, until this renderer
            renders again.
        keep
            Names of inner resources to read at once, for ``frame[name]``.

        Returns
        -------
        Frame

        Raises
        ------
        SceneError
            If `scene` or `camera` is none, or too large for the adapter.
        SettingsError
            For settings, outputs or resources that are unknown or not available yet.
        DeviceError
            If the adapter is lost or out of memory, the renderer is closed, or the process was forked.
        KeyboardInterrupt
            If Ctrl-C is pressed; the renderer stays usable.
        """
        knobs = as_settings(settings)
        wanted, kept = _checked_outputs(outputs), _checked_names(keep, "keep")
        snapshot, view = _checked_scene(scene)._core_snapshot(), _checked_camera(camera)._core_camera()
        return self._render(snapshot, view, knobs, wanted, kept)

    def _render(
        self,
        snapshot: _core.Snapshot,
        view: dict[str, Any],
        settings: Settings,
        outputs: tuple[str, ...],
        keep: tuple[str, ...],
        check: Callable[[], None] | None = None,
    ) -> Frame:
        """Render what has been checked; `check` is called now and then, and what it raises ends it."""
        self._check_process()
        with self._lock:
            called = check or _check_signals
            source = self._core.render(snapshot, view, settings.to_dict(), list(keep), called)
            size = (source.width, source.height)
            frame = Frame({}, source.stats, source.settings, size, source, self._lock)
            frame._read(outputs)
            frame._read_kept(keep if MAPS[0] not in outputs else (*keep, *frame._more_maps))
        return frame

    def render_batch(
        self,
        scene: Scene,
        cameras: Iterable[Camera] | ArrayLike,
        settings: Settings | str | None = None,
        outputs: Iterable[str] = DEFAULT_OUTPUTS,
        keep: Iterable[str] = (),
        *,
        fov_y: float | None = None,
        size: tuple[int, int] | None = None,
    ) -> Iterator[Frame]:
        """Render one frame per camera, each when the iterator is asked for it.

        Parameters
        ----------
        scene
            Taken as it is at this call, for all frames.
        cameras
            Cameras, or (N, 4, 4) matrices `world_from_camera`, which need `fov_y` and `size`.
        settings, outputs, keep
            As for `render`. Ask for every output that is needed: the next frame ends the life of those that
            were not read.
        fov_y
            Vertical field of view in degrees, for matrices.
        size
            (width, height) in pixels, for matrices.

        Returns
        -------
        iterator of Frame

        Raises
        ------
        SceneError, SettingsError, DeviceError
            As for `render`; bad arguments at once, not when the first frame is asked for.
        """
        knobs = as_settings(settings)
        wanted, kept = _checked_outputs(outputs), _checked_names(keep, "keep")
        views = [camera._core_camera() for camera in as_cameras(cameras, fov_y, size)]
        snapshot = _checked_scene(scene)._core_snapshot()
        self._check_process()
        return (self._render(snapshot, view, knobs, wanted, kept) for view in views)

    def plan(self, scene: Scene, camera: Camera, settings: Settings | str | None = None) -> Plan:
        """Say which passes a render would run, and why it would do without the others; nothing is rendered.

        Raises
        ------
        SceneError, SettingsError, DeviceError
            As for `render`.
        """
        knobs = as_settings(settings)
        snapshot, view = _checked_scene(scene)._core_snapshot(), _checked_camera(camera)._core_camera()
        self._check_process()
        with self._lock:
            found = self._core.plan(snapshot, view, knobs.to_dict())
        return Plan(tuple(found["passes"]), dict(found["skipped"]))

    def close(self) -> None:
        """Give back everything on the adapter; frames keep what was read of them. Twice is no error."""
        if os.getpid() != self._process:
            return
        with self._lock:
            self._core.close()

    def _check_process(self) -> None:
        # before the lock: another thread of the parent may have held it when the process was forked
        if os.getpid() != self._process:
            raise DeviceError(
                "this Renderer was made before the process was forked; make a Renderer in each process, "
                "or start processes with the 'spawn' method"
            )

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __reduce__(self) -> Any:
        raise TypeError("a Renderer cannot be pickled: it holds a device; make one in each process")

    def __repr__(self) -> str:
        about = self._adapter
        return f"<Renderer on {about['name']} ({about['backend']}, {about['trace']} rays)>"


def _check_not_forked() -> None:
    if not _opened_by:
        _opened_by.append(os.getpid())
    if _opened_by[0] != os.getpid():
        raise DeviceError(
            "this process was forked from one that had opened a Renderer, and a driver does not survive "
            "that; start processes with the 'spawn' or 'forkserver' method, or open the first Renderer "
            "after the fork"
        )


def adapters() -> list[dict[str, Any]]:
    """The adapters of this machine, best first: name, backend, driver, device_type, software."""
    return [dict(adapter) for adapter in _core.adapters()]


def as_cameras(
    cameras: Iterable[Camera] | ArrayLike, fov_y: float | None, size: tuple[int, int] | None
) -> list[Camera]:
    """Cameras from a list of them, or from (N, 4, 4) matrices with `fov_y` and `size`.

    Raises
    ------
    SceneError
        If they are neither, or `fov_y` and `size` are missing for matrices or given for cameras.
    """
    if isinstance(cameras, Camera):
        fail("cameras", cameras, "several cameras: a list, or (N, 4, 4) matrices with fov_y= and size=")
    listed: Any = cameras if hasattr(cameras, "__array__") else list(cameras)  # type: ignore[arg-type]
    if all(isinstance(camera, Camera) for camera in listed):
        for name, value in (("fov_y", fov_y), ("size", size)):
            if value is not None:
                fail(name, value, "None, because the cameras have their own")
        return list(listed)
    allowed = "a list of Camera, or numbers of shape (N, 4, 4)"
    matrices = as_numbers(listed, "cameras", allowed)
    if matrices.ndim != 3 or matrices.shape[1:] != (4, 4):
        fail("cameras", matrices, allowed)
    return [camera_from_matrix(as_matrix(m, f"cameras[{i}]"), fov_y, size) for i, m in enumerate(matrices)]


def camera_from_matrix(matrix: ArrayLike, fov_y: float | None, size: tuple[int, int] | None) -> Camera:
    """Make a camera of a (4, 4) `world_from_camera` with `fov_y` in degrees and `size` = (width, height).

    Raises
    ------
    SceneError
        If any of them is missing or wrong.
    """
    if fov_y is None:
        fail("fov_y", fov_y, "degrees in (0, 180); a (4, 4) camera does not have it")
    if not isinstance(size, Sequence) or len(size) != 2:
        fail("size", size, "(width, height) in pixels; a (4, 4) camera does not have it")
    return Camera(matrix, fov_y, size[0], size[1])


def _checked_scene(scene: Any) -> Scene:
    if not hasattr(scene, "_core_snapshot"):
        fail("scene", scene, "a miplight.Scene; Scene.from_trimesh makes one of trimesh meshes", SceneError)
    checked: Scene = scene
    return checked


def _checked_camera(camera: Any) -> Camera:
    if not isinstance(camera, Camera):
        fail("camera", camera, "a miplight.Camera", SceneError)
    return camera


def _checked_names(names: Iterable[str], argument: str) -> tuple[str, ...]:
    listed = (names,) if isinstance(names, str) else tuple(names)
    for name in listed:
        if not isinstance(name, str):
            fail(argument, name, "names", SettingsError)
    return listed


def _checked_outputs(outputs: Iterable[str]) -> tuple[str, ...]:
    """The arrays behind the outputs asked for."""
    arrays: dict[str, None] = {}
    for name in _checked_names(outputs, "outputs"):
        if name not in OUTPUTS:
            raise unknown("output", name, OUTPUTS)
        # statistics are always there
        found = {"fragments": MAPS, "statistics": (), "stats": ()}.get(name, (name,))
        arrays |= dict.fromkeys(found)
    return tuple(arrays)


def _check_signals() -> None:
    """Called by the core between pieces of work: entering a Python function is what lets Ctrl-C through."""


def _warn_once(name: str) -> None:
    # the lock is never released: whoever takes it is the one who says it
    if _warned.acquire(blocking=False):
        warnings.warn(
            f"{name} is a software adapter: everything works, slower than on a GPU",
            SoftwareAdapterWarning,
            stacklevel=3,
        )
