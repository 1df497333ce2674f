"""What a sweep renders: the points of its grid, each known by a hash of all that its picture depends on."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._pixels import as_picture
from ._table import KNOBS, unknown
from .camera import Camera
from .errors import SettingsError
from .mitsuba.cache import content_key
from .one_call import as_lights
from .scene import Scene
from .settings import Settings, as_settings
from .validate import fail

if TYPE_CHECKING:
    from ._pixels import AnyReference

__all__ = ["Point", "Study", "make_study"]

OWN_LIGHTS = "scene"
"""Name of the lights that a scene has itself."""
ONLY_CAMERA = "camera"
"""Name of a camera that was given without one."""
_NAMED = ("camera", "lights")
_GRID = "a dict of settings with the values to try, Settings, the name of a preset, or a list of these"


@dataclasses.dataclass(frozen=True)
class Point:
    """One combination of settings, camera and lights.

    Parameters
    ----------
    settings
        Every knob.
    camera, lights
        Names in the study.
    key
        32 hexadecimal digits: a hash of the settings, the scene with its lights, the camera, the reference
        and whether its first frame is thrown away.
    """

    settings: Settings
    camera: str
    lights: str
    key: str

    @property
    def preset(self) -> str:
        """Name of the preset that the settings started from, or an empty string."""
        return self.settings._base


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """What the points of a sweep share; it can be sent to another process.

    Parameters
    ----------
    scenes
        By the name of their lights; geometry is shared between them.
    cameras
        By name.
    references
        By camera and lights; None where there is none.
    repeats
        Measured renders of each point.
    adapter
        As for `Renderer`.
    token
        Different for each sweep.
    """

    scenes: dict[str, Scene]
    cameras: dict[str, Camera]
    references: dict[tuple[str, str], AnyReference | None]
    repeats: int
    adapter: str = "auto"
    token: str = dataclasses.field(default_factory=lambda: uuid.uuid4().hex)


def make_study(
    scene: Scene,
    camera: Camera | Mapping[str, Camera] | None,
    grid: Any,
    reference: Any,
    repeats: int,
    adapter: str,
) -> tuple[Study, list[Point]]:
    """Check everything that `miplight.study.sweep` was given, and list its points.

    Raises
    ------
    SceneError
        For a scene, camera or lights that are none.
    SettingsError
        For an unknown setting or preset, a value that is not allowed, or a reference that does not fit.
    """
    if not isinstance(scene, Scene):
        fail("scene", scene, "a miplight.Scene")
    own = scene.copy()  # later changes to the scene are not those of this sweep
    scenes: dict[str, Scene] = {}
    cameras: dict[str, Camera] = {}
    given = _given_cameras(camera)
    wanted: list[tuple[Settings, str, str]] = []
    for part in _parts(grid):
        here = {name: part.pop(name, None) for name in _NAMED}
        names = _names(_mapping(here["camera"], "camera"), cameras, _checked_camera, "camera")
        seen = names or _names(given, cameras, _checked_camera, "camera")
        if not seen:
            fail("camera", camera, "a miplight.Camera, a dict of them, or cameras in the grid")
        lit = _names(_mapping(here["lights"], "lights"), scenes, lambda value: _lit(own, value), "lights")
        if not lit:
            scenes[OWN_LIGHTS], lit = own, [OWN_LIGHTS]
        # settings vary fastest: lights and geometry are uploaded as seldom as can be
        wanted += [(knobs, *place) for place in itertools.product(seen, lit) for knobs in _settings(part)]
    places = dict.fromkeys((view, lights) for _, view, lights in wanted)
    references = {place: _reference(reference, place, cameras[place[0]]) for place in places}
    study = Study(scenes, cameras, references, repeats, adapter)
    return study, _keyed(study, wanted)


def _keyed(study: Study, wanted: Iterable[tuple[Settings, str, str]]) -> list[Point]:
    """Give each combination its hash; what is asked for twice is rendered once."""
    content: dict[tuple[str, str], str] = {}
    points: dict[str, Point] = {}
    for settings, camera, lights in wanted:
        place = camera, lights
        if place not in content:
            picture = content_key(study.scenes[lights], study.cameras[camera])
            content[place] = picture + _reference_key(study.references[place])
        # names are part of it: two rows of the same picture under two names are two rows
        about = [settings.to_dict(), settings._base, camera, lights, content[place], study.repeats > 1]
        key = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:32]
        points.setdefault(key, Point(settings, camera, lights, key))
    return list(points.values())


def _parts(grid: Any) -> Iterator[dict[str, Any]]:
    """The grid as dicts from names to values; settings are a preset with nothing to vary."""
    listed = [grid] if isinstance(grid, (Mapping, Settings, str)) else grid
    if not isinstance(listed, Sequence):
        fail("grid", grid, _GRID, SettingsError)
    for part in listed:
        if isinstance(part, (Settings, str)):
            yield {"preset": [part]}
        elif isinstance(part, Mapping):
            yield dict(part)
        else:
            fail("grid", part, _GRID, SettingsError)


def _settings(part: Mapping[str, Any]) -> Iterator[Settings]:
    """Every combination of the values, the last name varying fastest."""
    values = {name: _values(name, value) for name, value in part.items()}
    presets = [as_settings(value) for value in values.pop("preset", ["default"])]
    for name in values:
        if name not in KNOBS:
            raise unknown("setting", name, [*KNOBS, "preset", *_NAMED])
    for preset in presets:
        for choice in itertools.product(*values.values()):
            yield preset.replace(**dict(zip(values, choice, strict=True)))


def _values(name: str, given: Any) -> list[Any]:
    """The values of one name: a lone value is one of one."""
    if isinstance(given, (str, Settings)) or not isinstance(given, (Iterable, np.ndarray)):
        return [given]
    values = list(np.atleast_1d(given)) if isinstance(given, np.ndarray) else list(given)
    if not values:
        fail(f"grid[{name!r}]", given, "one value or more", SettingsError)
    return values


def _mapping(value: Any, name: str) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not value or not all(isinstance(key, str) for key in value):
        fail(f"grid[{name!r}]", value, "a dict from names to alternatives", SettingsError)
    return value


def _names(given: Mapping[str, Any], known: dict[str, Any], make: Any, what: str) -> list[str]:
    """Names of the alternatives, which are made and added to those that are known."""
    for name, value in given.items():
        made = make(value)
        there = known.get(name)
        if there is not None and _differ(there, made):
            fail(f"grid[{what!r}]", name, "a name that has not been given to something else", SettingsError)
        known[name] = made
    return list(given)


def _differ(one: Any, other: Any) -> bool:
    if isinstance(one, Camera):
        return bool(one != other)
    view = Camera.look_at((0, 0, 1), (0, 0, 0), width=1, height=1)
    return content_key(one, view) != content_key(other, view)


def _given_cameras(camera: Any) -> dict[str, Camera]:
    if camera is None:
        return {}
    named = camera if isinstance(camera, Mapping) else {ONLY_CAMERA: camera}
    return {str(name): _checked_camera(value) for name, value in named.items()}


def _checked_camera(camera: Any) -> Camera:
    if not isinstance(camera, Camera):
        fail("camera", camera, "a miplight.Camera, or a dict of them by name")
    return camera


def _lit(scene: Scene, lights: Any) -> Scene:
    """The scene with other lights, which may be anything that `miplight.render` takes."""
    made = scene.copy()
    for name in made.lights:
        made.remove(name)
    for light in as_lights(lights):
        made.add_light(light.copy())
    return made


def _reference(given: Any, place: tuple[str, str], camera: Camera) -> AnyReference | None:
    """The reference of a place: one for all, or by camera, by lights or by both in a dict."""
    found = given
    if isinstance(given, Mapping):
        names = (place, *place)
        found = next((given[name] for name in names if name in given), None)
        if found is None:
            raise SettingsError(
                f"reference has nothing for camera {place[0]!r} and lights {place[1]!r}; "
                "allowed: one reference, or a dict by camera, by lights, or by (camera, lights)"
            )
    if found is None:
        return None
    source: Any = found
    picture = as_picture(source.mean if hasattr(source, "halves") else source, "reference")
    if picture.shape != (camera.height, camera.width, 3):
        size = f"({camera.height}, {camera.width}, 3), the size of the camera {place[0]!r}"
        fail("reference", picture, f"a picture of shape {size}", SettingsError)
    return source if hasattr(source, "halves") else np.ascontiguousarray(source)


def _reference_key(reference: Any) -> str:
    """A hash of a reference, so that errors against another one are not taken for its own."""
    if reference is None:
        return ""
    digest = hashlib.sha256()
    for array in (reference.mean, reference.halves) if hasattr(reference, "halves") else (reference,):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(str(getattr(reference, "info", {}).get("part", "")).encode())
    return digest.hexdigest()
