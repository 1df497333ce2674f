"""What became of a scene's input: triangles kept and dropped, and what was left out."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterator, Mapping

__all__ = ["MeshReport", "SceneReport"]


@dataclasses.dataclass(frozen=True)
class MeshReport:
    """One mesh: how many triangles were kept and dropped, and why.

    Attributes
    ----------
    triangles : int
        Kept.
    degenerate : int
        Dropped because they have no area.
    not_finite : int
        Dropped because a vertex is NaN or infinite.
    notes : tuple of str
        What else was changed or left out: emission, alpha, maps that are not used, normals that were mended.
    """

    triangles: int
    degenerate: int
    not_finite: int
    notes: tuple[str, ...] = ()

    @property
    def dropped(self) -> int:
        """Triangles dropped for either reason."""
        return self.degenerate + self.not_finite


@dataclasses.dataclass(frozen=True)
class SceneReport(Mapping[str, MeshReport]):
    """`MeshReport` by mesh name, and notes on the scene as a whole; prints as a table.

    Attributes
    ----------
    meshes : dict of str to MeshReport
    notes : tuple of str
        What a file held and the scene does not: lights, emitters, cameras, point clouds, by name.
    """

    meshes: dict[str, MeshReport]
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> MeshReport:
        return self.meshes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.meshes)

    def __len__(self) -> int:
        return len(self.meshes)

    @property
    def triangles(self) -> int:
        """Triangles kept, all meshes together."""
        return sum(mesh.triangles for mesh in self.meshes.values())

    @property
    def dropped(self) -> int:
        """Triangles dropped, all meshes together."""
        return sum(mesh.dropped for mesh in self.meshes.values())

    def _rows(self) -> list[tuple[str, str, str, str, str]]:
        return [
            (name, f"{m.triangles:,}", f"{m.degenerate:,}", f"{m.not_finite:,}", "; ".join(m.notes))
            for name, m in self.meshes.items()
        ]

    def __repr__(self) -> str:
        rows = [("mesh", "kept", "degenerate", "not finite", "notes"), *self._rows()]
        widths = [max(len(row[column]) for row in rows) for column in range(4)]
        lines = [
            "  ".join(
                [row[0].ljust(widths[0]), *(row[k].rjust(widths[k]) for k in range(1, 4)), row[4]]
            ).rstrip()
            for row in rows
        ]
        return "\n".join([*lines, *(f"- {note}" for note in self.notes)])

    def _repr_html_(self) -> str:
        cells = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self._rows()
        )
        head = "".join(f"<th>{title}</th>" for title in ("mesh", "kept", "degenerate", "not finite", "notes"))
        notes = "".join(f"<li>{html.escape(note)}</li>" for note in self.notes)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{cells}</tbody></table><ul>{notes}</ul>"
