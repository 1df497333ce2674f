"""What the command line says: what it is doing, what became of a picture, and how to get a driver."""

from __future__ import annotations

import platform
import shutil
import sys
import threading
import time
from types import TracebackType

import click
import numpy as np

from .frame import Frame

__all__ = ["Working", "driver_hint", "lit_hint", "summary"]

_DRIVERS = {
    "apt-get": "sudo apt-get update && sudo apt-get install -y libvulkan1 mesa-vulkan-drivers",
    "dnf": "sudo dnf install -y vulkan-loader mesa-vulkan-drivers",
    "pacman": "sudo pacman -S --noconfirm vulkan-icd-loader vulkan-swrast",
    "zypper": "sudo zypper install -y libvulkan1 Mesa-vulkan-device-select libvulkan_lvp",
    "apk": "sudo apk add vulkan-loader mesa-vulkan-swrast",
}
_TICK_S = 0.5


def driver_hint() -> str:
    """The command that installs a software adapter on this machine, or what to look for."""
    if platform.system() != "Linux":
        return "install a driver for the graphics card: Metal and DirectX 12 come with their systems"
    for manager, command in _DRIVERS.items():
        if shutil.which(manager):
            return f"install Mesa's software driver, which needs no GPU:\n  {command}"
    return "install the Vulkan loader and Mesa's driver lavapipe, which needs no GPU"


def lit_hint(frame: Frame) -> str:
    """Why a picture is black although something is seen; an empty string if it is not."""
    if frame.image.any():
        return ""
    if not frame.surface_mask.any():
        return "nothing is seen: --origin and --target say from where to look, and at what"
    return (
        "no light reaches what is seen: a light inside (--light) or a view from elsewhere (--origin) may help"
    )


def summary(frame: Frame) -> str:
    """Size, fragments, rays and time in one line."""
    seen = int(np.count_nonzero(frame.fragments.level_map < 254))
    return (
        f"{frame.width} × {frame.height}, {frame.fragments.total:,} fragments for {seen:,} pixels, "
        f"{frame.stats.rays:,} rays, {frame.stats.total_ms:,.0f} ms on {frame.stats.adapter}"
    )


class Working:
    """A line on the standard error for work that takes a while; on a terminal with the seconds so far.

    Parameters
    ----------
    what
        What is being done.
    quiet
        Say nothing.
    """

    def __init__(self, what: str, quiet: bool = False) -> None:
        self._what = what
        self._quiet = quiet
        self._done = threading.Event()
        self._thread: threading.Thread | None = None
        self._start = 0.0

    def __enter__(self) -> Working:
        self._start = time.monotonic()
        if self._quiet:
            return self
        if sys.stderr.isatty():
            self._thread = threading.Thread(target=self._tick, daemon=True)
            self._thread.start()
        else:
            click.echo(self._what, err=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread is not None:
            self._done.set()
            self._thread.join()
            click.echo(f"\r{self._line()}", err=True)

    def _line(self) -> str:
        return f"{self._what}, {time.monotonic() - self._start:.1f} s"

    def _tick(self) -> None:
        while True:
            click.echo(f"\r{self._line()}", err=True, nl=False)
            if self._done.wait(_TICK_S):
                return
