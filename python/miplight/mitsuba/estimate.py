"""One pass of a reference: rays of our camera through Mitsuba's scene, emitters, materials and integrators.

The rays are made here and not by a Mitsuba sensor, so that every sample of a "center" pixel goes through its
exact centre, whatever the intrinsics. A pass is one kernel: samples are summed where they are made and never
stored.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .export import Pixel, integrator_dict

if TYPE_CHECKING:
    from miplight.camera import Camera

__all__ = ["Estimator", "Part"]

Part: TypeAlias = Literal["total", "direct", "indirect"]

# Samples in flight at once: bounds what the samplers keep, about 16 bytes each.
_SAMPLES_AT_ONCE = 1 << 24


@dataclasses.dataclass
class Estimator:
    """Estimates one picture of one loaded scene, a pass at a time.

    Attributes
    ----------
    mi : module
        Mitsuba under the variant that `scene` was loaded with.
    scene : mitsuba.Scene
    camera : Camera
    anchor : (3,) float64
        What was subtracted from the scene's positions.
    beyond : mitsuba.Scene
        What is met after the first surface: `scene` itself, or the same shapes and lights with diffuse
        materials.
    max_depth : int
    part : {"total", "direct", "indirect"}
    pixel : {"center", "box"}
    sampler : str
    """

    mi: Any
    scene: Any
    camera: Camera
    anchor: NDArray[np.float64]
    beyond: Any
    max_depth: int
    part: Part
    pixel: Pixel
    sampler: str

    def __post_init__(self) -> None:
        self._is_scalar = self.mi.variant().startswith("scalar")
        # two scenes cannot share a path: direct light from the one, the rest from the other
        self._splits = self.part == "total" and self.max_depth > 2 and self.beyond is not self.scene
        depth = 2 if self.part == "direct" or self._splits else self.max_depth
        # Lights and materials are sampled alike: no outliers next to a light or in a narrow lobe
        self._integrator = self.mi.load_dict(integrator_dict(depth, weighted=True))
        # the light that a bounce brings is a path one segment shorter, seen from the first surface
        onward = integrator_dict(max(2, self.max_depth - 1), weighted=True)
        self._onward = self.mi.load_dict(onward)

    def run(self, spp: int, seed: int) -> NDArray[np.float64]:
        """Take `spp` samples of every pixel.

        Parameters
        ----------
        spp : int
            A power of two; of four for stratified samplers.
        seed : int

        Returns
        -------
        (height, width, 3) float64
            Mean radiance.
        """
        pixels = self.camera.width * self.camera.height
        step = max(1, _SAMPLES_AT_ONCE // spp)
        seeds = np.random.SeedSequence(seed).generate_state(-(-pixels // step))
        one = self._scalar_chunk if self._is_scalar else self._chunk
        chunks = [
            one(first, min(step, pixels - first), spp, int(seeds[index]))
            for index, first in enumerate(range(0, pixels, step))
        ]
        return np.concatenate(chunks).reshape(self.camera.height, self.camera.width, 3)

    def _sampler_for(self, spp: int, seed: int, size: int) -> Any:
        sampler = self.mi.load_dict({"type": self.sampler, "sample_count": spp})
        if not self._is_scalar:
            sampler.set_samples_per_wavefront(spp)
        sampler.seed(seed, size)
        return sampler

    def _chunk(self, first: int, count: int, spp: int, seed: int) -> NDArray[np.float64]:
        """Pixels `first` … `first + count` with all their samples, summed inside the kernel."""
        import drjit as dr

        mi = self.mi
        sampler = self._sampler_for(spp, seed, count * spp)
        lane = dr.arange(mi.UInt32, count * spp)
        pixel = (lane >> (spp.bit_length() - 1)) + dr.opaque(mi.UInt32, first)
        width = dr.opaque(mi.UInt32, self.camera.width)
        row = pixel // width
        radiance = self._radiance(sampler, mi.Float(pixel - row * width), mi.Float(row))
        sums = [dr.block_sum(channel, spp, mode="symbolic") for channel in radiance]
        dr.eval(sums)
        return np.stack([np.array(channel, dtype=np.float64) for channel in sums], axis=-1) / spp

    def _scalar_chunk(self, first: int, count: int, spp: int, seed: int) -> NDArray[np.float64]:
        """Do the same one sample after the other."""
        result = np.zeros((count, 3))
        for index in range(count):
            row, column = divmod(first + index, self.camera.width)
            sampler = self._sampler_for(spp, (seed + 0x9E3779B9 * index) & 0xFFFFFFFF, 1)
            for _ in range(spp):
                result[index] += np.array(self._radiance(sampler, float(column), float(row)))
                sampler.advance()
        return result / spp

    def _radiance(self, sampler: Any, column: Any, row: Any) -> Any:
        """One sample a lane of the part that was asked for."""
        import drjit as dr

        mi = self.mi
        ray = self._ray(sampler, column, row)
        if self.part == "indirect":
            return self._bounced(sampler, ray)
        value = self._integrator.sample(self.scene, sampler, ray)[0]
        if self.part == "direct":
            value = dr.select(self._meets_light(ray), mi.Color3f(0.0), value)
        return value + self._bounced(sampler, ray) if self._splits else value

    def _bounced(self, sampler: Any, ray: Any) -> Any:
        """Light that reaches the eye by way of at least one more surface than direct light does.

        One direction is drawn from the first surface's material; what comes from there, less what a light
        itself sends (that is direct light), is the estimate. No difference of two noisy pictures is taken.
        """
        import drjit as dr

        mi = self.mi
        si = self.scene.ray_intersect(ray)
        # a light is a valid hit, so this is: a hit, and no light
        active = si.is_valid() ^ self._is_light(si)
        if self._is_scalar and not active:
            return mi.Color3f(0.0)
        numbers = sampler.next_1d(active), sampler.next_2d(active)
        sample, weight = si.bsdf(ray).sample(mi.BSDFContext(), si, *numbers, active)
        onward = mi.RayDifferential3f(si.spawn_ray(si.to_world(sample.wo)))
        value = self._onward.sample(self.beyond, sampler, onward, None, active)[0]
        value = dr.select(self._meets_light(onward), mi.Color3f(0.0), value)
        return dr.select(active, weight * value, mi.Color3f(0.0))

    def _meets_light(self, ray: Any) -> Any:
        return self._is_light(self.scene.ray_intersect(ray))

    def _is_light(self, si: Any) -> Any:
        if self._is_scalar:
            return si.is_valid() and si.shape.is_emitter()
        return si.is_valid() & si.shape.is_emitter()

    def _ray(self, sampler: Any, column: Any, row: Any) -> Any:
        """A ray through the pixel's centre, or through a random point of the pixel."""
        import drjit as dr

        mi, camera = self.mi, self.camera
        offset = mi.Point2f(0.5, 0.5) if self.pixel == "center" else sampler.next_2d()
        (fx, _, cx), (_, fy, cy), _ = camera.K.tolist()
        constant = float if self._is_scalar else (lambda value: dr.opaque(mi.Float, value))
        x = (column + offset.x - constant(cx)) / constant(fx)
        y = (constant(cy) - row - offset.y) / constant(fy)
        pose = camera.world_from_camera
        origin = (pose[:3, 3] - self.anchor).tolist()
        right, up, backward = (mi.Vector3f(*(constant(v) for v in pose[:3, k].tolist())) for k in range(3))
        ray = mi.Ray3f(
            mi.Point3f(*(constant(v) for v in origin)), dr.normalize(x * right + y * up - backward)
        )
        return mi.RayDifferential3f(ray)
