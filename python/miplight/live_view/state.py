"""What a view shows: a scene of its own, from where, with which settings, and how a message changes it."""

from __future__ import annotations

import enum
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from miplight.camera import Camera
from miplight.errors import SceneError, SettingsError
from miplight.light import AreaLight, Light, SpotLight
from miplight.scene import Scene
from miplight.settings import Settings, as_settings, presets
from miplight.validate import as_choice, as_number, as_vector, fail

from . import controls
from .orbit import Orbit, move_light


class Change(enum.Enum):
    """What a message asks for."""

    NOTHING = 0
    LOOK = 1  # the same radiance, shown otherwise
    MOVED = 2
    SETTINGS = 3


@dataclass(frozen=True)
class View:
    """What a picture is made of, taken at one moment."""

    camera: Camera
    settings: Settings
    overlay: str
    exposure: float | None


class LiveState:
    """The state behind a view; every method may be called from any thread.

    Parameters
    ----------
    scene
        Copied: what a view moves stays inside of it.
    camera
        Where to begin, and the size of the full picture.
    settings
        `Settings`, the name of a preset, or None for the default.
    knobs
        Settings that the view offers to change.
    exposure
        Stops, or None for one that suits the first picture.
    target, up
        As for `Orbit.around`.

    Raises
    ------
    SceneError, SettingsError
        For arguments that are none of these.
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        settings: Settings | str | None = None,
        knobs: Iterable[str] = controls.KNOBS_SHOWN,
        exposure: float | None = None,
        target: ArrayLike | None = None,
        up: ArrayLike = (0.0, 1.0, 0.0),
    ) -> None:
        if not isinstance(scene, Scene):
            fail(
                "scene", scene, "a miplight.Scene; Scene.from_trimesh makes one of trimesh meshes", SceneError
            )
        if not isinstance(camera, Camera):
            fail("camera", camera, "a miplight.Camera", SceneError)
        self._lock = threading.RLock()
        self._given = as_settings(settings)
        self._knobs = controls.checked_knobs(knobs)
        self.scene = scene.copy()
        """The scene that is shown: yours to change; `LiveView.refresh` shows it."""
        self._start = Orbit.around(camera, scene.bounds, target, up)
        self._metered = exposure
        self._begin()

    def _begin(self) -> None:
        self._orbit = self._start
        self._settings = self._given
        self._values: dict[str, Any] = {
            "preset": controls.preset_name(self._given),
            "overlay": "off",
            "exposure": 0.0,
        }
        self._lit: dict[str, Light] = {name: light.copy() for name, light in self.scene.lights.items()}
        self._stops = dict.fromkeys(self._lit, 0.0)
        self._light = next(iter(self._lit), "")

    @property
    def view(self) -> View:
        """What to draw now."""
        with self._lock:
            stops = None if self._metered is None else self._metered + self._values["exposure"]
            return View(self._orbit.camera, self._settings, self._values["overlay"], stops)

    def meter(self, exposure: float) -> None:
        """Exposure, stops, that the control of exposure counts from."""
        with self._lock:
            self._metered = exposure

    # for the page

    def controls(self) -> list[dict[str, Any]]:
        """Describe the controls, in their order: see `controls.control`."""
        with self._lock:
            names = list(presets())
            if controls.preset_name(self._given) == controls.GIVEN:
                names.insert(0, controls.GIVEN)
            listed = [
                controls.control("preset", "preset", names, "The method and its settings.", slider=False)
            ]
            values = self._settings.to_dict()
            listed += [controls.knob_control(name, values[name]) for name in self._knobs]
            title = "What lies over the picture: the level of the fragment that shades each pixel, or why."
            listed.append(controls.control("overlay", "overlay", controls.OVERLAYS, title, slider=False))
            title = "Stops: radiance is multiplied by two to the power of this."
            listed.append(controls.control("exposure", "exposure", controls.STOPS, title, slider=True))
            if self._lit:
                title = "The light that is moved, and whose power is changed."
                listed.append(controls.control("light", "light", self._lit, title, slider=False))
                title = "Stops: the light is multiplied by two to the power of this."
                listed.append(controls.control("power", "its power", controls.STOPS, title, slider=True))
            return listed

    def values(self) -> dict[str, Any]:
        """Value of each control by its name."""
        with self._lock:
            knobs = {name: self._settings.to_dict()[name] for name in self._knobs}
            light = {"light": self._light, "power": self._stops[self._light]} if self._lit else {}
            return {**self._values, **knobs, **light}

    # from the page

    def take(self, message: Mapping[str, Any]) -> Change:
        """Do what a message of the page asks for, all of it or nothing.

        Parameters
        ----------
        message
            ``{"kind": "move", "orbit": [x, y], "pan": [x, y], "zoom": n, "light": [x, y, n]}``: ways of the
            hand in fractions of the picture's height, right and down, and notches of the wheel; all may be
            missing. ``{"kind": "set", "name": …, "value": …}``: a control. ``{"kind": "reset"}``: everything
            as at the start. ``{"kind": "meter"}``: find the exposure again.

        Raises
        ------
        SceneError, SettingsError
            For what is not allowed.
        """
        kind = as_choice(message.get("kind"), "kind", ("move", "set", "reset", "meter"), SettingsError)
        with self._lock:
            if kind == "move":
                return self._move(message)
            if kind == "set":
                return self._set(message.get("name"), message.get("value"))
            if kind == "meter":
                self._metered, self._values["exposure"] = None, 0.0
                return Change.LOOK
            self._put_lights_back()
            self._begin()
            return Change.SETTINGS

    def _move(self, message: Mapping[str, Any]) -> Change:
        turn, pan = (_pair(message, name) for name in ("orbit", "pan"))
        zoom = as_number(message.get("zoom", 0.0), "zoom", at_least=-1e3, at_most=1e3, error=SettingsError)
        orbit = self._orbit
        if any(turn):
            orbit = orbit.turned(*turn)
        if any(pan):
            orbit = orbit.shifted(*pan)
        if zoom:
            orbit = orbit.zoomed(zoom)
        way = as_vector(message.get("light", (0.0, 0.0, 0.0)), "light")
        if way.any() and self._lit:
            light = self._shown_light(self._light)
            move_light(light, self._orbit.light_step(light, *way.tolist()))
        self._orbit = orbit
        return Change.MOVED

    def _set(self, name: Any, value: Any) -> Change:
        lights = ("light", "power") if self._lit else ()
        allowed = ("preset", "overlay", "exposure", *self._knobs, *lights)
        chosen = as_choice(name, "name", allowed, SettingsError)
        if chosen in self._knobs:
            self._settings = self._settings.replace(**{chosen: value})
            return Change.SETTINGS
        if chosen == "preset":
            given = value == controls.GIVEN
            self._settings = self._given if given else Settings.preset(value)
            self._values["preset"] = value
            return Change.SETTINGS
        if chosen == "overlay":
            self._values["overlay"] = as_choice(value, "overlay", controls.OVERLAYS, SettingsError)
            return Change.LOOK
        if chosen == "light":
            self._light = as_choice(value, "light", tuple(self._lit), SettingsError)
            return Change.NOTHING
        stops = as_number(value, chosen, at_least=-100, at_most=100, unit="stops", error=SettingsError)
        if chosen == "exposure":
            self._values["exposure"] = stops
            return Change.LOOK
        _dim(self._shown_light(self._light), self._lit[self._light], stops)
        self._stops[self._light] = stops
        return Change.MOVED

    def _shown_light(self, name: str) -> Light:
        light: Light = self.scene.lights[name]
        return light

    def _put_lights_back(self) -> None:
        for name, start in self._lit.items():
            light = self._shown_light(name)
            if isinstance(light, AreaLight) and isinstance(start, AreaLight):
                light.set_geometry(start.corner, start.edge_u, start.edge_v)
            elif isinstance(light, SpotLight) and isinstance(start, SpotLight):
                light.set_geometry(start.position, start.target)
            _dim(light, start, 0.0)


def _dim(light: Light, start: Light, stops: float) -> None:
    """Give a light the power that it had at the start, times two to the power of `stops`."""
    if isinstance(light, AreaLight) and isinstance(start, AreaLight):
        light.radiance = start.radiance * 2.0**stops
    elif isinstance(light, SpotLight) and isinstance(start, SpotLight):
        light.intensity = start.intensity * 2.0**stops


def _pair(message: Mapping[str, Any], name: str) -> tuple[float, float]:
    right, down, _ = as_vector([*message.get(name, (0.0, 0.0)), 0.0], name).tolist()
    return right, down
