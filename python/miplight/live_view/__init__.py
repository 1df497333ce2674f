"""A view of a scene in a notebook that follows the mouse."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from miplight.camera import Camera
from miplight.errors import SettingsError
from miplight.notebook import checked_exposure
from miplight.renderer import Renderer
from miplight.scene import Scene
from miplight.settings import Settings
from miplight.validate import as_number, fail

from .controls import KNOBS_SHOWN
from .drawing import Drawing
from .state import LiveState

if TYPE_CHECKING:
    from .widget import LiveView

__all__ = ["live"]


def live(
    scene: Scene,
    camera: Camera,
    settings: Settings | str | None = "default",
    *,
    knobs: Iterable[str] = KNOBS_SHOWN,
    exposure: float | None = None,
    target: ArrayLike | None = None,
    up: ArrayLike = (0.0, 1.0, 0.0),
    frames_per_second: float = 8.0,
    supersample: int = 2,
    renderer: Renderer | None = None,
    adapter: str = "auto",
) -> LiveView:
    """Show a scene in a notebook, in a view that follows the mouse.

    Drag to orbit, with Shift (or the right button) to pan, with Alt to move the light; the wheel zooms. While
    something moves, pictures are as small as they have to be to come in time, and where no size helps leave
    indirect light out; when nothing moves, the full size follows, then supersampling. Needs the extra
    ``notebook``.

    Parameters
    ----------
    scene
        Copied: what moves in the view is in ``view.scene``, and the given scene stays as it is.
    camera
        Where to begin, and the size of the picture in pixels.
    settings
        `Settings`, the name of a preset, or None for the default.
    knobs
        Settings that the view offers to change.
    exposure
        Stops; by default one that suits the first picture.
    target
        (3,), scene units: what to orbit around. By default the point of the view axis that is nearest to the
        middle of the scene.
    up
        (3,): the direction that stays up.
    frames_per_second
        What the size of moving pictures is chosen for, from 0.5 to 120.
    supersample
        Of the last picture when nothing moves, per axis: 1 (none), 2 or 4.
    renderer
        One that is open already, and stays open; by default one of the view's own, which is open while the
        view is on a page.
    adapter
        As for `Renderer`, for one of its own.

    Returns
    -------
    LiveView
        A widget with ``scene``, ``camera``, ``settings`` and ``frame`` as they are now, ``refresh()`` and
        ``close()``. In a saved notebook it is a picture.

    Raises
    ------
    SceneError, SettingsError
        For arguments that are none of these, or an installation without the extra ``notebook``. What goes
        wrong later is shown in the view.
    """
    state = LiveState(scene, camera, settings, knobs, checked_exposure(exposure), target, up)
    rate = as_number(frames_per_second, "frames_per_second", at_least=0.5, at_most=120.0, error=SettingsError)
    fine = state.view.settings.replace(supersample=supersample).supersample
    if renderer is not None and not isinstance(renderer, Renderer):
        fail("renderer", renderer, "a miplight.Renderer, or None", SettingsError)
    try:
        from .widget import LiveView
    except ImportError as error:
        raise SettingsError(
            "a live view needs anywidget; allowed: an installation with the extra notebook, "
            "pip install miplight[notebook]"
        ) from error
    return LiveView(state, Drawing(state, renderer, adapter, rate, fine))
