"""Pictures for people: exposure, sRGB, colours of fragment maps, PNG bytes. Nothing here is measured."""

from __future__ import annotations

import base64
import html
import io
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .color import linear_to_srgb
from .errors import SettingsError
from .fragments import CULLED, NOTHING, Reason
from .validate import as_number

_REASON_COLORS = {
    Reason.COARSEST: "#264b73",
    Reason.DEPTH: "#f2a93b",
    Reason.NORMAL: "#58a55c",
    Reason.ILLUMINATION: "#f6e27a",
    Reason.VISIBILITY: "#d6453d",
    Reason.LOBE: "#8e6bbf",
    Reason.EMITTER: "#ffffff",
    Reason.FACING_AWAY: "#b0b0b0",
    Reason.BEHIND_LIGHT: "#808080",
    Reason.OUTSIDE_LOBE: "#cdbfa8",
    Reason.NOTHING: "#000000",
}
LEVEL_NAMES = {CULLED: "culled", NOTHING: "nothing seen"}


def auto_exposure(image: NDArray[np.float32], surface_mask: NDArray[np.bool_] | None = None) -> float:
    """Exposure in stops that brings the 95th percentile of the lit surfaces' luminance to 0.8.

    Parameters
    ----------
    image
        (H, W, 3) linear radiance.
    surface_mask
        (H, W) bool; the pixels that count. All by default.
    """
    luminance = image @ np.array([0.2126, 0.7152, 0.0722], np.float32)  # ITU-R BT.709
    counted = luminance if surface_mask is None else luminance[surface_mask]
    counted = counted[np.isfinite(counted) & (counted > 0)]
    if counted.size == 0:
        return 0.0
    return math.log2(0.8 / float(np.percentile(counted, 95)))


def to_srgb8(image: ArrayLike, exposure: float = 0.0) -> NDArray[np.uint8]:
    """Expose linear radiance and encode it as 8-bit sRGB [IEC61966].

    Parameters
    ----------
    image
        (H, W, 3) linear radiance, W·sr⁻¹·m⁻².
    exposure
        Stops: radiance is multiplied by 2^exposure, then clipped to [0, 1].

    Returns
    -------
    (H, W, 3) uint8
    """
    linear = np.nan_to_num(np.asarray(image, np.float64) * 2.0**exposure, nan=0.0, posinf=1.0)
    encoded: NDArray[np.uint8] = linear_to_srgb(linear, dtype=np.uint8)
    return encoded


def checked_exposure(exposure: float | None) -> float | None:
    """`exposure` as a float, or None for one that is found from the picture.

    Raises
    ------
    SettingsError
        If it is not a finite number.
    """
    if exposure is None:
        return None
    return as_number(exposure, "exposure", at_least=-100, at_most=100, unit="stops", error=SettingsError)


def level_colors(level_map: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours of a level map: fine levels light, coarse levels dark, culled grey, nothing black.

    Level 8 and coarser ones, which are rare, are red.

    Parameters
    ----------
    level_map
        (H, W) uint8.

    Returns
    -------
    (H, W, 3) uint8
    """
    from matplotlib import colormaps

    table = np.zeros((256, 3), np.uint8)
    steps = colormaps["viridis"](np.linspace(1.0, 0.0, 8))[:, :3]
    table[:8] = np.round(steps * 255)
    table[8:17] = np.round(colormaps["Reds"](np.linspace(0.4, 1.0, 9))[:, :3] * 255)
    table[17:CULLED] = table[16]
    table[CULLED] = 128
    return table[level_map]


def reason_colors(reason_map: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours of a reason map: one for each reason to refine, greys for what is culled, black for nothing.

    Parameters
    ----------
    reason_map
        (H, W) uint8 of `Reason`.

    Returns
    -------
    (H, W, 3) uint8
    """
    from matplotlib.colors import to_rgb

    table = np.zeros((256, 3), np.uint8)
    for reason, color in _REASON_COLORS.items():
        table[reason] = np.round(np.array(to_rgb(color)) * 255)
    return table[reason_map]


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """(H, W, 3) uint8 as the bytes of a PNG file."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG")
    return buffer.getvalue()


def display_png(png: bytes) -> bool:
    """Show a PNG in a running notebook; False if there is none."""
    try:
        from IPython import get_ipython
        from IPython.display import Image, display
    except ImportError:
        return False
    shell: Any = get_ipython()
    if shell is None or not hasattr(shell, "kernel"):
        return False
    display(Image(data=png))
    return True


def display_window(png: bytes, title: str) -> None:
    """Show a PNG in a window of matplotlib; without a display nothing appears and nothing fails."""
    from matplotlib import get_backend
    from matplotlib import pyplot as plt

    figure = plt.figure(title)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(plt.imread(io.BytesIO(png)), interpolation="nearest")
    axes.set_axis_off()
    if get_backend().lower() != "agg":
        plt.show(block=False)


def frame_html(png: bytes, caption: str, table: str) -> str:
    """A frame as HTML: the picture, what it is, and its passes folded away."""
    data = base64.b64encode(png).decode("ascii")
    return (
        f"<figure><img src='data:image/png;base64,{data}'>"
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
        f"<details><summary>passes</summary>{table}</details>"
    )
