"""Receivers that gather from the samples of one light: random cases, and how the passes are run on them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .lights import Area, Light, Spot, single, table
from .run import Runner, read
from .structs import GATHER, MISS, RECEIVER, record

Array = NDArray[np.float64]


@dataclasses.dataclass
class Case:
    """Receivers, samples of one light, and which of them are seen (None: all, and nobody asked)."""

    receivers: NDArray[Any]
    points: Array
    radiance: Array
    seen: NDArray[np.bool_] | None

    @property
    def strata(self) -> int:
        """Samples of a pattern."""
        return len(self.radiance)

    @property
    def live(self) -> NDArray[np.int64]:
        """Numbers of the active receivers."""
        return np.flatnonzero(self.receivers["pattern"] != MISS)


def random_case(rng: np.random.Generator, light: Light, count: int, strata: int, traced: bool = True) -> Case:
    """Receivers all about the light, with three patterns of samples."""
    patterns = 3
    receivers = np.zeros(count, RECEIVER)
    normals = rng.normal(size=(2, count, 3))
    normals[1] = normals[0] + 0.3 * normals[1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    receivers["origin"] = rng.normal(size=(count, 3)) * 3
    receivers["normal_geo"], receivers["normal_shade"] = normals
    receivers["pattern"] = rng.integers(0, patterns, count)
    receivers["pattern"][rng.uniform(size=count) < 0.1] = MISS
    receivers["pixel"] = rng.permutation(count)
    if isinstance(light, Area):
        points = single(light.point(rng.uniform(size=(patterns, strata, 2))))
        radiance = single(rng.uniform(0, 2, (strata, 3)))
    else:
        points = np.broadcast_to(light.position, (patterns, strata, 3))
        radiance = np.broadcast_to(light.intensity, (strata, 3))
    seen = rng.uniform(size=(count, strata)) < 0.7 if traced else None
    return Case(receivers, np.asarray(points), np.asarray(radiance), seen)


def facing_up(origins: Array, points: Array, radiance: Array) -> Case:
    """Receivers at (n, 3) origins whose normals are +y; one pattern, everything seen."""
    receivers = np.zeros(len(origins), RECEIVER)
    receivers["origin"] = origins
    receivers["normal_geo"] = receivers["normal_shade"] = (0, 1, 0)
    receivers["pixel"] = np.arange(len(origins))
    return Case(receivers, points.reshape(1, -1, 3), radiance, None)


def visibility_words(seen: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Visibility as words: bit k % 32 of word k / 32 is sample k."""
    padded = np.pad(seen, ((0, 0), (0, -seen.shape[1] % 32)))
    return np.packbits(padded, axis=1, bitorder="little").view("<u4")


def gather(
    runner: Runner,
    stem: str,
    lights: list[Light],
    number: int,
    case: Case,
    before: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Irradiance a pixel that `stem` makes of what was there before, (n, 3)."""
    count = len(case.receivers)
    words = 0 if case.seen is None else -(-case.strata // 32)
    out = runner(
        stem,
        count,
        params=record(GATHER, strata=case.strata, words=words, light=number),
        receivers=case.receivers,
        visibility=np.zeros(1, np.uint32) if case.seen is None else visibility_words(case.seen),
        light_points=np.pad(case.points, ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        light_radiance=np.pad(case.radiance, ((0, 0), (0, 1))).astype(np.float32),
        lights=table(lights),
        direct_irradiance=np.zeros((count, 4), np.float32) if before is None else before,
    )
    return read(out, "direct_irradiance", np.float32, count, 4)[:, :3]


def geometry_terms(light: Light, case: Case) -> tuple[Array, Array]:
    """cosθ_s cosθ_l / d² of every sample at every active receiver, (live, strata), and the distances.

    Zero below the horizon of either normal, and where the light does not emit.
    """
    r = case.receivers[case.live]
    d = case.points[r["pattern"]] - r["origin"].astype(np.float64)[:, None]
    far = np.linalg.norm(d, axis=-1)
    w = d / far[..., None]
    geo, shade = (
        (w * r[name].astype(np.float64)[:, None]).sum(-1) for name in ("normal_geo", "normal_shade")
    )
    emits = light.lights(-w) if isinstance(light, Spot) else light.cosine(-w)
    return np.where(geo > 0, np.clip(shade, 0, None) * emits / far**2, 0), far
