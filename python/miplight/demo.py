"""Two pictures of what the package does: Spot in a room, and a colonnade of half a million triangles."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import click
import numpy as np
import trimesh

from . import notebook, shapes
from .camera import Camera
from .frame import IMAGES, Frame
from .one_call import as_lights
from .renderer import Renderer
from .scene import Scene
from .settings import Settings


@dataclass(frozen=True)
class Demo:
    """A scene, from where it is seen, and how it is rendered."""

    name: str
    title: str
    scene: Scene
    camera: Camera
    settings: Settings


def spot() -> trimesh.Trimesh:
    """Load Spot, the cow by Keenan Crane (public domain), textured; feet on y = 0, about 1.7 units tall."""
    path = resources.files("miplight") / "data" / "spot" / "spot.glb"
    with resources.as_file(path) as file:
        mesh = trimesh.load(file, process=False).to_geometry()
    mesh.apply_translation((0.0, -mesh.bounds[0][1], 0.0))
    return mesh


def spot_in_a_room(width: int = 512, height: int = 512) -> Demo:
    """Spot in a Cornell-like room, with one bounce of indirect light."""
    place = shapes.room(boxes=False)
    scene = Scene.from_trimesh(place)
    turn = trimesh.transformations.rotation_matrix(np.radians(210), (0, 1, 0))
    scene.add_mesh(spot(), name="spot", transform=turn)
    for light in as_lights(place.metadata["lights"]):
        scene.add_light(light)
    camera = Camera.look_at(**place.metadata["view"], width=width, height=height)
    settings = Settings.preset("brute-force").replace(
        light_samples=64, indirect="final-gather", gather_rays=64
    )
    return Demo("spot", "Spot in a room, direct light and one bounce", scene, camera, settings)


def colonnade(width: int = 960, height: int = 540) -> Demo:
    """Half a million triangles in the low light of two area lights."""
    place = shapes.colonnade(500_000)
    scene = Scene.from_trimesh(place)
    for light in as_lights(place.metadata["lights"]):
        scene.add_light(light)
    camera = Camera.look_at(**place.metadata["view"], width=width, height=height)
    settings = Settings.preset("brute-force").replace(light_samples=64)
    return Demo("colonnade", "A colonnade of half a million triangles, direct light", scene, camera, settings)


def show_times(frame: Frame) -> str:
    """Passes and times as a table, with what each costs of the whole."""
    stats = frame.stats
    width = max(len(name) for name in [*stats.stages, "readback"])
    rows = [f"  {'pass':<{width}}  {'ms':>9}  {'share':>6}"]
    for name, ms in stats.stages.items():
        rows.append(f"  {name:<{width}}  {ms:9.1f}  {ms / max(stats.total_ms, 1e-9):6.1%}")
    rows.append(f"  {'total':<{width}}  {stats.total_ms:9.1f}")
    rows.append(f"  {'readback':<{width}}  {stats.readback_ms:9.1f}")
    return "\n".join(rows)


def run(out: Path, adapter: str = "auto", quick: bool = False) -> list[Path]:
    """Render the demo, print tables of passes and times, and write pictures.

    Parameters
    ----------
    out
        Folder for ``NAME.png``, ``NAME.exr``, ``NAME.npz`` and ``NAME_fragments.png``; made if it is missing.
    adapter
        As for `Renderer`.
    quick
        An eighth of the size, for tests.

    Returns
    -------
    list of Path
        The files.
    """
    out.mkdir(parents=True, exist_ok=True)
    files: list[Path] = []
    with Renderer(adapter) as renderer:
        click.echo(f"{renderer.adapter['name']}, {renderer.adapter['trace']} rays")
        for make in (spot_in_a_room, colonnade):
            demo = make()
            camera = demo.camera
            if quick:
                camera = camera.replace(width=camera.width // 8, height=camera.height // 8)
            click.echo(f"\n{demo.title}: {demo.scene!r}, {camera.width} × {camera.height}")
            frame = renderer.render(demo.scene, camera, demo.settings, outputs=(*IMAGES, "fragments"))
            stats = frame.stats
            click.echo(show_times(frame))
            click.echo(f"  {stats.rays:,} rays, {stats.light_evaluations:,} light evaluations")
            click.echo(f"  {frame.fragments!r}")
            files += [frame.save(out / f"{demo.name}{suffix}") for suffix in (".png", ".exr", ".npz")]
            files.append(out / f"{demo.name}_fragments.png")
            files[-1].write_bytes(notebook.png_bytes(notebook.level_colors(frame.fragments.level_map)))
    click.echo("\nwritten:")
    for file in files:
        click.echo(f"  {file.resolve()}")
    return files
