"""How the house rules are measured: files of each kind, functions and their lengths, citations."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("src", "shaders", "python", "tests", "benches", "tools")
TOP = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml", "Cargo.toml")

# a key: letters and at least two digits, as in [NPW10 Eq. 2] or [NW09; KJ16]
_KEY = re.compile(r"[A-Z][A-Za-z]+\d{2,}[a-z]?")
_BRACKET = re.compile(r"\[([A-Z][A-Za-z]+\d{2,}[a-z]?(?:[ ;,][^\]\[]*)?)\]")
_RUST_FUNCTION = re.compile(
    r"^\s*(?:pub(?:\([^)]*\))?\s+)?(?:const\s+|unsafe\s+|extern\s+\"C\"\s+)*fn\s+(\w+)"
)


def files(*suffixes: str, folders: tuple[str, ...] = SOURCES) -> list[Path]:
    """Sources of the repository with one of `suffixes`."""
    found = [p for folder in folders for p in sorted((ROOT / folder).rglob("*")) if p.suffix in suffixes]
    return [p for p in found if p.is_file() and not {"__pycache__", "failures"} & set(p.parts)]


def named(path: Path) -> str:
    """Name a file for a message: its path inside the repository."""
    return path.relative_to(ROOT).as_posix()


def blank_literals(text: str) -> str:
    """Blank out comments and literals of Rust or WGSL, so that braces in them do not count; lines stay."""
    pattern = re.compile(
        r'r(#+)".*?"\1|r"[^"]*"|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'|//[^\n]*|/\*.*?\*/', re.DOTALL
    )
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)


def brace_functions(text: str) -> Iterator[tuple[str, int]]:
    """Name and number of lines of each Rust or WGSL function that has a body."""
    lines = blank_literals(text).split("\n")
    for start, line in enumerate(lines):
        match = _RUST_FUNCTION.match(line)
        if not match:
            continue
        depth, opened = 0, False
        for end in range(start, len(lines)):
            body = lines[end]
            depth += body.count("{") - body.count("}")
            opened = opened or "{" in body
            if opened and depth <= 0:
                yield match.group(1), end - start + 1
                break
            if not opened and ";" in body.split("//")[0] and "[" not in body:
                break


def python_functions(text: str) -> Iterator[tuple[str, int]]:
    """Name and number of lines of each Python function; the docstring does not count."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        length = (node.end_lineno or node.lineno) - node.lineno + 1
        first = node.body[0]
        if ast.get_docstring(node) is not None:
            length -= (first.end_lineno or first.lineno) - first.lineno + 1
        yield node.name, length


def citations(text: str) -> set[str]:
    """Keys cited in `text`."""
    keys: set[str] = set()
    for match in _BRACKET.finditer(text):
        for part in match.group(1).split(";"):
            key = _KEY.match(part.strip())
            if key:
                keys.add(key.group())
    return keys


def bibliography() -> set[str]:
    """Keys of docs/references.bib."""
    return set(re.findall(r"^@\w+\{([^,\s]+),", (ROOT / "docs/references.bib").read_text(), re.MULTILINE))
