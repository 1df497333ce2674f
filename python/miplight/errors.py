"""The exceptions that miplight raises; all derive from `MiplightError`.

The Rust core raises these very classes, so this module imports nothing else of the package.
"""

from __future__ import annotations

__all__ = ["DeviceError", "MiplightError", "SceneError", "SettingsError", "ShaderError"]


class MiplightError(Exception):
    """Base class of every error that miplight raises on purpose."""


class SceneError(MiplightError, ValueError):
    """A mesh, material, light, camera or file that cannot be used.

    The message names the argument, shows the value and says what is allowed; nothing is left half-changed.
    """


class SettingsError(MiplightError, ValueError):
    """A setting that does not exist, is out of range, or asks for something that is not available yet."""


class DeviceError(MiplightError, RuntimeError):
    """No usable adapter, an adapter that was lost, or one whose limits are exceeded."""


class ShaderError(MiplightError, RuntimeError):
    """A shader that the driver refuses: a fault of miplight or of the driver, never of the scene."""
