"""Files from strangers: damaged ones load or are an error of ours; none crashes, hangs or eats memory."""

from __future__ import annotations

import io
import json
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import trimesh
from PIL import Image

import miplight as ml
from tests.stress.common import sized
from tests.stress.strangers import XML

ROOT = Path(__file__).parents[2]
KINDS = {
    "gltf": ["glb", "gltf", "gltf bin"],
    "obj": ["obj", "obj png", "obj mtl"],
    "others": ["ply", "ply ascii", "stl", "off"],
    "frames": ["frame.exr", "frame.npz"],
    "mitsuba text": ["xml", "xml obj", "xml ply"],
    "mitsuba pictures": ["xml png", "xml exr"],
}
# a material of OBJ that cannot be read leaves its mesh grey: such files load as they are
FORGIVING = {"obj mtl"}


def spoil(folder: Path, kinds: list[str], count: int) -> list[dict[str, Any]]:
    """What became of spoilt files, loaded in a process of their own."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.stress.strangers", str(folder), str(count), *kinds],
        cwd=ROOT,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=sized(60, 600),
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    # Mitsuba's log stands in between, and ends with codes for colours
    lines = [line[line.index('{"kind"') :] for line in done.stdout.splitlines() if '{"kind"' in line]
    return [json.loads(line) for line in lines]


@pytest.mark.mitsuba
@pytest.mark.parametrize("group", KINDS)
def test_damaged_files_are_errors_of_ours(tmp_path: Path, group: str) -> None:
    reports = spoil(tmp_path, KINDS[group], sized(40, 3000))
    assert [report["kind"] for report in reports] == KINDS[group]
    for report in reports:
        assert not report["strange"], report["kind"]
        assert set(report["raised"]) <= {"SceneError", "SettingsError"}, report
        assert sum(report["raised"].values()) + report["rendered"] == report["tried"]
        if report["kind"] not in FORGIVING:
            assert report["raised"]["SceneError"] > 0.2 * report["tried"], "negative control: damage is seen"


def _huge_png(path: Path, side: int) -> None:
    """A PNG whose header says side × side, with a few bytes of pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(b"\0" * 9999))
        + chunk(b"IEND", b"")
    )


def _huge_exr(path: Path, side: int) -> None:
    """An EXR whose data window says side × side, over pixels of 8 × 8."""
    image = np.ones((8, 8, 3), np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": image}).write(str(path))
    data, window = path.read_bytes(), struct.pack("<4i", 0, 0, 7, 7)
    assert data.count(window) == 2
    path.write_bytes(data.replace(window, struct.pack("<4i", 0, 0, side - 1, side - 1)))


def _peak() -> int:
    """Most memory that this process has had, bytes."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")))


def _huge_npz(path: Path, side: int) -> None:
    """A frame whose image's header says side × side, in an archive of a few bytes."""
    about = {"format": "miplight-frame-1", "settings": {}, "stats": {}, "size": [side, side]}
    body = io.BytesIO()
    np.lib.format.write_array(body, np.zeros((1, 1, 3), np.float32))
    data = body.getvalue().replace(b"(1, 1, 3)", f"({side}, {side}, 3)".encode())
    text = io.BytesIO()
    np.lib.format.write_array(text, np.array(json.dumps(about)))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("about.npy", text.getvalue())
        archive.writestr("array:image.npy", data)


def _gltf_with(folder: Path, picture: bytes) -> Path:
    """A glTF file whose base colour is `picture`."""
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4)))
    ball = trimesh.creation.icosphere(0)
    ball.visual = trimesh.visual.TextureVisuals(uv=np.zeros((12, 2)), material=material)
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(ball))
    about = json.loads(files["model.gltf"])
    number = about["bufferViews"][about["images"][0]["bufferView"]]["buffer"]
    about["bufferViews"][number]["byteLength"] = about["buffers"][number]["byteLength"] = len(picture)
    files |= {"model.gltf": json.dumps(about).encode(), f"gltf_buffer_{number}.bin": picture}
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder / "model.gltf"


def _load(kind: str, picture: Path) -> object:
    folder = picture.parent
    if kind.endswith("frame"):
        return ml.Frame.load(picture).image
    if kind == "png by trimesh":
        return ml.Scene.from_trimesh(_gltf_with(folder, picture.read_bytes()))
    trimesh.creation.icosphere(1).export(folder / "ball.ply")
    path = folder / "scene.xml"
    path.write_text(XML.format(kind="ply", mesh="ball.ply", image=picture.name))
    return ml.Scene.from_mitsuba(path)


WRITERS = {"png": _huge_png, "exr": _huge_exr, "npz": _huge_npz}


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    "kind", ["png by trimesh", "png by mitsuba", "exr by mitsuba", "exr frame", "npz frame"]
)
def test_a_header_that_claims_a_billion_texels_is_refused(tmp_path: Path, kind: str) -> None:
    write = WRITERS[kind[:3]]
    picture = tmp_path / f"picture.{kind[:3]}"
    write(picture, 32_000)
    before = _peak()
    if kind == "png by trimesh":  # which leaves such a picture out
        scene = _load(kind, picture)
        assert isinstance(scene, ml.Scene)
        assert all(mesh.material.albedo.shape == (3,) for mesh in scene.meshes.values())
    else:
        with pytest.raises(ml.SceneError):
            _load(kind, picture)
    assert _peak() - before < 2**30, "it was refused, not read"


@pytest.mark.parametrize("side", [4, 64])
def test_a_header_that_does_not_lie_is_read(tmp_path: Path, side: int) -> None:
    """Negative control: the same file with its own picture loads."""
    data = io.BytesIO()
    Image.new("RGB", (side, side), (255, 0, 0)).save(data, "png")
    scene = ml.Scene.from_trimesh(_gltf_with(tmp_path, data.getvalue()))
    (mesh,) = scene.meshes.values()
    assert mesh.material.albedo.shape == (side, side, 3)


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    "mesh",
    ["../none.ply", "/dev/zero", "/proc/self/mem", "/etc/passwd", "..", "ball.ply/../../x", "a\0b.ply"],
)
def test_xml_that_points_elsewhere_is_an_error(tmp_path: Path, mesh: str) -> None:
    """To what does not exist, to devices, to files that are no meshes: nothing of what they hold is shown."""
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "scene.xml"
    path.write_text(XML.format(kind="ply", mesh=mesh.replace("\0", "&#0;"), image="none.png"))
    with pytest.raises(ml.SceneError) as caught:
        ml.Scene.from_mitsuba(path)
    assert "root:" not in str(caught.value)


@pytest.mark.mitsuba
def test_xml_may_name_files_beside_its_folder(tmp_path: Path) -> None:
    """As Mitsuba's own scenes do."""
    (tmp_path / "in").mkdir()
    trimesh.creation.icosphere(1).export(tmp_path / "ball.ply")
    image = np.linspace(0, 1, 6 * 5 * 3, dtype=np.float32).reshape(6, 5, 3)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": image}).write(str(tmp_path / "picture.exr"))
    path = tmp_path / "in" / "scene.xml"
    path.write_text(XML.format(kind="ply", mesh="../ball.ply", image="../picture.exr"))
    scene = ml.Scene.from_mitsuba(path)
    assert len(scene.meshes["ball"].triangles) == 80
    # without UVs it is the mean colour; `test_an_exr_picture_is_taken_as_it_is` has some
    assert np.allclose(scene.meshes["ball"].material.albedo, image.mean(axis=(0, 1)), atol=1e-6)


@pytest.mark.mitsuba
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_an_exr_picture_is_taken_as_it_is(tmp_path: Path, dtype: Any) -> None:
    image = np.linspace(0, 1, 6 * 5 * 3).reshape(6, 5, 3).astype(dtype)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": image}).write(str(tmp_path / "picture.exr"))
    path = tmp_path / "scene.xml"
    text = XML.format(kind="ply", mesh="", image="picture.exr")
    ply = "<shape type='ply'><string name='filename' value=''/>"
    path.write_text(text.replace(ply, "<shape type='rectangle' id='r'>"))
    assert np.array_equal(ml.Scene.from_mitsuba(path).meshes["r"].material.albedo, image.astype(np.float32))


@pytest.mark.mitsuba
def test_xml_that_includes_itself_ends(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text("<scene version='3.0.0'><include filename='scene.xml'/></scene>")
    with pytest.raises(ml.SceneError, match=r"scene\.xml is no Mitsuba scene"):
        ml.Scene.from_mitsuba(path)


@pytest.mark.mitsuba
@pytest.mark.parametrize("corner", [-1, 4, 2**31 - 1])
def test_a_ply_corner_beyond_the_vertices_is_named(tmp_path: Path, corner: int) -> None:
    """Mitsuba alone would follow it."""
    mesh = trimesh.creation.icosphere(0)
    mesh.export(tmp_path / "ball.ply", encoding="binary")
    data = (tmp_path / "ball.ply").read_bytes()
    head, end, body = data.partition(b"end_header\n")
    at = len(mesh.vertices) * 12 + 1  # behind the count of the first triangle's corners
    assert body[at - 1] == 3
    beyond = corner if corner != 4 else len(mesh.vertices)
    (tmp_path / "ball.ply").write_bytes(
        head.replace(b"https", b"\xff\xfe") + end + body[:at] + struct.pack("<i", beyond) + body[at + 4 :]
    )
    path = tmp_path / "scene.xml"
    shape = "<shape type='ply'><string name='filename' value='ball.ply'/></shape>"
    path.write_text(f"<scene version='3.0.0'>{shape}</scene>")
    with pytest.raises(ml.SceneError, match=rf"damaged: a triangle has vertex {beyond}; allowed: 0 to 11"):
        ml.Scene.from_mitsuba(path)


@pytest.mark.mitsuba
def test_a_bitmap_without_a_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    trimesh.creation.icosphere(0).export(tmp_path / "ball.ply")
    text = XML.format(kind="ply", mesh="ball.ply", image="x")
    path.write_text(text.replace("<string name='filename' value='x'/>", ""))
    with pytest.raises(ml.SceneError, match="a bitmap has no filename"):
        ml.Scene.from_mitsuba(path)
