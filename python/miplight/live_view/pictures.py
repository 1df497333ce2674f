"""Pictures of frames for a page: exposed, with maps over them, encoded quickly or without loss."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miplight import notebook
from miplight.fragments import CULLED, NOTHING, Fragments, Reason
from miplight.frame import Frame

# Of a map that lies over a picture; the rest is the picture, in grey.
_SHARE_OF_MAP = 0.65
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # ITU-R BT.709


@dataclass(frozen=True)
class Picture:
    """An encoded picture, what its colours mean, and what has to be said about it.

    Parameters
    ----------
    data
        Bytes of a file.
    mime
        ``"image/png"`` or ``"image/jpeg"``.
    legend
        Pairs of a meaning and its colour, ``#rrggbb``.
    note
        What is missing, or empty.
    """

    data: bytes
    mime: str
    legend: list[tuple[str, str]]
    note: str


def exposure_of(frame: Frame) -> float:
    """Exposure, stops, that suits the lit surfaces of a frame that has `surface_mask`."""
    return notebook.auto_exposure(frame.image, frame.surface_mask)


def picture(
    frame: Frame, exposure: float, overlay: str = "off", note: str = "", *, lossless: bool = True
) -> Picture:
    """Show a frame.

    Parameters
    ----------
    frame
        With `image` and the maps that `overlay` needs.
    exposure
        Stops.
    overlay
        One of `controls.OVERLAYS`. A frame without such fragments, or with maps of internal pixels, shows its
        picture alone and says so.
    note
        What else has to be said about it.
    lossless
        A PNG, or else a JPEG, which is made in half the time and a fraction of the size.
    """
    pixels = notebook.to_srgb8(frame.image, exposure)
    legend: list[tuple[str, str]] = []
    fragments, missing = _fragments(frame, overlay)
    if fragments is not None:
        reasons = overlay == "reasons"
        values = fragments.reason_map if reasons else fragments.level_map
        colors = notebook.reason_colors(values) if reasons else notebook.level_colors(values)
        pixels = _blend(pixels, colors)
        legend = _legend(values, colors, reasons)
    return Picture(*_encode(pixels, lossless), legend, "; ".join(filter(None, (note, missing))))


def _fragments(frame: Frame, overlay: str) -> tuple[Fragments | None, str]:
    if overlay == "off":
        return None, ""
    found = frame.indirect_fragments if overlay.startswith("indirect") else frame.fragments
    if found is None:
        return None, "no fragments of indirect light"
    if found.level_map.shape != frame.image.shape[:2]:
        return None, "fragment maps are of internal pixels"
    return found, ""


def _blend(pixels: NDArray[np.uint8], colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    grey = (pixels @ _LUMINANCE)[..., np.newaxis]
    mixed = _SHARE_OF_MAP * colors + (1.0 - _SHARE_OF_MAP) * grey
    return np.asarray(np.round(mixed), np.uint8)


def _legend(values: NDArray[np.uint8], colors: NDArray[np.uint8], reasons: bool) -> list[tuple[str, str]]:
    present, first = np.unique(values, return_index=True)
    shown = colors.reshape(-1, 3)[first]
    return [
        (_meaning(int(value), reasons), f"#{color[0]:02x}{color[1]:02x}{color[2]:02x}")
        for value, color in zip(present, shown, strict=True)
    ]


def _meaning(value: int, reasons: bool) -> str:
    if value == NOTHING:
        return "nothing seen"
    if reasons:
        return Reason(value).name.lower().replace("_", "-")
    return "culled" if value == CULLED else f"level {value}"


def _encode(pixels: NDArray[np.uint8], lossless: bool) -> tuple[bytes, str]:
    from PIL import Image

    buffer = io.BytesIO()
    image = Image.fromarray(pixels)
    if lossless:
        image.save(buffer, format="PNG", compress_level=4)
        return buffer.getvalue(), "image/png"
    image.save(buffer, format="JPEG", quality=85)
    return buffer.getvalue(), "image/jpeg"
