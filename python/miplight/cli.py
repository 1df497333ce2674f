"""The command `miplight`: info, demo, render, compare, study."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import click
import numpy as np

from . import _core
from ._table import PRESETS
from .camera import Camera
from .errors import MiplightError, SceneError, SettingsError
from .frame import Frame
from .frame_files import SAVED, checked_suffix
from .light import AreaLight
from .renderer import Renderer, SoftwareAdapterWarning, adapters
from .scene import Scene
from .settings import Settings


class _Group(click.Group):
    """Ends with one line on what was wrong, without a traceback, for errors that are the user's to mend."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (MiplightError, OSError) as error:
            raise click.ClickException(str(error)) from error


@click.group(cls=_Group)
@click.version_option(package_name="miplight")
def main() -> None:
    """Multiresolution image-space lighting of triangle scenes by area lights."""
    # said by `miplight info`; a warning with a file and a line helps nobody here
    warnings.simplefilter("ignore", SoftwareAdapterWarning)


# from the middle of what there is, in units of its size
_FROM_THE_FRONT = np.array([0.6, 0.5, 1.6])

_adapter = click.option("--adapter", default="auto", help='"auto", "gpu", "cpu", or part of a name.')
_preset = click.option("--preset", default="default", help="Where the settings start from.")
_changes = click.option(
    "--set", "changes", multiple=True, metavar="NAME=VALUE", help="A setting; repeatable."
)
_size = click.option("--size", type=(int, int), default=None, help="Width and height, pixels.")
_camera = click.option("--camera", default=None, help="Name of a camera of the file.")


@main.command()
def info() -> None:
    """Show the version, the adapters of this machine, and the presets."""
    click.echo(f"miplight {_core.version()}")
    found = adapters()
    for about in found:
        kind = "software" if about["software"] else about["device_type"]
        click.echo(f"adapter  {about['name']} ({about['backend']}, {kind}; {about['driver']})")
    if not found:
        click.echo("adapter  none: install a Vulkan driver (Mesa's lavapipe works without a GPU)")
    for name, overrides in PRESETS.items():
        click.echo(f"preset   {name}" + ("" if overrides is not None else " (not available yet)"))


@main.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/demo"), show_default=True)
@click.option("--quick", is_flag=True, help="An eighth of the size.")
@_adapter
def demo(out: Path, quick: bool, adapter: str) -> None:
    """Render Spot in a room and a colonnade of half a million triangles."""
    from . import demo as demo_module

    demo_module.run(out, adapter, quick)


@main.command()
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@_preset
@_changes
@_size
@_camera
@click.option(
    "--exposure", type=float, default=None, help="Stops, for .png; found from the picture by default."
)
@_adapter
def render(
    source: Path,
    target: Path,
    preset: str,
    changes: tuple[str, ...],
    size: tuple[int, int] | None,
    camera: str | None,
    exposure: float | None,
    adapter: str,
) -> None:
    """Render SOURCE (a mesh, .glb, or a Mitsuba .xml) to TARGET (.png, .exr or .npz).

    A file without lights gets one above it; a file without cameras is seen from the front.
    """
    checked_suffix(target, SAVED)  # before the work, not after it
    settings = _settings(preset, changes)
    scene, view = _load(source, camera, size)
    with Renderer(adapter) as renderer:
        frame = renderer.render(scene, view, settings)
        click.echo(str(frame.stats))
        click.echo(frame.save(target, exposure=exposure).resolve())


@main.command()
@click.argument("source", type=click.Path(path_type=Path))
@_preset
@_changes
@_size
@_camera
@click.option("--spp", default=256, show_default=True, help="Samples of the reference, each half.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/compare"), show_default=True)
@_adapter
def compare(
    source: Path,
    preset: str,
    changes: tuple[str, ...],
    size: tuple[int, int] | None,
    camera: str | None,
    spp: int,
    out: Path,
    adapter: str,
) -> None:
    """Render SOURCE here and with Mitsuba, and print the errors of direct light."""
    from . import metrics, mitsuba

    settings = _settings(preset, changes)
    scene, view = _load(source, camera, size)
    with Renderer(adapter) as renderer:
        frame = renderer.render(scene, view, settings, outputs=("direct", "surface_mask", "image"))
        reference = mitsuba.reference(scene, view, spp=spp, max_depth=2, part="direct")
        mask = frame.surface_mask
        for trim in (0.0, 0.001):
            error = metrics.relative_rmse(frame.direct, reference, mask=mask, trim=trim)
            click.echo(f"relative RMSE, trim {trim:g}: {error:.5f}")
        median = metrics.median_relative_error(frame.direct, reference, mask=mask)
        click.echo(f"median relative error:   {median:.5f}")
        out.mkdir(parents=True, exist_ok=True)
        stops = _stops(frame)
        click.echo(frame.save(out / "miplight.png", exposure=stops).resolve())
        _write_reference(out / "mitsuba.png", reference.mean, stops)


@main.command()
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@click.option("--preset", "presets", multiple=True, help="Where the settings start from; repeatable.")
@click.option(
    "--set", "changes", multiple=True, metavar="NAME=VALUE,...", help="Values of a setting; repeatable."
)
@click.option("--repeats", default=3, show_default=True, help="Measured renders of each combination.")
@click.option("--spp", default=0, help="Samples of a reference of direct light by Mitsuba; none without.")
@_size
@_camera
@_adapter
def study(
    source: Path,
    target: Path,
    presets: tuple[str, ...],
    changes: tuple[str, ...],
    repeats: int,
    spp: int,
    size: tuple[int, int] | None,
    camera: str | None,
    adapter: str,
) -> None:
    """Render SOURCE with every combination of settings; times and errors go to TARGET (.parquet or .csv).

    Started again with the same TARGET it renders what is missing. With a reference a plot goes beside it.
    """
    from . import mitsuba
    from . import study as studies

    grid: dict[str, Any] = {"preset": list(presets or ("default",))}
    for name, text in (_assigned(change) for change in changes):
        grid[name] = [_number_or_text(word) for word in text.split(",")]
    scene, view = _load(source, camera, size)
    reference = mitsuba.reference(scene, view, spp=spp, part="direct") if spp else None
    table = studies.sweep(scene, view, grid, reference, repeats, path=target, adapter=adapter)
    joined = studies.medians(table)
    varied = [name for name in grid if joined[name].nunique() > 1]
    shown = [*varied, "ms", "fragments", "rays", *(["relative_rmse"] if spp else [])]
    if joined["error"].notna().any():
        shown.append("error")
    click.echo(joined[shown].to_string(index=False))
    if spp and joined["relative_rmse"].notna().any():
        from matplotlib.figure import Figure

        figure, picture = Figure(layout="constrained"), target.with_suffix(".png")
        studies.plot(table, figure.add_subplot())
        figure.savefig(picture)
        click.echo(picture.resolve())


def _settings(preset: str, changes: tuple[str, ...]) -> Settings:
    values = {name: _number_or_text(text) for name, text in map(_assigned, changes)}
    return Settings.preset(preset).replace(**values)


def _assigned(change: str) -> tuple[str, str]:
    name, equals, text = change.partition("=")
    if not equals:
        raise SettingsError(f"--set is {change!r}; allowed: NAME=VALUE")
    return name, text


def _number_or_text(text: str) -> int | float | str | None:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return None if text == "None" else text


def _load(source: Path, camera: str | None, size: tuple[int, int] | None) -> tuple[Scene, Camera]:
    is_mitsuba = source.suffix.lower() == ".xml"
    scene = Scene.from_mitsuba(str(source)) if is_mitsuba else Scene.from_trimesh(source)
    view = _view(scene, camera, size)
    if not scene.lights:
        scene.add_light(_light_above(scene))
    return scene, view


def _view(scene: Scene, name: str | None, size: tuple[int, int] | None) -> Camera:
    if name is not None and name not in scene.cameras:
        known = ", ".join(scene.cameras) or "none"
        raise SceneError(f"--camera is {name!r}; the file has: {known}")
    if scene.cameras:
        camera = scene.cameras[name or next(iter(scene.cameras))]
        return camera.replace(width=size[0], height=size[1]) if size else camera
    bounds = scene.bounds
    if bounds is None:
        raise SceneError("the file has neither a camera nor a mesh")
    middle, extent = bounds.mean(axis=0), max(float((bounds[1] - bounds[0]).max()), 1e-30)
    width, height = size or (512, 512)
    eye = middle + extent * _FROM_THE_FRONT
    return Camera.look_at(eye, middle, fov_y=40, width=width, height=height)


def _light_above(scene: Scene) -> AreaLight:
    """A square light over the scene, as wide as half of it, whose radiance suits any scale."""
    bounds = scene.bounds
    if bounds is None:
        raise SceneError("the file has no mesh")
    extent = max(float((bounds[1] - bounds[0]).max()), 1e-30)
    half, x, z = 0.25 * extent, float(bounds[:, 0].mean()), float(bounds[:, 2].mean())
    y = float(bounds[1, 1]) + extent
    corner = (x - half, y, z - half)
    return AreaLight(corner, (2 * half, 0, 0), (0, 0, 2 * half), radiance=(12.0, 12.0, 12.0), visible=False)


def _stops(frame: Frame) -> float:
    from .notebook import auto_exposure

    return auto_exposure(frame.image, frame.surface_mask)


def _write_reference(path: Path, image: Any, stops: float) -> None:
    from .notebook import png_bytes, to_srgb8

    path.write_bytes(png_bytes(to_srgb8(image, stops)))
    click.echo(path.resolve())


if __name__ == "__main__":
    sys.exit(main())
