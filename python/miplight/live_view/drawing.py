"""From a job to a picture: the size and the settings of each stage, the render, and what is said about it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from miplight.camera import Camera
from miplight.frame import Frame
from miplight.renderer import Renderer
from miplight.settings import Settings

from .pace import Pace
from .pictures import Picture, exposure_of, picture
from .state import LiveState, View

_OUTPUTS = ("image", "level_map", "reason_map", "surface_mask")
# A coarse picture is given up, if another one is wanted, when it takes so many times too long.
_PATIENCE = 4.0
_MOVING, _STILL, _FINE = "moving", "full size", "supersampled"


@dataclass(frozen=True)
class Drawn:
    """A picture and the frame behind it.

    Parameters
    ----------
    number
        Grows from picture to picture.
    stage
        What it is: moving, full size or supersampled.
    wall_ms
        Milliseconds from the start of the render until its arrays were read.
    finer
        Whether a finer one is to follow.
    """

    number: int
    frame: Frame
    picture: Picture
    stage: str
    wall_ms: float
    finer: bool

    def about(self) -> dict[str, Any]:
        """Describe it for a page, in plain values."""
        stats = self.frame.stats
        return {
            "number": self.number,
            "width": self.frame.width,
            "height": self.frame.height,
            "stage": self.stage,
            "ms": round(stats.total_ms, 1),
            "wall_ms": round(self.wall_ms, 1),
            "fragments": self.frame.fragments.total,
            "rays": stats.rays,
            "mime": self.picture.mime,
            "legend": self.picture.legend,
            "note": self.picture.note,
        }


class Drawing:
    """Renders what a state shows; one picture at a time, on any thread.

    Parameters
    ----------
    state
        What to show.
    renderer
        Stays open; or None for one that is opened when it is needed and closed by `close`.
    adapter
        As for `Renderer`, for one of its own.
    frames_per_second
        What the size of moving pictures is chosen for.
    supersample
        Of the last stage; 1: there is none.
    """

    def __init__(
        self,
        state: LiveState,
        renderer: Renderer | None,
        adapter: str,
        frames_per_second: float,
        supersample: int,
    ) -> None:
        self.state = state
        self.pace = Pace(1000.0 / frames_per_second)
        self.full: Drawn | None = None
        """The last picture of the full size."""
        self._last: Drawn | None = None
        self._given, self._adapter = renderer, adapter
        self._own: Renderer | None = None
        self._supersample = supersample
        self._rendering = threading.Lock()
        # apart from the one above, so that a change of exposure does not wait for a render
        self._showing = threading.Lock()
        self._count = 0

    def draw(
        self,
        stage: int,
        check: Callable[[], None] | None = None,
        patience: Callable[[float], None] | None = None,
    ) -> Drawn:
        """Draw what the state shows now.

        Parameters
        ----------
        stage
            0: as coarse as it has to be to come in time. 1: at full size. 2 and more: supersampled.
        check
            Called now and then; what it raises ends the render. By default Ctrl-C does.
        patience
            Told for how many seconds a coarse picture may be waited for before it is given up.

        Raises
        ------
        MiplightError
            As for `Renderer.render`.
        """
        with self._rendering:
            view = self.state.view
            if stage == 0:
                return self._draw_moving(view, check, patience)
            fine = stage > 1
            coarse = view.settings.supersample
            settings = view.settings.replace(supersample=max(coarse, self._supersample if fine else 1))
            frame, wall = self._render(view.camera, settings, check)
            if not fine and settings.indirect == "off":
                self.pace.took(wall, 1.0)
            return self._show(frame, _FINE if fine else _STILL, wall)

    def look_again(self) -> tuple[Drawn | None, bool]:
        """Show the last frame as the state says now, without rendering.

        Returns
        -------
        tuple
            The picture, or None where there is no frame with the maps that are asked for; and whether
            something is left to render.
        """
        last = self._last
        if last is None or (self.state.view.overlay != "off" and last.stage == _FINE):
            return None, True
        shown = self._show(last.frame, last.stage, last.wall_ms, again=last)
        return shown, shown is not last and shown.finer and not last.finer

    def close(self) -> None:
        """Give the renderer back, if it is its own; drawing again opens another one."""
        with self._rendering:
            if self._own is not None:
                self._own.close()
            self._own = None

    @property
    def _renderer(self) -> Renderer:
        if self._given is not None:
            return self._given
        if self._own is None:
            self._own = Renderer(self._adapter)
        return self._own

    def _draw_moving(
        self, view: View, check: Callable[[], None] | None, patience: Callable[[float], None] | None
    ) -> Drawn:
        pace, scale = self.pace, self.pace.scale
        indirect = view.settings.indirect != "off"
        lean = pace.lean and indirect
        settings = view.settings.replace(supersample=1, **({"indirect": "off"} if lean else {}))
        # the smallest picture is waited for, however long it takes
        if patience is not None and not (pace.at_the_end and lean is indirect):
            patience(_PATIENCE * 1e-3 * pace.budget_ms)
        start = time.perf_counter()
        try:
            frame, wall = self._render(_scaled(view.camera, scale), settings, check)
        except BaseException:
            pace.took(1000.0 * (time.perf_counter() - start), scale, can_be_lean=indirect)
            raise
        pace.took(wall, scale, can_be_lean=indirect)
        return self._show(frame, _MOVING, wall, note="indirect light when still" if lean else "")

    def _render(
        self, camera: Camera, settings: Settings, check: Callable[[], None] | None
    ) -> tuple[Frame, float]:
        start = time.perf_counter()
        snapshot, seen = self.state.scene._core_snapshot(), camera._core_camera()
        frame = self._renderer._render(snapshot, seen, settings, _OUTPUTS, (), check)
        return frame, 1000.0 * (time.perf_counter() - start)

    def _show(
        self, frame: Frame, stage: str, wall: float, note: str = "", again: Drawn | None = None
    ) -> Drawn:
        """Make a picture of a frame, exposed and overlaid as the state says at this moment."""
        with self._showing:
            if again is not None and again is not self._last and self._last is not None:
                return self._last  # a newer one came meanwhile
            view = self.state.view
            exposure = view.exposure
            if exposure is None:
                exposure = exposure_of(frame)
                self.state.meter(exposure)
            shown = picture(frame, exposure, view.overlay, note, lossless=stage != _MOVING)
            # maps of a supersampled frame are of internal pixels: with one over the picture it stays as it is
            can_be = view.overlay == "off" and view.settings.supersample < self._supersample
            finer = stage == _MOVING or (stage == _STILL and can_be)
            self._count += 1
            drawn = Drawn(self._count, frame, shown, stage, wall, finer)
            self._last = drawn
            if stage != _MOVING:
                self.full = drawn
            return drawn


def _scaled(camera: Camera, scale: float) -> Camera:
    """The same view with fewer pixels."""
    width, height = (max(1, round(scale * size)) for size in (camera.width, camera.height))
    return camera.replace(width=width, height=height)
