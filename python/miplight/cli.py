"""The command `miplight`: info, demo, render, compare, study."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from . import _core
from ._table import KNOBS, PRESETS
from .camera import Camera
from .cli_report import Working, driver_hint, lit_hint, summary
from .cli_scene import View, load, notes
from .errors import DeviceError, MiplightError, SceneError, SettingsError
from .frame import Frame
from .frame_files import SAVED, checked_suffix
from .renderer import Renderer, SoftwareAdapterWarning, adapters
from .scene import Scene
from .settings import Settings

_Command = TypeVar("_Command", bound=Callable[..., Any])


class _Group(click.Group):
    """Ends with one line on what was wrong, without a traceback, for errors that are the user's to mend."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # `miplight info | head`: nobody reads on, and nothing is wrong
            raise
        except (MiplightError, OSError) as error:
            hint = f"\n{driver_hint()}" if isinstance(error, DeviceError) and not adapters() else ""
            raise click.ClickException(f"{error}{hint}") from error


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="miplight")
def main() -> None:
    """Multiresolution image-space lighting of triangle scenes by area lights.

    Exit codes: 0, done; 1, a file, a setting or an adapter is at fault, in one line; 2, a wrong option.
    """
    # said by `miplight info`; a warning with a file and a line helps nobody here
    warnings.simplefilter("ignore", SoftwareAdapterWarning)


# the first character keeps the lines as they are
_EXAMPLES = """\b
Examples:
  miplight render bunny.ply bunny.png
  miplight render room.xml room.exr --preset area-2016 --set light_samples=256
  miplight render hall.glb hall.png --origin 0 1.6 4 --target 0 1.2 0 --size 960 540
"""

_adapter = click.option("--adapter", default="auto", help='"auto", "gpu", "cpu", or part of a name.')
_preset = click.option(
    "--preset",
    default="default",
    show_default=True,
    help=f"Where the settings start from: {', '.join(PRESETS)}.",
)
_changes = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="NAME=VALUE",
    help="A setting, as light_samples=64; repeatable. `miplight info --settings` lists them.",
)
_quiet = click.option("-q", "--quiet", is_flag=True, help="Say nothing of what is being done.")
_source = click.argument("source", type=click.Path(path_type=Path))


def _seen_from(command: _Command) -> _Command:
    """Add the options of a view; they arrive as `size`, `camera`, `origin`, `target`, `fov` and `light`."""
    spot: dict[str, Any] = {"type": (float, float, float), "default": None, "metavar": "X Y Z"}
    for option in (
        click.option("--light", **spot, help="Where to add a light that shines down, as inside of a room."),
        click.option("--fov", type=float, default=None, help="Vertical field of view, degrees."),
        click.option("--target", **spot, help="What to look at; the middle of everything by default."),
        click.option(
            "--origin", **spot, help="Where the eye is, scene units; in place of the file's camera."
        ),
        click.option("--camera", default=None, help="Name of a camera of the file; the first by default."),
        click.option(
            "--size", type=(int, int), default=None, metavar="W H", help="Width and height, pixels."
        ),
    ):
        command = option(command)
    return command


@main.command()
@click.option("--settings", is_flag=True, help="List every setting, what it may be, and its default.")
def info(settings: bool) -> None:
    """Show the version, the adapters of this machine, and the presets.

    Without an adapter it says how to install one, and the exit code is 1.
    """
    if settings:
        for knob in KNOBS.values():
            click.echo(f"{knob.name} (default {knob.default!r})\n    {knob.summary()}")
        return
    click.echo(f"miplight {_core.version()}")
    found = adapters()
    for about in found:
        kind = "software" if about["software"] else about["device_type"]
        click.echo(f"adapter  {about['name']} ({about['backend']}, {kind}; {about['driver']})")
    if not found:
        click.echo(f"adapter  none: {driver_hint()}")
    for name, overrides in PRESETS.items():
        click.echo(f"preset   {name}" + ("" if overrides is not None else " (not available yet)"))
    if not found:
        raise click.exceptions.Exit(1)


@main.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/demo"), show_default=True)
@click.option("--quick", is_flag=True, help="An eighth of the size.")
@_adapter
def demo(out: Path, quick: bool, adapter: str) -> None:
    """Render Spot in a room and a colonnade of half a million triangles."""
    from . import demo as demo_module

    demo_module.run(out, adapter, quick)


@main.command(epilog=_EXAMPLES)
@_source
@click.argument("picture", type=click.Path(path_type=Path))
@_preset
@_changes
@_seen_from
@click.option(
    "--exposure", type=float, default=None, help="Stops, for .png; found from the picture by default."
)
@_quiet
@click.option("-v", "--verbose", is_flag=True, help="Times of each pass, what was left out, every note.")
@_adapter
def render(
    source: Path,
    picture: Path,
    preset: str,
    changes: tuple[str, ...],
    exposure: float | None,
    quiet: bool,
    verbose: bool,
    adapter: str,
    **seen: Any,
) -> None:
    """Render SOURCE to PICTURE (.png, .exr, or .npz with everything).

    SOURCE is a scene or mesh that trimesh reads (.glb, .gltf, .obj, .ply, .stl and more), or a Mitsuba .xml.
    One without lights gets one above it; one without cameras is seen from the front.
    """
    _check_picture(picture, exposure)  # before the work, not after it
    settings = _settings(preset, changes)
    scene, view = _read(source, _as_view(seen), quiet, verbose)
    with Renderer(adapter) as renderer:
        with Working(f"rendering {view.width} × {view.height} with {preset}", quiet):
            frame = renderer.render(scene, view, settings)
        click.echo(str(frame.stats) if verbose else summary(frame))
        hint = lit_hint(frame)
        if hint:
            click.echo(f"note: the picture is black: {hint}", err=True)
        click.echo(frame.save(picture, exposure=exposure).resolve())


@main.command()
@_source
@_preset
@_changes
@_seen_from
@click.option("--spp", default=256, show_default=True, help="Samples of the reference, each half.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("out/compare"), show_default=True)
@_quiet
@_adapter
def compare(
    source: Path,
    preset: str,
    changes: tuple[str, ...],
    spp: int,
    out: Path,
    quiet: bool,
    adapter: str,
    **seen: Any,
) -> None:
    """Render SOURCE here and with Mitsuba, and print the errors of direct light.

    Needs the extra `mitsuba`. Both pictures go to the folder --out.
    """
    from . import metrics, mitsuba
    from .mitsuba.variant import import_mitsuba

    import_mitsuba()  # before the work, too
    settings = _settings(preset, changes)
    scene, view = _read(source, _as_view(seen), quiet)
    with Renderer(adapter) as renderer:
        with Working(f"rendering {view.width} × {view.height} with {preset}", quiet):
            frame = renderer.render(scene, view, settings, outputs=("direct", "surface_mask", "image"))
        with Working(f"rendering with Mitsuba, {2 * spp} samples", quiet):
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
@_source
@click.argument("table", type=click.Path(path_type=Path))
@click.option(
    "--preset",
    "presets",
    multiple=True,
    help=f"Where the settings start from; repeatable: {', '.join(PRESETS)}.",
)
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="NAME=VALUE,...",
    help="Values of a setting, as light_samples=16,64,256; repeatable.",
)
@click.option("--repeats", default=3, show_default=True, help="Measured renders of each combination.")
@click.option("--spp", default=0, help="Samples of a reference of direct light by Mitsuba; none without.")
@_seen_from
@_quiet
@_adapter
def study(
    source: Path,
    table: Path,
    presets: tuple[str, ...],
    changes: tuple[str, ...],
    repeats: int,
    spp: int,
    quiet: bool,
    adapter: str,
    **seen: Any,
) -> None:
    """Render SOURCE with every combination of settings; times and errors go to TABLE (.parquet or .csv).

    Started again with the same TABLE it renders what is missing. With a reference a plot goes beside it.
    The exit code is 1 if a combination could not be rendered; the table says why, and has the others.
    """
    from . import mitsuba
    from . import study as studies
    from .mitsuba.variant import import_mitsuba

    if spp:
        import_mitsuba()
    grid: dict[str, Any] = {"preset": list(presets or ("default",))}
    for name, text in (_assigned(change) for change in changes):
        grid[name] = [_number_or_text(word) for word in text.split(",")]
    _check_folder(table)
    scene, view = _read(source, _as_view(seen), quiet)
    reference = None
    if spp:
        with Working(f"rendering with Mitsuba, {2 * spp} samples", quiet):
            reference = mitsuba.reference(scene, view, spp=spp, part="direct")
    shown = False if quiet else None
    swept = studies.sweep(scene, view, grid, reference, repeats, path=table, adapter=adapter, progress=shown)
    joined = studies.medians(swept)
    _print_table(joined, [name for name in grid if joined[name].nunique() > 1], bool(spp))
    if spp and joined["relative_rmse"].notna().any():
        from matplotlib.figure import Figure

        figure, picture = Figure(layout="constrained"), table.with_suffix(".png")
        studies.plot(swept, figure.add_subplot())
        figure.savefig(picture)
        click.echo(picture.resolve())
    failed = int(joined["error"].notna().sum())
    if failed:
        raise click.ClickException(f"{failed} of {len(joined)} combinations failed; {table} says why")


def _print_table(joined: Any, varied: list[str], errors: bool) -> None:
    shown = [*varied, "ms", "fragments", "rays", *(["relative_rmse"] if errors else [])]
    if joined["error"].notna().any():
        shown.append("error")
    click.echo(joined[shown].to_string(index=False))


def _check_picture(picture: Path, exposure: float | None) -> None:
    """What can be known to go wrong when the picture is written."""
    if checked_suffix(picture, SAVED) != ".png" and exposure is not None:
        raise SettingsError(f"--exposure is {exposure:g} for {picture.name}; only .png pictures are exposed")
    _check_folder(picture)


def _check_folder(target: Path) -> None:
    if not target.parent.is_dir():
        raise SceneError(f"{str(target)!r} cannot be written: there is no folder {str(target.parent)!r}")


def _as_view(seen: dict[str, Any]) -> View:
    fov_y = seen.pop("fov")
    return View(**seen, fov_y=fov_y)


def _read(source: Path, view: View, quiet: bool, verbose: bool = False) -> tuple[Scene, Camera]:
    """Read a file, and say what it has, what it was given, and what is not as the file has it."""
    with Working(f"reading {source}", quiet):
        scene, camera, added = load(source, view)
    if not quiet:
        more = f"; added: {', '.join(added)}" if added else ""
        click.echo(f"{scene!r}{more}", err=True)
        for note in notes(scene, verbose):
            click.echo(f"note: {note}", err=True)
    return scene, camera


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


def _stops(frame: Frame) -> float:
    from .notebook import auto_exposure

    return auto_exposure(frame.image, frame.surface_mask)


def _write_reference(path: Path, image: Any, stops: float) -> None:
    from .notebook import png_bytes, to_srgb8

    path.write_bytes(png_bytes(to_srgb8(image, stops)))
    click.echo(path.resolve())


if __name__ == "__main__":
    sys.exit(main())
