"""What the stress suite shares: how long it runs, every preset at a small size, a lamp over a floor."""

from __future__ import annotations

import os
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import miplight as ml
from tests.analytic.closed_forms import floor_points, light_irradiance

Array = NDArray[np.float64]
T = TypeVar("T")

LONG = os.environ.get("MIPLIGHT_STRESS", "") == "long"
"""Whether `make stress` runs the suite: the same tests with more of everything."""

ALBEDO = np.array([0.8, 0.6, 0.4])
UP = np.array([0.0, 1.0, 0.0])
PRESETS = sorted(name for name, preset in ml.presets().items() if preset is not None)


OUTPUTS = ("image", "direct", "indirect", "fragments", "surface_mask", "light_mask")
"""What tests that render more than once read at once."""


def sized(short: T, long: T) -> T:
    """The size of a test: `short` in `make test`, `long` in `make stress`."""
    return long if LONG else short


def quick(preset: str, **changes: object) -> ml.Settings:
    """A preset with few samples."""
    return ml.Settings.preset(preset).replace(**{"light_samples": 64, **changes})


def variants() -> dict[str, ml.Settings]:
    """Every preset, and every way to find indirect light that no preset takes or that casts shadows."""
    made = {name: quick(name) for name in PRESETS}
    made["final-gather"] = quick("brute-force", indirect="final-gather", gather_rays=16)
    made["lpv"] = quick("default", indirect="lpv", lpv_samples=1024)
    made["splats with rays"] = quick("splatting-2009", indirect_visibility="on")
    made["cuts with rays"] = quick("hierarchical-2009", indirect_visibility="on")
    return made


def lamp(height: float = 2.0, size: float = 1.0) -> ml.AreaLight:
    """A skew light of about 1 × 1 over the floor that looks down and is not seen; `size` times as large."""
    corner, u, v = np.array([-0.6, height, -0.4]), np.array([1.2, 0.2, 0]), np.array([0.3, 0, 0.8])
    return ml.AreaLight(corner * size, u * size, v * size, radiance=(5.0, 3.0, 1.0), visible=False)


def floor_light(light: ml.AreaLight, camera: ml.Camera) -> Array:
    """What a floor at y = 0 of albedo `ALBEDO` reflects to each pixel, unshadowed: (H, W, 3) float64."""
    points = floor_points(camera)
    irradiance = light_irradiance(light, points, np.tile(UP, (len(points), 1)))
    return (ALBEDO / np.pi * irradiance).reshape(camera.height, camera.width, 3)


def worst(found: ArrayLike, expected: ArrayLike) -> float:
    """Largest error as a share of the largest expected value."""
    f, e = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    return float(np.abs(f - e).max() / np.abs(e).max())


def assert_sound(frame: ml.Frame, most: float = np.inf) -> None:
    """Every value is finite, none negative, no reflected light above `most`, and void is black."""
    for name in ("image", "direct", "indirect"):
        values = frame[name]
        assert np.isfinite(values).all(), (
            f"{name}: {np.count_nonzero(~np.isfinite(values))} values not finite"
        )
        assert values.min(initial=0.0) >= 0.0, f"{name}: {values.min()}"
    reflected = (frame.direct + frame.indirect)[frame.surface_mask]
    assert reflected.max(initial=0.0) <= most, f"{reflected.max()} is brighter than {most}"
    assert not frame.image[~(frame.surface_mask | frame.light_mask)].any()
