"""Pictures that a light may show: radiance to give to `AreaLight`, always the same for the same arguments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from miplight.validate import as_count, as_number

__all__ = ["color_card", "video_frame"]


def color_card(rows: int = 24, columns: int = 32, radiance: float = 6.0) -> NDArray[np.float32]:
    """Picture that no turn and no mirror leaves alike: gradients, bars of colour, one bright corner.

    Parameters
    ----------
    rows, columns : int, default 24, 32
    radiance : float, default 6.0
        Of a full bar, W·sr⁻¹·m⁻²; the bright corner, at the upper left, has five times as much.

    Returns
    -------
    (rows, columns, 3) float32
    """
    rows, columns = as_count(rows, "rows"), as_count(columns, "columns")
    level = as_number(radiance, "radiance", at_least=0.0)
    y, x = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    bars = np.stack([np.floor(8 * x) % 2, np.floor(4 * x) % 2, np.floor(2 * x) % 2], axis=-1)
    slope = np.stack([0.1 + 0.9 * x, 0.1 + 0.5 * y, 0.6 * (1 - y)], axis=-1)
    picture = np.where((y > 0.6)[..., None], 0.05 + 0.95 * bars, slope)
    picture[(y < 0.2) & (x < 0.15)] = (5.0, 4.2, 1.7)
    return (level * picture).astype(np.float32)


def video_frame(
    rows: int = 48, columns: int = 64, time: float = 0.0, peak: float = 60.0
) -> NDArray[np.float32]:
    """Frame of a film, as strong in contrast as one: a dark scene, two bright things that move, a subtitle.

    Parameters
    ----------
    rows, columns : int, default 48, 64
    time : float, default 0.0
        Seconds; the bright things move by about a tenth of the picture a second.
    peak : float, default 60.0
        Radiance of the brightest texel, W·sr⁻¹·m⁻²; the darkest have about a two-thousandth of it.

    Returns
    -------
    (rows, columns, 3) float32
    """
    rows, columns = as_count(rows, "rows"), as_count(columns, "columns")
    t, level = as_number(time, "time"), as_number(peak, "peak", at_least=0.0)
    y, x = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    night = 0.0005 + 0.02 * (1 - y)[..., None] ** 2 * np.array([0.2, 0.4, 1.0])
    sun = np.exp(-((x - 0.28 - 0.1 * np.sin(t)) ** 2 + (y - 0.3) ** 2) / 0.003)
    fire = np.exp(-(((x - 0.74) / 0.06) ** 2 + ((y - 0.62 - 0.03 * np.cos(3 * t)) / 0.12) ** 2))
    picture = night + sun[..., None] * (1.0, 0.9, 0.7) + fire[..., None] * (0.5, 0.18, 0.03)
    letters = (np.floor(40 * x) * 7 + np.floor(4 * t)) % 3 > 0
    picture[(y > 0.86) & (y < 0.92) & (x > 0.25) & (x < 0.75) & letters] = 0.25
    bright = level / float(picture.max())
    result: NDArray[np.float32] = (bright * picture).astype(np.float32)
    return result
