"""Multiresolution image-space lighting of triangle scenes by area lights.

``import miplight as ml``; then `ml.render` for one call, or `ml.Scene`, `ml.Camera`, `ml.Settings` and
`ml.Renderer` for more. Radiance is linear RGB, float32, W·sr⁻¹·m⁻²; lengths are in scene units; angles that
users type are degrees.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

if "XDG_RUNTIME_DIR" not in os.environ:
    # Without a display server, Mesa's device-select layer complains on stderr; we choose adapters ourselves.
    os.environ.setdefault("NODEVICE_SELECT", "1")

from ._core import version as _version
from .camera import Camera
from .color import linear_to_srgb, srgb_to_linear
from .errors import DeviceError, MiplightError, SceneError, SettingsError, ShaderError
from .fragments import Fragments, Reason
from .frame import Frame
from .light import AreaLight
from .light_volume import LightVolume
from .live_view import live
from .material import Material
from .one_call import render
from .plan import Plan
from .renderer import Renderer, SoftwareAdapterWarning, adapters
from .scene import Scene
from .settings import Settings, presets
from .spot import SpotLight
from .stats import Stats
from .virtual_lights import VirtualLights

if TYPE_CHECKING:
    from . import metrics, mitsuba, notebook, shapes, study, testing

__all__ = [
    "AreaLight",
    "Camera",
    "DeviceError",
    "Fragments",
    "Frame",
    "LightVolume",
    "Material",
    "MiplightError",
    "Plan",
    "Reason",
    "Renderer",
    "Scene",
    "SceneError",
    "Settings",
    "SettingsError",
    "ShaderError",
    "SoftwareAdapterWarning",
    "SpotLight",
    "Stats",
    "VirtualLights",
    "adapters",
    "linear_to_srgb",
    "live",
    "metrics",
    "mitsuba",
    "notebook",
    "presets",
    "render",
    "shapes",
    "srgb_to_linear",
    "study",
    "testing",
]

__version__ = _version()

# Imported when first used: some of them need packages that a render does not.
_LAZY = frozenset({"metrics", "mitsuba", "notebook", "shapes", "study", "testing"})


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
