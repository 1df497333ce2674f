"""Makes the pictures and the times of docs/method.md: Spot in a room, stage by stage."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray

import miplight as ml
from miplight import demo
from miplight.frame import IMAGES
from miplight.notebook import auto_exposure, level_colors, png_bytes, to_srgb8

OUT = Path(__file__).parent / "pictures"
SIZE = 256
REFERENCE_SPP = 4096


def _write(name: str, pixels: NDArray[np.uint8]) -> None:
    (OUT / f"{name}.png").write_bytes(png_bytes(pixels))


def _times(frame: ml.Frame, what: str, settings: ml.Settings) -> str:
    stats = frame.stats
    rows = [f"| `{name}` | {ms:.1f} |" for name, ms in stats.stages.items()]
    head = f"{what}, {SIZE} × {SIZE}, {settings!r}, on {stats.adapter}:"
    return "\n".join([head, "", "| pass | ms |", "|---|--:|", *rows, f"| total | {stats.total_ms:.1f} |"])


def brute_force(renderer: ml.Renderer) -> str:
    """Write what the baseline shows of geometry, direct and indirect light; return its times."""
    job = demo.spot_in_a_room(SIZE, SIZE)
    settings = job.settings.replace(gather_rays=256)
    renderer.render(job.scene, job.camera, settings)
    frame = renderer.render(job.scene, job.camera.replace(fov_y=45.001), settings, IMAGES)
    stops = auto_exposure(frame.image, frame.surface_mask)
    for name in ("direct", "indirect", "image"):
        _write(name, to_srgb8(frame[name], stops))
    seen = np.isfinite(frame.depth)
    near, far = frame.depth[seen].min(), frame.depth[seen].max()
    depth = np.where(seen, 1.0 - 0.9 * (frame.depth - near) / (far - near), 0.0)
    strips = [np.repeat(depth[..., None], 3, axis=2), 0.5 + 0.5 * frame.normal, frame.albedo]
    _write("geometry", to_srgb8(np.concatenate(strips, axis=1)))
    return _times(frame, "Spot in a room", settings)


def _map(values: NDArray[np.float64], title: str, name: str, largest: float, colors: str = "magma") -> None:
    """A picture of one number a pixel, with its scale; pale blue where there is none."""
    figure = plt.figure(figsize=(5.6, 4.6), layout="constrained")
    axes = figure.add_subplot()
    shown = axes.imshow(values, cmap=colors, vmin=0.0, vmax=largest, interpolation="nearest")
    shown.set_cmap(shown.get_cmap().with_extremes(bad="lightsteelblue"))
    axes.set(title=title, xticks=(), yticks=())
    figure.colorbar(shown, shrink=0.8)
    figure.savefig(OUT / f"{name}.png", dpi=100)
    plt.close(figure)


def _fragment_maps(frame: ml.Frame) -> None:
    for by in ("level", "reason"):
        figure = plt.figure(figsize=(6.4, 4.6), layout="constrained")
        frame.fragments.plot(figure.add_subplot(), by)
        figure.savefig(OUT / f"{by}s.png", dpi=100)
        plt.close(figure)


def default_direct(renderer: ml.Renderer) -> str:
    """Write share, levels, reasons and error of the default's direct light; return its times."""
    job = demo.spot_in_a_room(SIZE, SIZE)
    settings = ml.Settings.preset("default")
    clear = ml.Settings.preset("brute-force").replace(visibility="none", direct_estimator="ratio")
    outputs = ("direct", "surface_mask", "fragments")
    unshadowed = renderer.render(job.scene, job.camera, clear, outputs)
    renderer.render(job.scene, job.camera, settings, outputs)
    frame = renderer.render(job.scene, job.camera, settings, outputs)
    mask = frame.surface_mask
    _write("default", to_srgb8(frame.direct, auto_exposure(frame.direct, mask)))
    _write("unshadowed", to_srgb8(unshadowed.direct, auto_exposure(frame.direct, mask)))
    full = unshadowed.direct.sum(axis=-1, dtype=np.float64)
    share = np.where(full > 0, frame.direct.sum(axis=-1) / np.where(full > 0, full, 1.0), np.nan)
    _map(share, "visible share of the light (blue: none would arrive)", "share", 1.0, "gray")
    _fragment_maps(frame)
    reference = ml.mitsuba.reference(job.scene, job.camera, REFERENCE_SPP, part="direct")
    result = ml.testing.compare(frame, reference)
    error = np.abs(result.image - result.reference).mean(axis=-1)
    level = float(result.reference[mask].mean())
    title = f"error over the mean radiance; relative RMSE {result.relative_rmse:.2%}"
    _map(np.where(mask, error / level, 0.0), title, "direct_error", 0.1)
    return _times(frame, "Direct light by the preset default", settings)


def level_by_level(renderer: ml.Renderer) -> str:
    """Write what each level of `area-2010` looked at; return its times."""
    job = demo.spot_in_a_room(SIZE, SIZE)
    settings = ml.Settings.preset("area-2010")
    renderer.render(job.scene, job.camera, settings)
    frame = renderer.render(job.scene, job.camera, settings, keep=ml.study.level_names(settings))
    figure = ml.study.plot_maps(frame)
    figure.savefig(OUT / "level_maps.png", dpi=75)
    plt.close(figure)
    return _times(frame, "Direct light by the preset area-2010", settings)


def inside_fragments(renderer: ml.Renderer) -> str:
    """Write fragments and extra samples of `area-2016`, and what interpolation leaves; return its times."""
    job = demo.spot_in_a_room(2 * SIZE, 2 * SIZE)
    settings = ml.Settings.preset("area-2016").replace(indirect="off")
    exact = ml.Settings.preset("brute-force").replace(light_samples=1024)
    wanted = renderer.render(job.scene, job.camera, exact, outputs=("direct",)).direct
    frame = renderer.render(job.scene, job.camera, settings, keep=("stable_map", "extra_map"))
    levels = level_colors(frame.fragments.level_map)[..., :3]
    samples = np.where(frame["stable_map"][..., None], 0.6 * levels + (0, 70, 0), levels).astype(np.uint8)
    samples[frame["extra_map"]] = (255, 0, 0)
    around = settings.replace(refine="incremental", interleave=1, illumination_threshold=None)
    figure, axes = plt.subplots(2, 2, figsize=(9, 9.4), layout="constrained")
    count = f"{frame.fragments.total:,} fragments and {frame.fragments.extra:,} extra samples"
    other = renderer.render(job.scene, job.camera, around).fragments
    shown = [(samples, count + "; stable regions green")]
    shown.append((level_colors(other.level_map)[..., :3], f"the 3 × 3 test: {other.total:,} fragments"))
    for label, change in (("edge-aware", {"upsample": "edge-aware"}), ("radial bases", {})):
        found = renderer.render(job.scene, job.camera, settings.replace(**change), outputs=("direct",)).direct
        shown.append((0.5 + (found - wanted).mean(-1) / wanted.mean() * 2, f"error, {label}: grey is none"))
    for ax, (pixels, title) in zip(axes.ravel(), shown, strict=True):
        ax.imshow(pixels, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        ax.set_title(title, fontsize=9)
        ax.set_axis_off()
    figure.savefig(OUT / "sub_fragments.png", dpi=90)
    plt.close(figure)
    return _times(frame, "Direct light by the preset area-2016, at twice the size", settings)


def main() -> None:
    """Render and write each stage."""
    warnings.simplefilter("ignore", ml.SoftwareAdapterWarning)
    plt.switch_backend("Agg")
    OUT.mkdir(exist_ok=True)
    with ml.Renderer() as renderer:
        makers = (brute_force, default_direct, level_by_level, inside_fragments)
        times = [make(renderer) for make in makers]
    (OUT / "times.md").write_text("\n\n".join(times) + "\n")


if __name__ == "__main__":
    main()
