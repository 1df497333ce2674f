"""The command `miplight`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result

import miplight as ml
from miplight.cli import main


def _run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.glb"
    trimesh.Scene(trimesh.creation.icosphere(subdivisions=2)).export(path)
    return path


def test_info() -> None:
    result = _run("info")
    assert result.exit_code == 0, result.output
    assert ml.__version__ in result.output
    assert ml.adapters()[0]["name"] in result.output
    assert "preset   brute-force" in result.output
    assert "preset   hierarchical-2009" in result.output


def test_version_and_help() -> None:
    assert ml.__version__ in _run("--version").output
    for command in ("demo", "render", "info", "study", "compare"):
        assert command in _run("--help").output
        assert _run(command, "--help").exit_code == 0


def test_render_writes_what_the_suffix_says(ball: Path, tmp_path: Path, adapter: str) -> None:
    for suffix in (".png", ".exr", ".npz"):
        target = tmp_path / f"picture{suffix}"
        options = ("--size", 40, 30, "--set", "light_samples=4", "--set", "light_pattern=grid")
        result = _run("render", ball, target, *options, "--adapter", adapter)
        assert result.exit_code == 0, result.output
        assert str(target) in result.output
        assert "40 × 30" in result.output
        assert "direct/" not in result.output, "passes are for --verbose"
    frame = ml.Frame.load(tmp_path / "picture.npz")
    assert frame.image.shape == (30, 40, 3)
    assert frame.image.any()
    expected = ml.Settings.preset("default").replace(light_samples=4, light_pattern="grid")
    assert frame.settings == expected


@pytest.mark.parametrize("scale", [1e-4, 1e5])
def test_render_suits_any_scale(tmp_path: Path, scale: float, adapter: str) -> None:
    images = []
    for name, factor in (("one", 1.0), ("other", scale)):
        trimesh.creation.icosphere(subdivisions=2, radius=factor).export(tmp_path / f"{name}.ply")
        options = ("--size", 24, 24, "--set", "light_samples=4", "--adapter", adapter)
        result = _run("render", tmp_path / f"{name}.ply", tmp_path / f"{name}.npz", *options)
        assert result.exit_code == 0, result.output
        images.append(ml.Frame.load(tmp_path / f"{name}.npz").image)
    np.testing.assert_allclose(images[1], images[0], rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("render", "missing.glb", "x.png"), "missing.glb"),
        (("render", "BALL", "x.jpg"), ".exr"),
        (("render", "BALL", "x.png", "--preset", "brute"), "did you mean 'brute-force'"),
        (("render", "BALL", "x.png", "--set", "light_sample=4"), "did you mean 'light_samples'"),
        (("render", "BALL", "x.png", "--set", "light_samples"), "NAME=VALUE"),
        (("render", "BALL", "x.png", "--set", "light_samples=many"), "'many'"),
        (("render", "BALL", "x.png", "--camera", "front"), "front"),
        (("render", "BALL", "x.png", "--size", "0", "4"), "width"),
        (("render", "BALL", "x.png", "--adapter", "nonesuch"), "nonesuch"),
        (("study", "BALL", "x.txt"), ".parquet"),
        (("study", "BALL", "x.csv", "--set", "light_sample=4,8"), "did you mean 'light_samples'"),
        (("study", "BALL", "x.csv", "--set", "light_samples=4,-8"), "-8"),
    ],
)
def test_mistakes_end_with_one_line(
    arguments: tuple[str, ...], part: str, ball: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ball.parent)
    result = _run(*(str(ball) if a == "BALL" else a for a in arguments))
    assert result.exit_code == 1
    assert part in result.output
    assert "Traceback" not in result.output
    assert not (ball.parent / "x.png").exists()


def test_study_tabulates_every_combination(ball: Path, tmp_path: Path, adapter: str) -> None:
    target = tmp_path / "table.csv"
    options = ("--size", 24, 24, "--preset", "brute-force", "--preset", "default", "--repeats", 2)
    result = _run("study", ball, target, *options, "--set", "light_samples=4,16", "--adapter", adapter)
    assert result.exit_code == 0, result.output
    assert [len(line.split()) for line in result.stdout.splitlines()] == [5] * 5
    table = ml.study.load(target)
    assert len(table) == 8
    assert table["error"].isna().all()
    assert set(table["light_samples"]) == {4, 16}


@pytest.mark.mitsuba
def test_study_draws_errors_against_a_reference(ball: Path, tmp_path: Path, adapter: str) -> None:
    options = ("--size", 24, 24, "--preset", "brute-force", "--set", "light_samples=4,256", "--spp", 256)
    result = _run("study", ball, tmp_path / "table.csv", *options, "--adapter", adapter)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "table.png").is_file()
    coarse, fine = ml.study.medians(ml.study.load(tmp_path / "table.csv"))["relative_rmse"]
    assert fine < coarse


def test_demo(tmp_path: Path, adapter: str) -> None:
    result = _run("demo", "--quick", "--out", tmp_path / "demo", "--adapter", adapter)
    assert result.exit_code == 0, result.output
    for name in ("spot", "colonnade"):
        for suffix in (".png", ".exr", ".npz", "_fragments.png"):
            path = tmp_path / "demo" / f"{name}{suffix}"
            assert path.stat().st_size > 100
            assert str(path) in result.output
    assert "direct/shadow" in result.output
    assert "500,510 triangles" in result.output
    frame = ml.Frame.load(tmp_path / "demo" / "spot.npz")
    assert frame.indirect.any()
    assert frame.direct[frame.surface_mask].any(axis=-1).mean() > 0.5


@pytest.mark.mitsuba
def test_compare(ball: Path, tmp_path: Path, adapter: str) -> None:
    out = tmp_path / "compare"
    options = ("--size", 32, 32, "--spp", 64, "--out", out, "--adapter", adapter)
    result = _run("compare", ball, *options)
    assert result.exit_code == 0, result.output
    assert (out / "miplight.png").is_file()
    assert (out / "mitsuba.png").is_file()
    error = float(result.output.split("trim 0.001:")[1].split()[0])
    assert 0.0 <= error < 0.05
