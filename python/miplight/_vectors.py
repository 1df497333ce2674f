"""Small vectors: unit length, and how messages print them."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CHANGE", "format_color", "format_vector", "rgb", "unit", "xyz"]

CHANGE = threading.Lock()
"""Held while a light reads its state, derives a new one and stores it, so that no change is lost."""


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale a vector that is not zero to length 1."""
    scaled = vector / np.abs(vector).max()  # first, because the square of a tiny length would underflow
    result: NDArray[np.float64] = scaled / np.linalg.norm(scaled) + 0.0  # turns -0.0 into 0.0
    return result


def rgb(color: NDArray[np.float32]) -> tuple[float, float, float]:
    """Return the first texel, or the colour, as three Python floats."""
    red, green, blue = (float(c) for c in color.reshape(-1)[:3])
    return (red, green, blue)


def xyz(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return a vector as three Python floats."""
    x, y, z = (float(v) for v in vector)
    return (x, y, z)


def format_vector(values: NDArray[Any]) -> str:
    """Print a vector with six digits, as Python would take it back."""
    return f"({', '.join(f'{v:.6g}' for v in values)})"


def format_color(color: NDArray[np.float32]) -> str:
    """Print a colour, or the size of an image."""
    return format_vector(color) if color.ndim == 1 else f"<{color.shape[0]}x{color.shape[1]} image>"
