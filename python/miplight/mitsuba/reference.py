"""Reference pictures by Mitsuba, with the noise that is left in them."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from miplight.errors import SceneError, SettingsError
from miplight.validate import as_bool, as_choice, as_count

from . import cache
from .estimate import Estimator, Part
from .export import Pixel, is_glossy, scene_bounds, to_dict
from .variant import activate, import_mitsuba, pick_variant

if TYPE_CHECKING:
    from miplight.camera import Camera
    from miplight.scene import Scene

__all__ = ["Reference", "reference"]

# Samples of one pass. Passes are independent, so their scatter is the variance; at least two go into each
# half.
_LARGEST_PASS = 256
# Fewer passes would leave the variance itself too uncertain.
_FEWEST_PASSES = 16


@dataclasses.dataclass(frozen=True, eq=False)
class Reference:
    """A picture with its noise.

    Attributes
    ----------
    mean : (H, W, 3) float32
        Radiance, linear RGB, W·sr⁻¹·m⁻²: the mean of the two halves.
    halves : (2, H, W, 3) float32
        Two independent pictures of half the samples each. ``mean((I − halves[0]) · (I − halves[1]))`` is the
        squared error of a picture I without the reference's own noise.
    variance : (H, W, 3) float32
        Estimated variance of `mean`, from the scatter of its passes.
    spp : int
        Samples a pixel in `mean`.
    info : dict
        What made it: max_depth, part, pixel, seed, sampler, variant, mitsuba (version), passes; and
        glossy_bounces where it makes a difference.
    """

    mean: NDArray[np.float32]
    halves: NDArray[np.float32]
    variance: NDArray[np.float32]
    spp: int
    info: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = np.shape(self.mean)
        good = len(shape) == 3 and shape[2] == 3 and np.shape(self.halves) == (2, *shape)
        if not good or np.shape(self.variance) != shape:
            raise SceneError(
                f"mean, halves and variance have the shapes {shape}, {np.shape(self.halves)}, "
                f"{np.shape(self.variance)}; allowed: (H, W, 3), (2, H, W, 3), (H, W, 3)"
            )

    @property
    def relative_noise(self) -> float:
        """Noise of `mean`: root mean square over the picture, relative to its mean radiance."""
        level = float(np.mean(self.mean, dtype=np.float64))
        return float(np.sqrt(np.mean(self.variance, dtype=np.float64))) / level if level > 0 else 0.0

    def save(self, path: str | os.PathLike[str], *, half: bool = False) -> None:
        """Write a compressed ``.npz``.

        Parameters
        ----------
        path : path
        half : bool, default False
            Store float16 (rounded to about 1 in 2,000 of each value), for references kept in a repository.
        """
        kind = np.float16 if half else np.float32
        arrays = {
            "mean": self.mean.astype(kind),
            "difference": (0.5 * (self.halves[0] - self.halves[1])).astype(kind),
            "deviation": np.sqrt(self.variance).astype(kind),
        }
        notes = np.array(repr({"spp": self.spp, **self.info}))
        np.savez_compressed(os.fspath(path), info=notes, **arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Reference:
        """Read what `save` wrote.

        Raises
        ------
        SceneError
            If the file is missing, cut short or something else.
        """
        import ast

        try:
            with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                mean, difference, deviation = (
                    file[name].astype(np.float32) for name in ("mean", "difference", "deviation")
                )
                info = ast.literal_eval(str(file["info"]))
        except Exception as error:  # zip, header, key and value errors alike mean: not such a file
            raise SceneError(
                f"path is {os.fspath(path)!r}; allowed: a reference written by save ({error})"
            ) from error
        halves = np.stack([mean + difference, mean - difference])
        return cls(mean, halves, deviation**2, int(info.pop("spp")), info)

    def __repr__(self) -> str:
        height, width, _ = self.mean.shape
        what = ", ".join(
            f"{key}={self.info[key]!r}" for key in ("part", "max_depth", "pixel") if key in self.info
        )
        noise = f"noise {self.relative_noise:.2%}"
        return f"<Reference {width}x{height}, {self.spp} spp, {noise}{', ' if what else ''}{what}>"


def reference(
    scene: Scene,
    camera: Camera,
    spp: int,
    max_depth: int = 2,
    part: Part = "total",
    pixel: Pixel = "center",
    seed: int = 0,
    *,
    glossy_bounces: bool = False,
    sampler: str = "multijitter",
    variant: str | None = None,
    cached: bool = True,
) -> Reference:
    """Compute the picture that a render should match.

    The same triangles, normals, texels and lights go to Mitsuba (`to_dict`), moved to the middle of the
    scene; rays are those of `camera`. Direct light is Mitsuba's `direct`, more is `path`, both with multiple
    importance sampling (the same expected value as light sampling alone, without its outliers next to a
    light) and without Russian roulette.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    spp : int
        Samples a pixel, 1 or more; rounded up to whole passes (at least two in each half), see
        ``Reference.spp``.
    max_depth : int, default 2
        2 is direct light, 3 adds one bounce, and so on.
    part : {"total", "direct", "indirect"}, default "total"
        "total" is what ``frame.image`` shows: lights seen directly + direct + indirect light. "direct" and
        "indirect" are those parts alone, zero where a light is seen, as ``frame.direct`` and
        ``frame.indirect``; "indirect" needs `max_depth` 3 or more and is estimated by itself, not as a noisy
        difference.
    pixel : {"center", "box"}, default "center"
        Every sample through the exact pixel centre, or spread over the pixel.
    seed : int, default 0
        Same seed, same variant: same bits.
    glossy_bounces : bool, default False
        How surfaces with a specular part reflect at the hits of indirect rays: by their diffuse part alone,
        as the renderer has it unless a setting says otherwise, or by both. The first surface reflects by
        both in either case. Nothing changes with `max_depth` 2 or without such materials.
    sampler : str, default "multijitter"
        Mitsuba's sampler. Stratified within a pass of up to 256 samples, independent between passes.
    variant : str, optional
        Mitsuba variant; the default is ``llvm_ad_rgb``, or ``scalar_rgb`` with a warning.
    cached : bool, default True
        Look in, and add to, the folder of `miplight.mitsuba.cache_folder` (``MIPLIGHT_CACHE``).

    Returns
    -------
    Reference

    Raises
    ------
    MiplightError
        If Mitsuba is missing or of another version.
    SettingsError
        For a bad argument.

    Notes
    -----
    Mitsuba's ray offsets are absolute: scenes should be 1 to 100 units across. It counts light from behind
    the geometric surface that its interpolated normal faces, unless something blocks it.

    An invisible light is found by sampling lights alone, so a narrow lobe of it stays noisy: 30 times as much
    as of a visible one with shininess 1000, three times with 10.
    """
    samples = as_count(spp, "spp", error=SettingsError)
    depth = as_count(max_depth, "max_depth", at_least=2, error=SettingsError)
    number = as_count(seed, "seed", at_least=0, error=SettingsError)
    as_choice(part, "part", ("total", "direct", "indirect"), SettingsError)
    as_choice(pixel, "pixel", ("center", "box"), SettingsError)
    if part == "indirect" and depth < 3:
        raise SettingsError(
            f"max_depth is {depth} with part='indirect'; allowed: 3 or more (2 is direct light alone)"
        )
    info = {
        "max_depth": depth,
        "part": part,
        "pixel": pixel,
        "seed": number,
        "sampler": sampler,
        "variant": variant or pick_variant(),
        "mitsuba": import_mitsuba().__version__,
    }
    bounces = as_bool(glossy_bounces, "glossy_bounces", SettingsError)
    if depth > 2 and is_glossy(scene):
        info["glossy_bounces"] = bounces
    per_pass, passes = plan_passes(samples)
    key = cache.content_key(scene, camera, per_pass=per_pass, passes=passes, **info)
    arrays = cache.load(key) if cached else None
    if arrays is None:
        arrays = _compute(scene, camera, per_pass, passes, info)
        if cached:
            cache.store(key, arrays)
    return Reference(
        arrays["mean"], arrays["halves"], arrays["variance"], per_pass * passes, {**info, "passes": passes}
    )


def plan_passes(spp: int) -> tuple[int, int]:
    """Split `spp` samples into an even number of equal passes: 16 or more where spp allows, never below 4.

    Returns
    -------
    samples of a pass, passes : int
        A pass is a power of four (a square of a power of two, as stratified samplers want it), 256 at most.
    """
    per_pass = 1
    while per_pass * 4 <= min(_LARGEST_PASS, max(1, spp // _FEWEST_PASSES)):
        per_pass *= 4
    return per_pass, max(4, 2 * -(-spp // (2 * per_pass)))


def _compute(
    scene: Scene, camera: Camera, per_pass: int, passes: int, info: dict[str, Any]
) -> dict[str, NDArray[np.float32]]:
    """Run the passes: even ones make the first half, odd ones the second."""
    anchor = scene_bounds(scene).mean(axis=0)
    seeds = np.random.SeedSequence(info["seed"]).generate_state(passes)
    sums = np.zeros((2, camera.height, camera.width, 3))
    squares = np.zeros((camera.height, camera.width, 3))
    with activate(info["variant"]) as mi:
        loaded = mi.load_dict(to_dict(scene, anchor=anchor))
        options = {name: info[name] for name in ("max_depth", "part", "pixel", "sampler")}
        beyond = loaded
        if not info.get("glossy_bounces", True):
            beyond = mi.load_dict(to_dict(scene, anchor=anchor, specular=False))
        estimator = Estimator(mi, loaded, camera, anchor, beyond, **options)
        for index in range(passes):
            picture = estimator.run(per_pass, int(seeds[index]))
            sums[index % 2] += picture
            squares += picture**2
    mean = sums.sum(axis=0) / passes
    variance = np.maximum(squares / passes - mean**2, 0.0) / (passes - 1)
    named = {"mean": mean, "halves": sums / (passes // 2), "variance": variance}
    return {name: array.astype(np.float32) for name, array in named.items()}
