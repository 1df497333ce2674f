"""The command `miplight` as a new user meets it: files of every kind, views, what it says, exit codes."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result

import miplight as ml
from miplight import cli_report
from miplight.cli import main
from miplight.cli_scene import View, load, notes

SMALL = ("--size", 32, 24, "--set", "light_samples=4")
XML = """<scene version="3.0.0">
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/></film>
    </sensor>
    <shape type="ply"><string name="filename" value="ball.ply"/></shape>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="90"/><translate y="4"/></transform>
        <emitter type="area"><rgb name="radiance" value="9, 9, 9"/></emitter>
    </shape>
</scene>
"""


def _run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def _process(
    *arguments: object, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "miplight", *map(str, arguments)]
    variables = os.environ | (environment or {})
    return subprocess.run(command, capture_output=True, text=True, env=variables, timeout=100, check=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The same ball in files of every kind."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    for suffix in ("obj", "ply", "stl", "off", "glb"):
        ball.export(tmp_path / f"ball.{suffix}")
    (tmp_path / "gltf").mkdir()
    trimesh.Scene(ball).export(tmp_path / "gltf" / "ball.gltf")
    return tmp_path


def test_files_of_every_kind_give_the_same_picture(folder: Path, adapter: str) -> None:
    images = {}
    for name in ("ball.obj", "ball.ply", "ball.glb", "gltf/ball.gltf"):
        target = folder / "picture.exr"
        result = _run("render", folder / name, target, *SMALL, "--adapter", adapter)
        assert result.exit_code == 0, result.output
        images[name] = ml.Frame.load(target).image
    assert images["ball.obj"].any()
    for name, image in images.items():
        # a text file has eight digits
        np.testing.assert_allclose(image, images["ball.obj"], rtol=1e-3, atol=1e-3, err_msg=name)
    assert not np.allclose(images["ball.obj"], np.roll(images["ball.obj"], 1, axis=1), atol=1e-3)


@pytest.mark.mitsuba
def test_a_mitsuba_file_has_its_own_view_and_light(folder: Path, adapter: str) -> None:
    (folder / "scene.xml").write_text(XML)
    result = _run("render", folder / "scene.xml", folder / "a.npz", "--adapter", adapter)
    assert result.exit_code == 0, result.output
    assert "added" not in result.output
    frame = ml.Frame.load(folder / "a.npz")
    assert frame.image.shape == (24, 32, 3)
    assert frame.image.any()
    result = _run("render", folder / "ball.ply", folder / "b.npz", *SMALL, "--adapter", adapter)
    assert "added: a camera in front of it, a light above it" in result.output


def test_the_view_can_be_chosen(folder: Path) -> None:
    ball = folder / "ball.ply"
    _, camera, added = load(
        ball, View(origin=(0.0, 0.0, 5.0), target=(0.0, 1.0, 0.0), fov_y=30.0, size=(20, 10))
    )
    assert camera == ml.Camera.look_at((0, 0, 5), (0, 1, 0), fov_y=30, width=20, height=10)
    assert added == ["a light above it"]
    _, camera, _ = load(ball, View(origin=(0.0, 9.0, 0.0)))
    np.testing.assert_allclose(camera.forward, (0, -1, 0), atol=1e-6)
    scene = trimesh.load(folder / "ball.glb")
    scene.set_camera(angles=(0, 0, 0), distance=4.0, center=(0, 0, 0))
    scene.camera.resolution = (40, 30)
    scene.export(folder / "camera.glb")
    known = load(folder / "camera.glb", View())[1]
    wide = load(folder / "camera.glb", View(fov_y=80.0))[1]
    assert wide.fov_y == pytest.approx(80.0)
    assert known.fov_y != pytest.approx(80.0)
    assert (wide.world_from_camera == known.world_from_camera).all()
    moved = load(folder / "camera.glb", View(origin=(1.0, 2.0, 3.0)))[1]
    np.testing.assert_allclose(moved.origin, (1, 2, 3))


def test_a_light_goes_where_it_is_wanted(folder: Path, adapter: str) -> None:
    walls = trimesh.creation.box((4, 4, 4))
    walls.export(folder / "box.ply")
    inside = ("--origin", 0, 0, 1.8, "--target", 0, 0, 0, *SMALL, "--adapter", adapter)
    dark = _run("render", folder / "box.ply", folder / "a.npz", *inside)
    assert dark.exit_code == 0
    assert "the picture is black: no light reaches what is seen" in dark.stderr
    assert not ml.Frame.load(folder / "a.npz").image.any()
    lit = _run("render", folder / "box.ply", folder / "a.npz", *inside, "--light", 0, 1.5, 0)
    assert "black" not in lit.stderr
    assert "added: a light\n" in lit.stderr
    assert ml.Frame.load(folder / "a.npz").image.any()
    away = _run(
        "render", folder / "box.ply", folder / "a.npz", *SMALL, "--origin", 9, 0, 0, "--target", 19, 0, 0
    )
    assert "nothing is seen" in away.stderr


def test_what_is_said_goes_where_it_belongs(folder: Path, adapter: str) -> None:
    arguments = ("render", folder / "ball.glb", folder / "a.png", *SMALL, "--adapter", adapter)
    plain = _run(*arguments)
    assert plain.stdout.splitlines()[-1] == str(folder / "a.png")
    assert "rendering 32 × 24 with default" in plain.stderr
    assert not _run(*arguments, "--quiet").stderr
    assert _run(*arguments, "--quiet").stdout.splitlines()[-1] == str(folder / "a.png")
    told = _run(*arguments, "--verbose").stdout
    assert "geometry/gbuffer" in told
    assert "left out: " in told


def test_notes_on_a_file_are_few(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for k in range(9):
        ball = trimesh.creation.icosphere(subdivisions=1)
        material = trimesh.visual.material.PBRMaterial(metallicFactor=0.1 * (k + 1), roughnessFactor=0.5)
        ball.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(ball, geom_name=f"ball_{k}")
    scene.export(tmp_path / "balls.glb")
    found = ml.Scene.from_trimesh(tmp_path / "balls.glb")
    everything = notes(found, everything=True)
    assert len(everything) == 9
    assert notes(found) == [*everything[:6], "3 more; --verbose shows them"]
    few = ml.Scene()
    few.add_mesh(trimesh.creation.box(), name="box")
    assert not notes(few)


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (("render", "ball.ply", "no/a.png"), 1, "there is no folder 'no'"),
        (("render", "ball.ply", "a.exr", "--exposure", "1"), 1, "only .png pictures"),
        (("render", "ball.ply", "a.png", "--origin", "0", "0", "0", "--target", "0", "0", "0"), 1, "target"),
        (("render", "ball.ply", "a.png", "--fov", "200"), 1, "fov_y"),
        (("render", "empty.obj", "a.png"), 1, "no mesh"),
        (("render", "words.txt", "a.png"), 1, "words.txt"),
        (("render", ".", "a.png"), 1, "no such file"),
        (("study", "ball.ply", "no/a.csv"), 1, "there is no folder 'no'"),
        (("render", "ball.ply"), 2, "Missing argument 'PICTURE'"),
        (("render", "ball.ply", "a.png", "--exposure", "x"), 2, "--exposure"),
        (("render", "ball.ply", "a.png", "--size", "4"), 2, "--size"),
        (("rendr",), 2, "rendr"),
    ],
)
def test_exit_codes(
    arguments: tuple[str, ...], code: int, part: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "empty.obj").write_text("# nothing\n")
    (folder / "words.txt").write_text("words\n")
    result = _run(*arguments)
    assert result.exit_code == code, result.output
    assert part in result.output
    assert "Traceback" not in result.output
    assert not (folder / "a.png").exists()


def test_a_study_with_failures_says_so(folder: Path, adapter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    inner = ml.Renderer.render

    def render(
        self: ml.Renderer, scene: ml.Scene, view: ml.Camera, settings: ml.Settings, outputs: object
    ) -> ml.Frame:
        if settings.light_samples == 16:
            raise ml.SettingsError("no sixteens")
        return inner(self, scene, view, settings, outputs)

    monkeypatch.setattr(ml.Renderer, "render", render)
    options = ("--size", 24, 24, "--repeats", 1, "--adapter", adapter)
    result = _run("study", folder / "ball.ply", folder / "t.csv", *options, "--set", "light_samples=4,16")
    assert result.exit_code == 1
    assert "1 of 2 combinations failed" in result.stderr
    assert "no sixteens" in result.stdout
    assert ml.study.load(folder / "t.csv")["ms"].notna().sum() == 1


def test_without_an_adapter_it_says_how_to_get_one(folder: Path) -> None:
    if sys.platform != "linux":
        pytest.skip("adapters come with the system")
    none = {"VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}
    about = _process("info", environment=none)
    assert about.returncode == 1
    assert "adapter  none: install" in about.stdout
    assert "preset   default" in about.stdout
    assert cli_report.driver_hint() in about.stdout
    failed = _process("render", folder / "ball.ply", folder / "a.png", environment=none)
    assert failed.returncode == 1
    assert cli_report.driver_hint() in failed.stderr
    assert "Traceback" not in failed.stderr
    assert _process("info").returncode == 0


@pytest.mark.parametrize("manager", ["apt-get", "dnf", "pacman", "zypper", "apk", ""])
def test_the_command_suits_the_system(manager: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.system", lambda: "Linux")
    monkeypatch.setattr("shutil.which", lambda name: name if name == manager else None)
    hint = cli_report.driver_hint()
    assert (f"sudo {manager} " in hint) if manager else ("lavapipe" in hint)
    monkeypatch.setattr("platform.system", lambda: "Darwin")
    assert "Metal" in cli_report.driver_hint()


def test_the_setup_installs_what_the_hint_names() -> None:
    script = (Path(__file__).resolve().parents[2] / "tools" / "ensure_system.sh").read_text()
    for manager in ("apt-get", "dnf", "pacman"):
        packages = [w for w in cli_report._DRIVERS[manager].split() if "vulkan" in w]
        assert packages
        assert " ".join(packages) in script


def test_a_terminal_sees_the_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    with cli_report.Working("waiting"):
        pass
    lines = shown.getvalue().split("\r")
    assert lines[1].startswith("waiting, 0.0 s")
    assert lines[-1].endswith(" s\n")
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with cli_report.Working("waiting"):
        pass
    assert sys.stderr.getvalue() == "waiting\n"


def test_every_setting_is_listed() -> None:
    listed = _run("info", "--settings").stdout
    for name, value in ml.Settings().to_dict().items():
        assert f"{name} (default {value!r})\n" in listed
