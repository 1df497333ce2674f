"""Mitsuba's time and error from 16 to 1,024 samples, with its default sampler and with its best one."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

import miplight as ml

SAMPLES = (16, 64, 256, 1024)
SAMPLERS = ("independent", "multijitter")
REPEATS = 3
LONG_MS = 3000.0  # a picture that takes longer is rendered once more and no oftener


def sweep(
    scene: ml.Scene, camera: ml.Camera, max_depth: int, light_mask: NDArray[np.bool_], spp: int
) -> list[dict[str, Any]]:
    """Time Mitsuba and measure its error against a reference of its own kind (samples all over the pixel).

    Parameters
    ----------
    scene, camera
        What is rendered, from where.
    max_depth
        2 for direct light, 3 for one bounce.
    light_mask
        (H, W) bool: pixels that see a light. They and their neighbours, whose samples may see it, do not
        count.
    spp
        Samples of the reference, each half.

    Returns
    -------
    list of dict
        sampler, spp, ms (the fastest of three after one that compiles), relative_rmse, median_relative_error.
    """
    reference = ml.mitsuba.reference(scene, camera, spp=spp, max_depth=max_depth, pixel="box")
    mask = ~ndimage.binary_dilation(light_mask, np.ones((3, 3))) & (reference.mean.max(axis=-1) > 0)
    rows = []
    for sampler in SAMPLERS:
        for count in SAMPLES:
            image, ms = _timed(scene, camera, max_depth, sampler, count)
            rows.append(
                {
                    "sampler": sampler,
                    "spp": count,
                    "ms": ms,
                    "relative_rmse": ml.metrics.relative_rmse(image, reference, mask=mask, trim=0.001),
                    "median_relative_error": ml.metrics.median_relative_error(image, reference, mask=mask),
                }
            )
    return rows


def _timed(
    scene: ml.Scene, camera: ml.Camera, max_depth: int, sampler: str, spp: int
) -> tuple[NDArray[np.float32], float]:
    with ml.mitsuba.activate() as mi:
        description = ml.mitsuba.to_dict(scene, camera, max_depth=max_depth, spp=spp, sampler=sampler)
        loaded = mi.load_dict(description)
        times = []
        image: Any = None
        for seed in range(REPEATS + 1):
            start = time.perf_counter()
            image = np.array(mi.render(loaded, spp=spp, seed=seed))
            times.append(1000.0 * (time.perf_counter() - start))
            if len(times) > 1 and times[-1] > LONG_MS:
                break
    return image[..., :3].astype(np.float32), min(times[1:])


def time_to_error(rows: list[dict[str, Any]], error: float, sampler: str = "multijitter") -> float | None:
    """Milliseconds at which Mitsuba reaches a relative RMSE, between (never beyond) the counts measured."""
    chosen = sorted((row for row in rows if row["sampler"] == sampler), key=lambda row: row["spp"])
    errors = np.log([max(row["relative_rmse"], 1e-9) for row in chosen])
    times = np.log([row["ms"] for row in chosen])
    wanted = np.log(max(error, 1e-9))
    if not errors.min() <= wanted <= errors.max():
        return None
    order = np.argsort(errors)
    return float(np.exp(np.interp(wanted, errors[order], times[order])))
