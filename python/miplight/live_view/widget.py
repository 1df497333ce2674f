"""The view itself: a widget that talks to its page, and leaves a picture where there is none."""

from __future__ import annotations

import atexit
import base64
import threading
import weakref
from collections.abc import Mapping
from importlib import resources
from typing import Any

import anywidget
import traitlets

from miplight.camera import Camera
from miplight.errors import MiplightError
from miplight.frame import Frame
from miplight.scene import Scene
from miplight.settings import Settings

from .drawing import Drawing, Drawn
from .loop import Job, Loop
from .state import Change, LiveState

_WIDGET = "application/vnd.jupyter.widget-view+json"
_STATIC = resources.files(__package__) / "static"


class LiveView(anywidget.AnyWidget):  # type: ignore[misc]  # ipywidgets has no types
    """A view of a scene in a notebook that follows the mouse. Made by `miplight.live`.

    Drag to orbit, with Shift (or the right button) to pan, with Alt to move the light; the wheel zooms, with
    Alt it moves the light away. What is asked for last is drawn first; a render that is out of date is given
    up. Errors are shown in the view. `close` frees the renderer and leaves the last picture.
    """

    _esm = (_STATIC / "live.js").read_text(encoding="utf-8")
    _css = (_STATIC / "live.css").read_text(encoding="utf-8")

    size = traitlets.Tuple().tag(sync=True)
    controls: traitlets.List[Any] = traitlets.List().tag(sync=True)
    values = traitlets.Dict().tag(sync=True)
    # kept in the state, so that a page shows it at once, also where a notebook was saved with its widgets
    still = traitlets.Bytes().tag(sync=True)

    def __init__(self, state: LiveState, drawing: Drawing) -> None:
        self._state, self._drawing = state, drawing
        self._loop: Loop | None = None
        self._pages: set[str] = set()
        self._open = True
        self._handles: list[Any] = []
        self._change = threading.RLock()
        camera = state.view.camera
        super().__init__(size=(camera.width, camera.height), controls=state.controls(), values=state.values())
        self.on_msg(self._receive)
        _views.add(self)

    # what it shows

    @property
    def scene(self) -> Scene:
        """The scene that is shown, a copy of the given one: change it, and call `refresh`."""
        return self._state.scene

    @property
    def camera(self) -> Camera:
        """The camera as it is now, with the size of the full picture."""
        return self._state.view.camera

    @property
    def settings(self) -> Settings:
        """The settings as they are now."""
        return self._state.view.settings

    @property
    def frame(self) -> Frame | None:
        """The last frame of the full size, or None before the first one."""
        full = self._drawing.full
        return None if full is None else full.frame

    def refresh(self) -> None:
        """Draw again, after a change to `scene`."""
        loop = self._loop
        if loop is not None:
            loop.request(settled=True)
        else:
            self.still = b""  # drawn anew when it is shown

    def close(self) -> None:
        """Free the renderer, unless it was given, and leave the last picture. Twice is no error."""
        with self._change:
            was_open, self._open = self._open, False
        if was_open:
            self._pages.clear()
            self._rest()
            for handle in self._handles:
                handle.update(self._bundle(), raw=True)
            _views.discard(self)
        super().close()
        # ipywidgets hides it in what is closed, which shows its last picture here
        self.__dict__.pop("_repr_mimebundle_", None)

    # the page

    def _receive(self, _: Any, message: Mapping[str, Any], __: Any) -> None:
        """Take a message of a page; an error goes back to it."""
        try:
            self._take(message)
        except Exception as error:  # whatever it is, the page is where it is looked for
            self._tell(error)
            self.values = {}  # what the page shows is not what is there: it gets it again
            self.values = self._state.values()

    def _take(self, message: Mapping[str, Any]) -> None:
        if not self._open:
            return
        kind, page = message.get("kind"), str(message.get("page", ""))
        if kind == "hello":
            self._pages.add(page)
            self._work().request(settled=True)
        elif kind == "gone":
            self._pages.discard(page)
            if not self._pages:
                self._rest()
        elif kind == "shown":
            self._work().shown(int(message["sent"]))
        elif kind == "still":
            self._work().settle()
        else:
            self._follow(self._state.take(message))

    def _follow(self, change: Change) -> None:
        """Draw what has changed."""
        if change is Change.SETTINGS:
            self._drawing.pace.forget()
        if change is not Change.MOVED:
            self.controls, self.values = self._state.controls(), self._state.values()
        if change is Change.LOOK:
            again, more = self._drawing.look_again()
            if again is not None:
                self._put(again, -1)
            if more:
                self._work().request(settled=True)
        elif change is not Change.NOTHING:
            self._work().request()

    def _work(self) -> Loop:
        """The loop, which runs from here on."""
        with self._change:
            if self._loop is None:
                loop: Loop = Loop(lambda job: self._draw(job, loop))
                loop.start()
                self._loop = loop
            return self._loop

    def _rest(self) -> None:
        """End the loop and give the renderer back, until a page asks again."""
        with self._change:
            loop, self._loop = self._loop, None
        if loop is not None:
            loop.close()
        self._drawing.close()

    # the thread that draws

    def _draw(self, job: Job, loop: Loop) -> bool:
        try:
            drawn = self._drawing.draw(job.stage, loop.check, loop.patience)
            self._put(drawn, job.sent + 1)
            return drawn.finer
        except Exception as error:  # a scene that cannot be rendered, a lost adapter, a fault of ours
            self._tell(error)
            return False

    def _put(self, drawn: Drawn, sent: int) -> None:
        about = {"kind": "frame", "sent": sent, **drawn.about()}
        self.send(about, buffers=[drawn.picture.data])
        if drawn.picture.mime == "image/png":
            self.still = drawn.picture.data

    def _tell(self, error: Exception) -> None:
        ours = isinstance(error, MiplightError)
        self.send({"kind": "error", "text": str(error) if ours else f"{type(error).__name__}: {error}"})

    # where there is no page

    def _bundle(self) -> dict[str, Any]:
        """Describe it to a notebook: the widget while it is open, and a picture for where there are none."""
        if not self.still:
            try:
                drawn = self._drawing.draw(1)
                self.still = drawn.picture.data
            except MiplightError as error:
                return {"text/plain": f"{self!r}: {error}"} | self._widget()
        picture = base64.b64encode(self.still).decode("ascii")
        return {"text/plain": repr(self), "image/png": picture} | self._widget()

    def _widget(self) -> dict[str, Any]:
        if not self._open:
            return {}
        return {_WIDGET: {"version_major": 2, "version_minor": 0, "model_id": self.model_id}}

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        return self._bundle()

    def _ipython_display_(self, **_: Any) -> None:
        # with a name, so that `close` can leave a picture in its place
        from IPython.display import display

        handle = display(self._bundle(), raw=True, display_id=True)
        if handle is not None:
            self._handles.append(handle)

    def __repr__(self) -> str:
        closed = "" if self._open else ", closed"
        return f"<LiveView {self.size[0]} × {self.size[1]} of {self.scene!r}{closed}>"


_views: weakref.WeakSet[LiveView] = weakref.WeakSet()


@atexit.register
def _rest_all() -> None:
    """No thread of ours is in the driver when the interpreter ends."""
    for view in list(_views):
        view._rest()
