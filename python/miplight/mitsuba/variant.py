"""Which Mitsuba, which variant, which LLVM.

Mitsuba is an optional extra and is imported only when something asks for it. `activate` picks ``llvm_ad_rgb``
where an LLVM loads, else ``scalar_rgb`` with a note, and puts the caller's variant back afterwards.
"""

from __future__ import annotations

import os
import platform
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from miplight.errors import MiplightError

__all__ = ["INSTALL_HINT", "activate", "active_llvm_problem", "import_mitsuba", "pick_variant"]

INSTALL_HINT = 'pip install "mitsuba>=3.9,<3.10"'
# 3.10 rewrites the mesh interface; before 3.9 there is no public scene parser.
_OLDEST, _TOO_NEW = (3, 9), (3, 10)
# Dr.Jit 1.5 emits llvm.minimum and llvm.maximum, which LLVM cannot lower on x86 before 17: it ends the whole
# process ("Cannot select: fminimum"), so an older one must never be used.
_OLDEST_LLVM_X86 = 17

_LLVM_PLACES = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM.dylib",
    # rustc ships a recent LLVM: enough, and there wherever miplight is built from source
    "$RUSTUP_HOME/toolchains/*/lib/libLLVM*.so*",
)


def import_mitsuba() -> ModuleType:
    """Import Mitsuba 3.9, or say what to install.

    Returns
    -------
    module

    Raises
    ------
    MiplightError
        If Mitsuba is missing, or its version is not one that this package was checked against.
    """
    try:
        import mitsuba
    except ImportError as error:
        raise MiplightError(f"this needs Mitsuba 3.9, an optional extra: {INSTALL_HINT} ({error})") from error
    version = tuple(int(part) for part in re.findall(r"\d+", str(mitsuba.__version__))[:2])
    if not _OLDEST <= version < _TOO_NEW:
        raise MiplightError(f"mitsuba is {mitsuba.__version__}; allowed: 3.9.x, {INSTALL_HINT}")
    module: ModuleType = mitsuba
    return module


@contextmanager
def activate(variant: str | None = None) -> Iterator[Any]:
    """Run a block under one Mitsuba variant; the variant that was active before comes back at its end.

    Parameters
    ----------
    variant : str or None
        The variant's name. None takes `pick_variant`.

    Yields
    ------
    module
        ``mitsuba``, with `variant` active.
    """
    mi = import_mitsuba()
    before = mi.variant()
    chosen = pick_variant() if variant is None else variant
    try:
        mi.set_variant(chosen)
    except (ImportError, AttributeError) as error:
        raise MiplightError(f"variant is {chosen!r}, which does not load here: {error}") from error
    try:
        yield mi
    finally:
        if before is not None and before != chosen:
            mi.set_variant(before)


def pick_variant() -> str:
    """Name the fastest usable RGB variant: ``llvm_ad_rgb``, or ``scalar_rgb`` with a warning that says why.

    Returns
    -------
    str
    """
    global _picked
    if _picked is None:
        problem = _llvm_problem()
        _picked = "scalar_rgb" if problem else "llvm_ad_rgb"
        if problem:
            warnings.warn(
                f"Mitsuba runs in its scalar variant, hundreds of times slower: {problem}. Install LLVM 17 "
                "or newer (Debian: libllvm19), or set DRJIT_LIBLLVM_PATH to it before Mitsuba is first used.",
                stacklevel=3,
            )
    return _picked


_picked: str | None = None


def _llvm_problem() -> str:
    """Why ``llvm_ad_rgb`` cannot be used, or an empty string."""
    mi = import_mitsuba()
    before = mi.variant()
    if "llvm_ad_rgb" not in mi.variants():
        return "this Mitsuba was built without llvm_ad_rgb"
    try:
        mi.set_variant("llvm_ad_rgb")
        import drjit

        drjit.eval(mi.Float(1.0) + 1.0)
        version = drjit.detail.llvm_version()
    except Exception as error:  # whatever keeps it from loading, the scalar variant is the answer
        return str(error)
    finally:
        if before is not None:
            mi.set_variant(before)
    return _version_problem(version[0])


def active_llvm_problem(mi: Any) -> str:
    """Why kernels of the active variant may end the process, or an empty string."""
    if not mi.variant().startswith("llvm"):
        return ""
    import drjit

    drjit.eval(mi.Float(1.0) + 1.0)  # LLVM is loaded on first use
    return _version_problem(drjit.detail.llvm_version()[0])


def _version_problem(major: int) -> str:
    if _is_x86() and major < _OLDEST_LLVM_X86:
        return f"LLVM {major} cannot compile Mitsuba's kernels on x86"
    return ""


def _is_x86() -> bool:
    return platform.machine().lower() in ("x86_64", "amd64", "i686", "x86")


def _point_to_llvm() -> None:
    """Show Dr.Jit an LLVM that works, unless the user named one; the system's go first, then the newest."""
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return
    for place in _LLVM_PLACES:
        found = [entry for entry in map(_llvm_library, _expand(place)) if entry]
        if found and max(found)[0] >= _OLDEST_LLVM_X86:
            os.environ["DRJIT_LIBLLVM_PATH"] = max(found)[1]
            return


def _expand(place: str) -> list[Path]:
    """Files that a pattern of `_LLVM_PLACES` finds."""
    root = Path("/")
    if place.startswith("$RUSTUP_HOME/"):
        root = Path(os.environ.get("RUSTUP_HOME") or Path.home() / ".rustup")
    return list(root.glob(place.partition("/")[2]))


def _llvm_library(path: Path) -> tuple[int, str] | None:
    """Major version and path of an LLVM library; None if it is something else."""
    real = path.resolve()
    match = re.search(r"libLLVM(?:-|\.so\.)(\d+)|llvm/(\d+)", str(real))
    # files of a few bytes are linker scripts, which cannot be loaded
    if match is None or not real.is_file() or real.stat().st_size < 1_000_000:
        return None
    return int(match.group(1) or match.group(2)), str(path)


# Dr.Jit looks for LLVM once, when it is first imported: so this cannot wait until Mitsuba is needed.
_point_to_llvm()
