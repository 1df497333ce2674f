"""What `from_mitsuba` refuses, and how it says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import miplight as ml
from miplight.from_mitsuba import load
from tests.mitsuba.xml_scenes import write

pytestmark = pytest.mark.mitsuba


# -- what is refused


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            '<shape type="hair" id="fur"><string name="filename" value="x"/></shape>',
            r"shape 'fur' \(hair, x\): shape is 'hair'",
        ),
        (
            '<emitter type="constant" id="sky"/>',
            r"emitter 'sky' \(constant\): emitter is 'constant'; allowed: spot",
        ),
        ('<emitter type="point"/>', r"emitter is 'point'"),
        ('<sensor type="orthographic"/>', r"sensor is 'orthographic'; allowed: perspective"),
        ('<shape type="cube"><bsdf type="hair"/></shape>', r"bsdf is 'hair'; allowed: "),
        (
            '<shape type="sphere"><emitter type="area"/></shape>',
            r"an area emitter is on a 'sphere'; allowed: a rectangle",
        ),
        (
            '<shape type="ply"><string name="filename" value="no.ply"/></shape>',
            r"filename is 'no.ply', which is not in",
        ),
        ('<emitter type="spot"><float name="cutoff_angle" value="85"/></emitter>', r"cutoff is 85"),
        ('<shape type="cube"><ref id="none"/></shape>', r'unresolved reference to "none"'),
        ('<shape type="cube">', r"is no Mitsuba scene: .*Start-end tags mismatch"),
        ('<shape type="cube"><string name="a" value="$b"/></shape>', r"undefined parameter: \$b"),
    ],
)
def test_refusals_name_what_and_where(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(ml.SceneError, match=message):
        ml.Scene.from_mitsuba(write(tmp_path, body))


def test_everything_refused_is_named_at_once_or_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, '<emitter type="constant"/><shape type="hair"/><shape type="cube" id="c"/>')
    with pytest.raises(ml.SceneError, match=r"(?s)constant.*hair"):
        load(path)
    scene = load(path, strict=False)
    assert list(scene.meshes) == ["c"]
    assert sum(note.startswith("left out: ") for note in scene.report.notes) == 2


@pytest.mark.parametrize("source", ["no.xml", 3, None])
def test_bad_sources(source: Any) -> None:
    with pytest.raises(ml.SceneError, match=r"source is .*; allowed: a"):
        load(source)


def test_a_file_cut_short(tmp_path: Path) -> None:
    ball = ml.shapes.displaced_sphere(500)
    ball.export(tmp_path / "ball.ply")
    data = (tmp_path / "ball.ply").read_bytes()
    (tmp_path / "ball.ply").write_bytes(data[: len(data) // 2])
    with pytest.raises(
        ml.SceneError, match=r"shape \(ply, ball.ply\): ball.ply cannot be read .*a whole PLY file"
    ):
        load(write(tmp_path, '<shape type="ply"><string name="filename" value="ball.ply"/></shape>'))
