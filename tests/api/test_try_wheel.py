"""`tools/try_wheel.py` sees what is wrong with a wheel, and tries the README's first example."""

from __future__ import annotations

import importlib.util
import zipfile
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import miplight as ml

ROOT = Path(__file__).resolve().parents[2]
GOOD = "miplight-0.1.0-cp310-abi3-manylinux_2_28_x86_64.manylinux_2_34_x86_64.whl"


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("try_wheel", ROOT / "tools" / "try_wheel.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _wheel(folder: Path, name: str, files: tuple[str, ...]) -> Path:
    with zipfile.ZipFile(folder / name, "w") as archive:
        for file in files:
            archive.writestr(file, "")
    return folder / name


def test_a_wheel_as_it_should_be(tool: ModuleType, tmp_path: Path) -> None:
    for name in (
        GOOD,
        GOOD.replace("manylinux_2_28_x86_64.", ""),
        "miplight-0.1.0-cp310-abi3-macosx_11_0_arm64.whl",
    ):
        assert not tool.problems(_wheel(tmp_path, name, tool.INSIDE))
    assert tool.main([str(tmp_path / GOOD), "--look-only"]) == 0


@pytest.mark.parametrize(
    ("name", "dropped", "added", "says"),
    [
        (GOOD.replace("cp310-abi3", "cp311-cp311"), "", "", "allowed: cp310-abi3"),
        ("miplight-0.1.0-cp310-abi3-linux_x86_64.whl", "", "", "allowed: manylinux"),
        ("other-0.1.0-py3-none-any.whl", "", "", "no name of a wheel"),
        (GOOD, "miplight/_core.abi3.so", "", "has no miplight/_core.abi3.so"),
        (GOOD, "miplight/data/spot/spot.glb", "", "has no miplight/data"),
        (GOOD, "", "miplight/__pycache__/a.pyc", "it has miplight/__pycache__"),
    ],
)
def test_what_is_wrong_is_named(
    name: str, dropped: str, added: str, says: str, tool: ModuleType, tmp_path: Path
) -> None:
    files = tuple(file for file in (*tool.INSIDE, added) if file and file != dropped)
    wheel = _wheel(tmp_path, name, files)
    assert [problem for problem in tool.problems(wheel) if says in problem]
    assert tool.main([str(wheel), "--look-only"]) == 1


def test_what_is_inside_is_there(tool: ModuleType) -> None:
    package = Path(ml.__file__).parent
    for file in tool.INSIDE:
        assert (package.parent / file).is_file()


def test_the_example_is_the_readme_s(
    tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    example = tool.first_example((ROOT / "README.md").read_text())
    assert example.startswith("import miplight as ml\n")
    assert "width=512" not in example
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(example.replace("128", "32"), names)
    frame = names["frame"]
    assert isinstance(frame, ml.Frame)
    assert np.isfinite(frame.image).all()
    # here the package is no installed one: the check that it is, is one
    with pytest.raises(AssertionError, match="is imported from"):
        exec(tool.CHECK, names)
