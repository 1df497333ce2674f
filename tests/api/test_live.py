"""The Python side of a live view: messages, settings, pictures, errors, and what is left when it closes."""

from __future__ import annotations

import base64
import io
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import miplight as ml
from miplight._table import KNOBS
from miplight.live_view import controls
from miplight.live_view.state import Change, LiveState
from miplight.live_view.widget import LiveView
from miplight.notebook import auto_exposure, level_colors, to_srgb8

WIDGET = "application/vnd.jupyter.widget-view+json"


class Page:
    """Stands where a browser would: keeps what it is sent, and says that it showed it."""

    def __init__(self, view: LiveView) -> None:
        self.view, self.frames, self.errors = view, [], []
        self.pictures: list[bytes] = []
        view.send = self._receive

    def _receive(self, content: dict[str, Any], buffers: Any = None) -> None:
        if content["kind"] == "error":
            self.errors.append(content["text"])
            return
        self.frames.append(content)
        self.pictures.append(buffers[0])
        if content["sent"] > 0:
            self.say("shown", sent=content["sent"])

    def say(self, kind: str, **more: Any) -> None:
        """Send a message, as the page's script would."""
        self.view._receive(self.view, {"kind": kind, "page": "a", **more}, None)

    def until(self, there: Callable[[], Any], seconds: float = 20.0) -> None:
        """Wait until something is there."""
        end = time.monotonic() + seconds
        while not there():
            assert time.monotonic() < end, (self.frames, self.errors)
            time.sleep(0.005)

    def until_still(self, stage: str = "supersampled") -> None:
        """Wait for a picture of a stage after this moment."""
        seen = len(self.frames)
        self.until(lambda: stage in [frame["stage"] for frame in self.frames[seen:]])

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """What it shows."""
        return _pixels(self.pictures[-1])


def _pixels(data: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def _exposed(frame: ml.Frame) -> NDArray[np.uint8]:
    return to_srgb8(frame.image, auto_exposure(frame.image, frame.surface_mask))


@pytest.fixture
def view(room: ml.Scene, camera: ml.Camera, renderer: ml.Renderer) -> Iterator[LiveView]:
    made = ml.live(room, camera, renderer=renderer)
    yield made
    made.close()


@pytest.fixture
def page(view: LiveView) -> Page:
    opened = Page(view)
    opened.say("hello")
    opened.until_still()
    return opened


def test_without_a_page_there_is_a_picture(
    view: LiveView, room: ml.Scene, camera: ml.Camera, renderer: ml.Renderer
) -> None:
    bundle = view._repr_mimebundle_()
    assert bundle[WIDGET]["model_id"] == view.model_id
    expected = _exposed(renderer.render(room, camera))
    np.testing.assert_array_equal(_pixels(base64.b64decode(bundle["image/png"])), expected)
    assert view._loop is None, "nobody looks, so nothing is drawn"
    view.close()
    closed = view._repr_mimebundle_()
    assert WIDGET not in closed
    assert closed["image/png"] == bundle["image/png"]


def test_a_page_gets_coarse_pictures_while_something_moves_then_fine_ones(
    page: Page, room: ml.Scene, renderer: ml.Renderer
) -> None:
    assert [frame["stage"] for frame in page.frames] == ["full size", "supersampled"]
    expected = _exposed(renderer.render(room, page.view.camera, ml.Settings.preset("default")))
    np.testing.assert_array_equal(_pixels(page.pictures[0]), expected)
    page.view._drawing.pace.took(1e5, 1.0)
    page.say("move", orbit=[0.1, 0.02])
    page.say("still")
    page.until_still()
    moved = page.frames[2:]
    assert [frame["stage"] for frame in moved[-2:]] == ["full size", "supersampled"]
    assert [frame["mime"] for frame in moved[-2:]] == ["image/png", "image/png"]
    frame = renderer.render(room, page.view.camera, ml.Settings.preset("default").replace(supersample=2))
    assert _difference(page.pixels, _exposed(frame)) < 1.0  # exposure stays what the first picture asked for
    assert _difference(_pixels(page.pictures[0]), page.pixels) > 1.0
    assert frame.fragments.total == moved[-1]["fragments"]
    page.say("move", pan=[0.01, 0.0])
    page.until(lambda: page.frames[-1]["stage"] == "moving")
    coarse = page.frames[-1]
    assert (coarse["width"], coarse["mime"]) == (48 // 8, "image/jpeg")


def _difference(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    return float(np.abs(one.astype(np.float64) - other).mean())


def test_the_given_scene_stays_as_it_is(page: Page, room: ml.Scene) -> None:
    corner = np.array(room.lights["lamp"].corner)
    page.say("move", light=[0.1, 0.1, 0.0])
    page.say("set", name="power", value=1.0)
    lamp = page.view.scene.lights["lamp"]
    assert np.linalg.norm(lamp.corner - corner) > 0.1
    np.testing.assert_array_equal(lamp.radiance, (16, 16, 16))
    np.testing.assert_array_equal(room.lights["lamp"].corner, corner)
    np.testing.assert_array_equal(room.lights["lamp"].radiance, (8, 8, 8))
    before = page.pixels
    page.until_still()
    assert _difference(page.pixels, before) > 5.0
    page.say("reset")
    np.testing.assert_array_equal(lamp.corner, corner)
    np.testing.assert_array_equal(lamp.radiance, (8, 8, 8))
    page.until_still()
    np.testing.assert_array_equal(page.pixels, before)


def test_exposure_and_overlays_need_no_render(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    page.say("set", name="overlay", value="levels")
    page.until_still("full size")
    frame = page.view.frame
    assert frame is not None
    grey = (_exposed(frame) @ np.array([0.2126, 0.7152, 0.0722]))[..., None]
    expected = 0.65 * level_colors(frame.fragments.level_map) + 0.35 * grey
    assert np.abs(page.pixels - expected).max() <= 0.51
    names = [meaning for meaning, _ in page.frames[-1]["legend"]]
    assert "level 0" in names
    monkeypatch.setattr(page.view._drawing, "_render", lambda *_: pytest.fail("it renders"))
    page.say("set", name="overlay", value="reasons")
    assert "coarsest" in [meaning for meaning, _ in page.frames[-1]["legend"]]
    page.say("set", name="overlay", value="indirect levels")
    assert page.frames[-1]["note"] == "no fragments of indirect light"
    page.say("set", name="exposure", value=-2.0)
    stops = auto_exposure(frame.image, frame.surface_mask)
    np.testing.assert_array_equal(page.pixels, to_srgb8(frame.image, stops - 2.0))
    page.say("meter")
    np.testing.assert_array_equal(page.pixels, to_srgb8(frame.image, stops))
    assert page.view.values["exposure"] == 0.0


def test_errors_are_shown_and_do_not_end_it(page: Page) -> None:
    page.say("set", name="light_samples", value=0)
    assert "light_samples" in page.errors.pop()
    assert page.view.values["light_samples"] == KNOBS["light_samples"].default
    page.say("nonsense")
    assert "kind is 'nonsense'" in page.errors.pop()
    page.say("shown")
    assert "KeyError" in page.errors.pop()
    # what only a render finds out
    page.say("set", name="preset", value="radiosity-2009")
    page.say("set", name="indirect", value="final-gather")
    page.until(lambda: page.errors)
    assert "indirect_visibility" in page.errors[-1]
    page.say("set", name="preset", value="default")
    page.until_still("full size")
    monkey = pytest.MonkeyPatch()
    monkey.setattr(page.view._drawing, "_render", lambda *_: 1 / 0)
    page.errors.clear()
    page.view.refresh()
    page.until(lambda: page.errors)
    assert page.errors[0].startswith("ZeroDivisionError")
    monkey.undo()
    page.view.refresh()
    page.until_still()


def test_a_render_that_is_out_of_date_is_given_up(
    room: ml.Scene, camera: ml.Camera, renderer: ml.Renderer
) -> None:
    # some hundred million rays
    endless = ml.Settings.preset("brute-force").replace(light_samples=4096, supersample=4)
    view = ml.live(room, camera.replace(width=192, height=144), endless, renderer=renderer)
    page = Page(view)
    page.say("hello")
    time.sleep(0.4)
    assert not page.frames, "it takes many seconds"
    start = time.monotonic()
    page.say("set", name="preset", value="default")
    page.until_still()
    assert time.monotonic() - start < 3.0
    assert max(frame["rays"] for frame in page.frames) < 10_000_000
    assert not page.errors
    view.close()


def test_closing_frees_the_renderer_and_a_page_that_comes_back_gets_another(
    room: ml.Scene, camera: ml.Camera, adapter: str
) -> None:
    view = ml.live(room, camera, "brute-force", adapter=adapter, supersample=1)
    page = Page(view)
    page.say("hello")
    page.until_still("full size")
    own = view._drawing._own
    assert own is not None
    assert any(thread.name == "miplight-live" for thread in threading.enumerate())
    page.say("gone")
    assert view._drawing._own is None
    assert not any(thread.name == "miplight-live" for thread in threading.enumerate())
    with pytest.raises(ml.DeviceError, match="closed"):
        own.render(room, camera)
    page.say("hello")
    page.until_still("full size")
    assert view._drawing._own is not own
    view.close()
    view.close()
    assert view._drawing._own is None
    page.say("move", orbit=[0.1, 0.0])
    assert "closed" in repr(view)


def test_a_given_renderer_stays_open(view: LiveView, renderer: ml.Renderer, room: ml.Scene) -> None:
    page = Page(view)
    page.say("hello")
    page.until_still()
    view.close()
    renderer.render(room, view.camera)


@pytest.mark.parametrize("preset", sorted(ml.presets()))
def test_every_preset_moves(room: ml.Scene, camera: ml.Camera, renderer: ml.Renderer, preset: str) -> None:
    small = camera.replace(width=16, height=12)
    view = ml.live(room, small, preset, renderer=renderer, supersample=1)
    page = Page(view)
    pace = view._drawing.pace
    pace.took(1e5, 1.0, can_be_lean=True)
    assert pace.lean
    page.say("hello")
    page.until_still("full size")
    page.say("move", orbit=[0.05, 0.0])
    page.until_still("moving")
    indirect = ml.Settings.preset(preset).indirect != "off"
    assert ("indirect light when still" in page.frames[-1]["note"]) == indirect
    assert not page.errors
    view.close()


def test_controls_map_to_settings(room: ml.Scene, camera: ml.Camera) -> None:
    state = LiveState(room, camera, "area-2010", knobs=controls.KNOBS_SHOWN)
    assert [part["name"] for part in state.controls()] == [
        *("preset", "light_samples", "coarsest_level", "bit_threshold", "illumination_threshold", "indirect"),
        *("overlay", "exposure", "light", "power"),
    ]
    for part in state.controls():
        assert state.values()[part["name"]] in part["stops"]
        assert len(part["labels"]) == len(part["stops"])
        for stop in part["stops"]:
            state.take({"kind": "set", "name": part["name"], "value": stop})
            assert state.values()[part["name"]] == stop
    state.take({"kind": "set", "name": "preset", "value": "area-2010"})
    assert state.view.settings == ml.Settings.preset("area-2010")
    assert state.take({"kind": "set", "name": "bit_threshold", "value": None}) is Change.SETTINGS
    assert state.view.settings == ml.Settings.preset("area-2010").replace(bit_threshold=None)
    with pytest.raises(ml.SettingsError, match="preset"):
        state.take({"kind": "set", "name": "preset", "value": "area-2011"})
    assert state.values()["preset"] == "area-2010"


@pytest.mark.parametrize("name", sorted(KNOBS))
def test_every_setting_can_be_a_control(name: str, room: ml.Scene, camera: ml.Camera) -> None:
    part = controls.knob_control(name, KNOBS[name].default)
    assert part["stops"]
    for stop in part["stops"]:
        KNOBS[name].check(stop)


def test_settings_of_one_s_own_and_a_scene_without_lights(camera: ml.Camera) -> None:
    given = ml.Settings.preset("default").replace(light_samples=48)
    state = LiveState(ml.Scene(), camera, given)
    parts = {part["name"]: part for part in state.controls()}
    assert parts["preset"]["stops"][0] == controls.GIVEN
    assert 48 in parts["light_samples"]["stops"]
    assert "light" not in parts
    state.take({"kind": "set", "name": "preset", "value": "area-2016"})
    state.take({"kind": "set", "name": "preset", "value": controls.GIVEN})
    assert state.view.settings == given
    state.take({"kind": "move", "light": [0.5, 0.0, 0.0]})
    with pytest.raises(ml.SettingsError, match="name is 'power'"):
        state.take({"kind": "set", "name": "power", "value": 1.0})


def test_bad_arguments(room: ml.Scene, camera: ml.Camera, monkeypatch: pytest.MonkeyPatch) -> None:
    for error, name, given in (
        (ml.SettingsError, "settings", {"settings": 3}),
        (ml.SettingsError, "light_samples", {"knobs": ["light_sample"]}),
        (ml.SettingsError, "frames_per_second", {"frames_per_second": 0}),
        (ml.SettingsError, "supersample", {"supersample": 3}),
        (ml.SettingsError, "exposure", {"exposure": "bright"}),
        (ml.SettingsError, "renderer", {"renderer": "cpu"}),
    ):
        with pytest.raises(error, match=name):
            ml.live(room, camera, **given)  # type: ignore[arg-type]
    with pytest.raises(ml.SceneError, match="scene is"):
        ml.live(None, camera)
    with pytest.raises(ml.SceneError, match="camera is"):
        ml.live(room, None)
    monkeypatch.delitem(sys.modules, "miplight.live_view.widget")
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(ml.SettingsError, match=r"pip install miplight\[notebook\]"):
        ml.live(room, camera)


def test_the_page_s_script_loads_nothing() -> None:
    for text in (LiveView._esm, LiveView._css):
        assert not [
            word for word in ("http:", "https:", "import ", "import(", "@import", "url(") if word in text
        ]
    assert "export default { render }" in LiveView._esm
