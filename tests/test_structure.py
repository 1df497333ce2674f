"""The house rules, held by machine: sizes, one stem for each pass, citations, docs, stubs, no stray names."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest

import miplight as ml
from miplight._table import KNOBS, PRESETS
from tests.structure_rules import (
    ROOT,
    TOP,
    bibliography,
    brace_functions,
    citations,
    files,
    named,
    python_functions,
)

LIMITS = {".rs": 400, ".py": 400, ".js": 400, ".wgsl": 250}
FUNCTION_LIMIT = 60
# Rust files beside the passes that are no passes: what they share, and the inside of the native trace.
NO_PASS = {
    "mod",
    "arena",
    "scene_buffers",
    "trace_native",
    "trace_wgsl",
    "tree_upload",
    "levels",
    "sub_levels",
    "placed",
    "fragments",
    "prove_native",
    "adaptive",
    "list_params",
    "occlusion",
    "voxel_depths",
    "virtual_light",
    "virtual_lights",
    "parts",
    "volumes",
    "points",
    "nested",
}
# Two shaders of one pass: closest and any hits, and shadow rays that are made where they are traced.
RUST_OF = {"visibility/shadow": "visibility/trace"}


@pytest.mark.parametrize("path", files(*LIMITS), ids=named)
def test_files_and_functions_stay_small(path: Path) -> None:
    text = path.read_text()
    lines = text.count("\n")
    assert lines <= LIMITS[path.suffix], f"{named(path)} has {lines} lines"
    functions = python_functions(text) if path.suffix == ".py" else brace_functions(text)
    long = {name: length for name, length in functions if length > FUNCTION_LIMIT}
    assert not long, f"longer than {FUNCTION_LIMIT} lines in {named(path)}: {long}"


def test_function_lengths_are_measured_right() -> None:
    body = "    x;\n" * 61
    rust = 'fn brace() { "{"; }\npub(crate) fn long() {\n' + body + "}\nfn trait_only(&self);\n"
    assert dict(brace_functions(rust)) == {"brace": 1, "long": 63}
    python = "def f():\n    '''\n" + "    text\n" * 90 + "    '''\n    return 1\n"
    assert dict(python_functions(python)) == {"f": 2}


@pytest.mark.parametrize("path", files(".rs", ".wgsl", ".py"), ids=named)
def test_every_file_says_what_it_is(path: Path) -> None:
    first = path.read_text().lstrip()[:4]
    expected = {".rs": "//!", ".wgsl": "//", ".py": '"""'}[path.suffix]
    shebang = first.startswith("#!")
    assert first.startswith(expected) or shebang or path.name == "__main__.py", (
        f"{named(path)} starts {first!r}"
    )


def _stems(folder: str, suffix: str) -> set[str]:
    base = ROOT / folder
    return {p.relative_to(base).with_suffix("").as_posix() for p in base.rglob(f"*{suffix}")}


SHADERS = sorted(_stems("shaders/passes", ".wgsl"))


@pytest.mark.parametrize("stem", SHADERS)
def test_every_shader_has_its_pass_and_its_test(stem: str) -> None:
    folder, _, name = stem.rpartition("/")
    rust = f"src/passes/{RUST_OF.get(stem, stem)}.rs"
    assert (ROOT / rust).is_file(), f"no {rust}"
    assert (ROOT / f"tests/passes/{folder}/test_{name}.py").is_file(), (
        f"no tests/passes/{folder}/test_{name}.py"
    )


def test_every_pass_has_its_shader() -> None:
    passes = {s for s in _stems("src/passes", ".rs") if "/" in s and "/native/" not in s}
    passes = {s for s in passes if s.rpartition("/")[2] not in NO_PASS}
    assert passes == set(SHADERS)


@pytest.mark.parametrize("stem", SHADERS)
def test_every_pass_is_in_the_docs(stem: str) -> None:
    assert f"`{stem.rpartition('/')[2]}`" in (ROOT / "docs/method.md").read_text()


def test_citations_resolve_and_are_used() -> None:
    known, used = bibliography(), set()
    for path in [*files(".rs", ".wgsl", ".py"), *(ROOT / "docs").glob("*.md"), ROOT / "README.md"]:
        if path == Path(__file__) or path.name == "structure_rules.py":
            continue
        found = citations(path.read_text())
        assert found <= known, f"{named(path)} cites {sorted(found - known)}, not in docs/references.bib"
        used |= found
    for knob in KNOBS.values():
        used |= citations(knob.source)
    assert known == used, f"never cited: {sorted(known - used)}"


def test_citations_are_found() -> None:
    assert citations("sum [NPW10 Eq. 2; Deviation: L] and [NW09; KJ16], not [N20], [0, 1] or a[X12y]") == {
        "NPW10",
        "NW09",
        "KJ16",
    }


def test_no_host_of_a_registry_and_no_machine_s_own_path() -> None:
    words = ["py" + "pi.org", "pythonhost" + "ed.org", "crates" + ".io", "deb" + "ian.org", "/wo" + "rk/"]
    words += ["/ro" + "ot/", "/ho" + "me/"]
    texts = [*files(".rs", ".wgsl", ".py", ".pyi", ".sh", ".md"), *(ROOT / "docs").glob("*.*")]
    texts += [ROOT / name for name in TOP] + [ROOT / ".ci/run"] + list((ROOT / "notebooks").glob("*.ipynb"))
    for path in texts:
        found = [word for word in words if word in path.read_text()]
        assert not found, f"{named(path)} has {found}"


def test_the_core_does_not_panic() -> None:
    bad = re.compile(r"\.unwrap\(\)|\bpanic!|\bunreachable!|\btodo!|\bunimplemented!|\bdbg!")
    for path in files(".rs", folders=("src",)):
        shipped = path.read_text().split("#[cfg(test)]")[0]
        lines = [line for line in shipped.splitlines() if not line.lstrip().startswith("//")]
        found = [line.strip() for line in lines if bad.search(line)]
        assert not found, f"{named(path)}: {found}"


def _public(thing: Any) -> list[tuple[str, Any]]:
    """Public methods and properties that a class defines itself."""
    members = [(name, value) for name, value in vars(thing).items() if not name.startswith("_")]
    return [(n, v) for n, v in members if callable(v) or isinstance(v, (property, classmethod, staticmethod))]


@pytest.mark.parametrize("name", sorted(ml.__all__))
def test_public_names_are_documented(name: str) -> None:
    thing = getattr(ml, name)
    doc = inspect.getdoc(thing)
    assert doc, f"ml.{name} has no docstring"
    assert len(doc) > 20, f"ml.{name} has no docstring worth the name"
    if isinstance(thing, types.ModuleType):
        for inner in getattr(thing, "__all__", []):
            value = getattr(thing, inner)
            documented = inspect.isclass(value) or inspect.isfunction(value)
            assert not documented or inspect.getdoc(value), f"ml.{name}.{inner} has no docstring"
    if inspect.isclass(thing):
        for inner, value in _public(thing):
            assert inspect.getdoc(value), f"ml.{name}.{inner} has no docstring"


def test_settings_and_presets_are_documented() -> None:
    readme = (ROOT / "README.md").read_text()
    for name in PRESETS:
        assert f"`{name}`" in readme, f"README.md does not name the preset {name}"
    for knob in KNOBS.values():
        assert f"{knob.name} :" in (ml.Settings.__doc__ or "")


def test_stubs_of_the_core_are_complete(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "miplight._core", "--concise"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=170,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_versions_agree() -> None:
    version = re.search(r'^version = "(.+)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)
    assert version is not None
    assert ml.__version__ == version.group(1)
    assert f"## [{ml.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


def test_the_readme_s_commands_exist_and_ci_runs_them() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"\bmake ([a-z][a-z-]+)", (ROOT / "README.md").read_text()):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"no make {target}"
    assert "make test" in (ROOT / ".ci/run").read_text()


def test_notebooks_are_stored_without_outputs() -> None:
    for path in (ROOT / "notebooks").glob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
            if cell["cell_type"] == "code":
                assert not cell["outputs"], f"{named(path)} has outputs"
                assert cell["execution_count"] is None, f"{named(path)} has outputs"
