"""Mitsuba's time to a given error: its errors are kept on disk, its times are measured in this run.

What is timed is the job that we do, direct light through the pixel centres, with the `multijitter` sampler,
by the integrator that is faster to the error: light sampling alone, or light and material sampling weighted.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

import miplight as ml
from miplight.mitsuba import Reference, cache

SAMPLES = (16, 64, 256, 1024)
INTEGRATORS: dict[str, dict[str, Any]] = {
    "light": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
    "weighted": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 1},
}
COST = {"light": 1.0, "weighted": 2.2}  # time of a sample, about: which of the two is worth timing
REPEATS = 3
LONG_MS = 3000.0  # a picture that takes longer is rendered once more and no oftener

Image = NDArray[np.float32]


class Peer:
    """Mitsuba on one scene and camera.

    Parameters
    ----------
    scene, camera
        What is rendered, from where.
    sampler
        Of Mitsuba.
    integrators
        By name: which may do the job; by default those of direct light.
    """

    def __init__(
        self,
        scene: ml.Scene,
        camera: ml.Camera,
        sampler: str = "multijitter",
        integrators: dict[str, dict[str, Any]] | None = None,
    ) -> None:
        self.scene, self.camera, self.sampler = scene, camera, sampler
        self.integrators = integrators or INTEGRATORS

    def time_to(self, error: float, reference: Reference, mask: NDArray[np.bool_]) -> dict[str, Any]:
        """Milliseconds to a relative RMSE, by the faster integrator.

        Returns
        -------
        dict
            ms, integrator, bound ("=": between two counts, ">": 1,024 samples are not good enough, "<": 16
            are better already), points [(spp, ms, error)] of what was timed.
        """
        swept = {name: self._errors(name, error, reference, mask) for name in self.integrators}
        work = {name: COST.get(name, 1.0) * _samples_to(error, errors) for name, errors in swept.items()}
        best = min(work, key=lambda name: work[name])
        return self._at(best, error, swept[best]) | {"integrator": best}

    def _errors(
        self, name: str, error: float, reference: Reference, mask: NDArray[np.bool_]
    ) -> dict[int, float]:
        """Relative RMSE by samples a pixel, up to the first count that reaches `error`."""
        errors: dict[int, float] = {}
        for count in SAMPLES:
            image = self.picture(name, count)
            errors[count] = ml.metrics.relative_rmse(image, reference, mask=mask, trim=0.001)
            if errors[count] <= error:
                break
        return errors

    def _at(self, name: str, error: float, errors: dict[int, float]) -> dict[str, Any]:
        """Time the two counts around `error`, and interpolate as straight lines of logarithms."""
        counts = list(errors)[-2:]
        times = [self._render(name, count, REPEATS)[1] for count in counts]
        points = [(count, ms, errors[count]) for count, ms in zip(counts, times, strict=True)]
        if errors[counts[-1]] > error:
            return {"ms": times[-1], "bound": ">", "points": points}
        if len(counts) == 1:
            return {"ms": times[0], "bound": "<", "points": points}
        logs = [np.log(max(errors[count], 1e-9)) for count in counts]
        share = (np.log(max(error, 1e-9)) - logs[0]) / (logs[1] - logs[0])
        return {"ms": float(times[0] ** (1 - share) * times[1] ** share), "bound": "=", "points": points}

    def picture(self, name: str, spp: int) -> Image:
        """One picture, from the cache if it is there."""
        key = cache.content_key(
            self.scene, self.camera, what="peer", integrator=name, sampler=self.sampler, spp=spp
        )
        kept = cache.load(key)
        if kept is not None:
            return np.asarray(kept["image"], np.float32)
        image, _ = self._render(name, spp, 0)
        cache.store(key, {"image": image})
        return image

    def _render(self, name: str, spp: int, repeats: int) -> tuple[Image, float]:
        """The picture of seed 0, and the fastest of the `repeats` after it (which compiled)."""
        with ml.mitsuba.activate() as mi:
            description = ml.mitsuba.to_dict(
                self.scene,
                self.camera,
                spp=spp,
                sampler=self.sampler,
                pixel="center",
                integrator=self.integrators[name],
            )
            loaded = mi.load_dict(description)
            image = np.array(mi.render(loaded, spp=spp, seed=0))
            times = []
            for seed in range(1, repeats + 1):
                start = time.perf_counter()
                np.array(mi.render(loaded, spp=spp, seed=seed))
                times.append(1000.0 * (time.perf_counter() - start))
                if times[-1] > LONG_MS:
                    break
        return image[..., :3].astype(np.float32), min(times, default=0.0)


def _samples_to(error: float, errors: dict[int, float]) -> float:
    """Samples a pixel to an error; as their square root where no count reaches it."""
    counts = list(errors)
    last = counts[-1]
    if errors[last] > error:
        return last * (errors[last] / max(error, 1e-9)) ** 2
    if len(counts) == 1:
        return last
    logs = np.log([max(errors[count], 1e-9) for count in counts[-2:]])
    share = (np.log(max(error, 1e-9)) - logs[0]) / (logs[1] - logs[0])
    return float(counts[-2] ** (1 - share) * last**share)
