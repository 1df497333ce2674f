"""Rates of Mitsuba's Embree on the scene of ``examples/trace_native.rs``, for the same machine."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miplight.mitsuba import activate

SIZE = 256
SPP = 256


def bumpy_sphere(count: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Sphere by longitude and latitude with bumps, about ``count`` triangles."""
    rings = max(int(np.sqrt(count / 4)), 3)
    around = 2 * rings
    i, j = np.meshgrid(np.arange(rings + 1), np.arange(around), indexing="ij")
    theta, phi = np.pi * i / rings, 2 * np.pi * j / around
    radius = 2 * (1 + 0.05 * np.sin(8 * theta) * np.cos(6 * phi))
    unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1)
    points = (np.array([0, -2, 0]) + radius[..., None] * unit).reshape(-1, 3)
    a = i[:-1] * around + j[:-1]
    b = i[:-1] * around + (j[:-1] + 1) % around
    upper = np.stack([a, b, b + around], -1)[1:].reshape(-1, 3)
    lower = np.stack([a, b + around, a + around], -1)[:-1].reshape(-1, 3)
    return points, np.concatenate([upper, lower])


def scene(mi: Any, count: int) -> Any:
    """The room, the sphere, the light and the camera."""
    points, faces = bumpy_sphere(count)
    mesh = mi.Mesh("sphere", len(points), len(faces))
    params = mi.traverse(mesh)
    params["vertex_positions"] = points.astype(np.float32).ravel()
    params["faces"] = faces.astype(np.uint32).ravel()
    params.update()
    file = Path(tempfile.gettempdir()) / "trace_mitsuba.ply"
    mesh.write_ply(str(file))
    to = mi.ScalarTransform4f
    grey = {"type": "diffuse"}
    both = {"type": "twosided", "inner": grey}
    ply = {"type": "ply", "filename": str(file), "face_normals": True, "bsdf": both}
    light = to().translate([0, 4.99, 0]).rotate([1, 0, 0], 90)
    camera = to().look_at([0, 0, -4.9], [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}}
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": {"type": "perspective", "fov": 60, "to_world": camera, "film": film},
            "room": {"type": "cube", "to_world": to().scale(5), "bsdf": both},
            "sphere": ply,
            "light": {"type": "rectangle", "to_world": light, "emitter": emitter},
        }
    )


def measure(mi: Any, count: int) -> None:
    """Print M rays/s, two rays a sample, best of three warm renders."""
    room = scene(mi, count)
    best = least = float("inf")
    for seed in range(4):
        start, used = time.perf_counter(), time.process_time()
        np.array(mi.render(room, spp=SPP, seed=seed))
        if seed > 0:
            best = min(best, time.perf_counter() - start)
            least = min(least, time.process_time() - used)
    rays = SIZE * SIZE * SPP * 2 / 1e6
    print(f"{count:>9} triangles  {rays / best:8.1f} M rays/s, {rays / least:.1f} per core", flush=True)


def main(sizes: list[int]) -> None:
    """Measure each size."""
    with activate("llvm_ad_rgb") as mi:
        for count in sizes:
            measure(mi, count)


if __name__ == "__main__":
    main([int(a) for a in sys.argv[1:]] or [1_000, 10_000, 100_000])
