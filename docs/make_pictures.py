"""Makes the pictures and the times of docs/method.md: Spot in a room, stage by stage."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import miplight as ml
from miplight import demo
from miplight.frame import IMAGES
from miplight.notebook import auto_exposure, level_colors, png_bytes, to_srgb8

OUT = Path(__file__).parent / "pictures"
SIZE = 256


def main() -> None:
    """Render once and write each stage."""
    warnings.simplefilter("ignore", ml.SoftwareAdapterWarning)
    OUT.mkdir(exist_ok=True)
    job = demo.spot_in_a_room(SIZE, SIZE)
    settings = job.settings.replace(gather_rays=256)
    with ml.Renderer() as renderer:
        renderer.render(job.scene, job.camera, settings)
        frame = renderer.render(job.scene, job.camera.replace(fov_y=45.001), settings, (*IMAGES, "fragments"))
    stops = auto_exposure(frame.image, frame.surface_mask)
    for name in ("direct", "indirect", "image"):
        (OUT / f"{name}.png").write_bytes(png_bytes(to_srgb8(frame[name], stops)))
    seen = np.isfinite(frame.depth)
    near, far = frame.depth[seen].min(), frame.depth[seen].max()
    depth = np.where(seen, 1.0 - 0.9 * (frame.depth - near) / (far - near), 0.0)
    strips = [np.repeat(depth[..., None], 3, axis=2), 0.5 + 0.5 * frame.normal, frame.albedo]
    (OUT / "geometry.png").write_bytes(png_bytes(to_srgb8(np.concatenate(strips, axis=1))))
    (OUT / "fragments.png").write_bytes(png_bytes(level_colors(frame.fragments.level_map)))
    stats = frame.stats
    rows = [f"| `{name}` | {ms:.1f} |" for name, ms in stats.stages.items()]
    head = f"Spot in a room, {SIZE} × {SIZE}, {settings!r}, on {stats.adapter}:"
    table = "\n".join([head, "", "| pass | ms |", "|---|--:|", *rows, f"| total | {stats.total_ms:.1f} |"])
    (OUT / "times.md").write_text(table + "\n")


if __name__ == "__main__":
    main()
