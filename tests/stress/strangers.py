"""Spoils files and loads them, in a process of its own: errors are counted, a crash or hang is seen.

``python -m tests.stress.strangers FOLDER SPOILT KIND …`` prints a line of JSON for each kind of file: how
many spoilt ones there were, how often each exception came, what was no error of ours, how many rendered.
"""

from __future__ import annotations

import collections
import faulthandler
import json
import resource
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import OpenEXR
import trimesh
from PIL import Image

import miplight as ml

MEMORY = 12 * 2**30
"""Address space in bytes: a header that asks for more is to be refused, not obeyed."""

XML = """<scene version='3.0.0'><shape type='{kind}'><string name='filename' value='{mesh}'/>
<bsdf type='diffuse'><texture type='bitmap' name='reflectance'>
<string name='filename' value='{image}'/></texture></bsdf></shape>
<shape type='rectangle'><transform name='to_world'><translate x='0' y='0' z='3'/></transform>
<emitter type='area'><rgb name='radiance' value='1, 2, 3'/></emitter></shape>
<sensor type='perspective'><float name='fov' value='50'/></sensor></scene>"""


def _picture() -> np.ndarray:
    return np.random.default_rng(5).integers(0, 255, (40, 48, 3)).astype(np.uint8)


def _ball() -> trimesh.Trimesh:
    """A ball with UVs and a picture."""
    ball = trimesh.creation.icosphere(2)
    uv = np.stack([np.arctan2(ball.vertices[:, 0], ball.vertices[:, 2]), ball.vertices[:, 1]], -1) / 7 + 0.5
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(_picture()))
    ball.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return ball


def _frame() -> ml.Frame:
    scene = ml.Scene.from_trimesh(trimesh.creation.icosphere(2))
    scene.add_light(ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), (9.0, 9.0, 9.0)))
    camera = ml.Camera.look_at((0, 1, 4), (0, 0, 0), width=24, height=20)
    with ml.Renderer() as renderer:
        return renderer.render(scene, camera, "default", outputs=("image", "depth", "fragments"))


def _exr(path: Path) -> None:
    image = np.random.default_rng(6).uniform(0, 1, (24, 32, 3)).astype(np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": image}).write(str(path))


def make(kind: str, folder: Path) -> tuple[Path, Path, Callable[[Path], object]]:
    """Write good files; returns which is spoilt, which is loaded, and with what."""
    if kind.startswith("frame."):
        path = folder / kind
        _frame().save(path)
        return path, path, ml.Frame.load
    if kind.startswith("xml"):
        ball = trimesh.creation.icosphere(2)
        mesh = "ball.obj" if kind == "xml obj" else "ball.ply"
        ball.export(folder / mesh)
        Image.fromarray(_picture()).save(folder / "picture.png")
        _exr(folder / "picture.exr")
        image = "picture.exr" if kind == "xml exr" else "picture.png"
        path = folder / "scene.xml"
        path.write_text(XML.format(kind=mesh[-3:], mesh=mesh, image=image))
        name = {"xml": "scene.xml", "xml png": image, "xml exr": image}.get(kind, mesh)
        return folder / name, path, ml.Scene.from_mitsuba
    path = folder / f"ball.{kind.split()[0]}"
    ball = _ball()
    if kind == "ply ascii":
        ball.export(path, encoding="ascii")
    else:
        ball.export(path)
    if kind == "obj png":
        (spoilt,) = folder.glob("*.png")
    elif kind == "obj mtl":
        (spoilt,) = folder.glob("*.mtl")
    elif kind == "gltf bin":
        spoilt = max(folder.glob("*.bin"), key=lambda p: p.stat().st_size)
    else:
        spoilt = path
    return spoilt, path, ml.Scene.from_trimesh


def spoil(data: bytes, count: int) -> Iterator[bytes]:
    """The file cut at every kilobyte, or 64 times if it is short; then `count` times with bytes changed."""
    for end in range(0, len(data), max(min(1024, len(data) // 64), 1)):
        yield data[:end]
    rng = np.random.default_rng(7)
    for k in range(count):
        changed = bytearray(data)
        reach = min(len(data), 512) if k % 2 else len(data)  # headers break more than what follows them
        for at in rng.integers(0, reach, int(rng.integers(1, 4))):
            changed[at] = int(rng.choice([0, 255, 127, changed[at] ^ 128, rng.integers(256)]))
        yield bytes(changed)


def look(loaded: object, renderer: ml.Renderer) -> None:
    """What did load can be rendered, and has finite numbers."""
    if not isinstance(loaded, ml.Scene):
        assert isinstance(loaded, ml.Frame)
        return
    camera = next(iter(loaded.cameras.values()), ml.Camera.look_at((0, 0, 4), (0, 0, 0))).replace(
        width=8, height=8
    )
    assert np.isfinite(renderer.render(loaded, camera, ml.Settings(light_samples=1)).image).all()


def try_all(kind: str, folder: Path, count: int, renderer: ml.Renderer) -> dict[str, object]:
    """Spoil one file in many ways and load each."""
    spoilt, path, load = make(kind, folder)
    good = spoilt.read_bytes()
    raised: collections.Counter[str] = collections.Counter()
    strange: dict[str, str] = {}
    rendered = tried = 0
    look(load(path), renderer)  # as it is, it loads
    for data in spoil(good, count):
        tried += 1
        spoilt.write_bytes(data)
        try:
            look(load(path), renderer)
            rendered += 1
        except ml.MiplightError as error:
            raised[type(error).__name__] += 1
        except Exception as error:  # what the test is after
            raised[type(error).__name__] += 1
            strange.setdefault(repr(error)[:300], "".join(traceback.format_exception(error)[-3:]))
    return {"kind": kind, "tried": tried, "rendered": rendered, "raised": raised, "strange": strange}


def main(folder: Path, count: int, kinds: list[str]) -> None:
    """Print what became of each kind."""
    faulthandler.enable()
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with ml.Renderer() as renderer:
        for kind in kinds:
            own = folder / kind.replace(" ", "_")
            own.mkdir()
            print(json.dumps(try_all(kind, own, count, renderer)), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
