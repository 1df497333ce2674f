"""What emits light: a parallelogram (here) or a point with a hard-edged cone (`miplight.spot`).

A light's properties may be changed at any time; each change is checked first and then takes effect as a
whole, at the next render. Nothing of the scene is rebuilt for it.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._vectors import CHANGE, format_color, format_vector, rgb, unit, xyz
from .spot import SpotLight
from .validate import as_bool, as_choice, as_color_or_image, as_vector, fail

if TYPE_CHECKING:
    from . import _core

__all__ = ["AreaLight", "Light", "SpotLight"]

Filter: TypeAlias = Literal["nearest", "linear"]
Light: TypeAlias = "AreaLight | SpotLight"

# Edges are parallel when the sine of their angle is below this: float32 cannot tell their plane any more.
_PARALLEL_SINE = 1e-6


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _AreaState:
    """All of an area light, replaced as a whole so that a reader never sees half a change."""

    corner: NDArray[np.float64]
    edge_u: NDArray[np.float64]
    edge_v: NDArray[np.float64]
    radiance: NDArray[np.float32]
    two_sided: bool
    visible: bool
    filter: Filter


class AreaLight:
    """A parallelogram that emits light: corner + a·edge_u + b·edge_v with a, b in [0, 1].

    It emits to the side of ``cross(edge_u, edge_v)``, with the same radiance in every direction. A visible
    light is an opaque black surface from both sides, which blocks every ray and shows its radiance on its lit
    side.

    Parameters
    ----------
    corner, edge_u, edge_v : array_like, (3,)
        Scene units, any dtype. The edges must be neither zero nor parallel.
    radiance : array_like of float, (3,) or (h, w, 3)
        Linear RGB, W·sr⁻¹·m⁻², finite and not negative. An image is upright when seen from the lit side with
        edge_u to the right and edge_v up: its row 0 lies at b = 1, its column 0 at a = 0. Integer arrays are
        refused: use ``ml.srgb_to_linear(uint8_image)``.
    two_sided : bool, default False
        Emit alike on both sides.
    visible : bool, default True
        False: no surface at all, it only lights.
    filter : {"nearest", "linear"}, default "nearest"
        Texels of an image are constant patches, or are interpolated between their centres.

    Raises
    ------
    SceneError
        From the constructor and from every property set later; the light is then left as it was.

    Examples
    --------
    >>> import miplight as ml
    >>> light = ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), radiance=(12, 12, 12))
    >>> light.normal.tolist()
    [0.0, -1.0, 0.0]
    >>> light.radiance = (1.5, 1.0, 0.5)
    """

    __slots__ = ("__weakref__", "_state", "_texture")

    def __init__(
        self,
        corner: ArrayLike,
        edge_u: ArrayLike,
        edge_v: ArrayLike,
        radiance: ArrayLike = (1.0, 1.0, 1.0),
        *,
        two_sided: bool = False,
        visible: bool = True,
        filter: Filter = "nearest",  # noqa: A002 (the name that API.md gives it)
    ) -> None:
        self._state = _AreaState(
            *_check_parallelogram(corner, edge_u, edge_v),
            radiance=as_color_or_image(radiance, "radiance"),
            two_sided=as_bool(two_sided, "two_sided"),
            visible=as_bool(visible, "visible"),
            filter=_as_filter(filter),
        )
        self._texture: tuple[NDArray[np.float32], _core.Texture] | None = None

    @property
    def corner(self) -> NDArray[np.float64]:
        """Corner where a = b = 0, scene units: read-only float64 of shape (3,)."""
        return self._state.corner

    @corner.setter
    def corner(self, value: ArrayLike) -> None:
        self.set_geometry(corner=value)

    @property
    def edge_u(self) -> NDArray[np.float64]:
        """Edge along a, scene units: read-only float64 of shape (3,)."""
        return self._state.edge_u

    @edge_u.setter
    def edge_u(self, value: ArrayLike) -> None:
        self.set_geometry(edge_u=value)

    @property
    def edge_v(self) -> NDArray[np.float64]:
        """Edge along b, scene units: read-only float64 of shape (3,)."""
        return self._state.edge_v

    @edge_v.setter
    def edge_v(self, value: ArrayLike) -> None:
        self.set_geometry(edge_v=value)

    def set_geometry(
        self,
        corner: ArrayLike | None = None,
        edge_u: ArrayLike | None = None,
        edge_v: ArrayLike | None = None,
    ) -> None:
        """Move the light: change any of `corner`, `edge_u`, `edge_v` in one step.

        Raises
        ------
        SceneError
            If the new parallelogram is not one; the light is then left as it was.
        """
        with CHANGE:
            state = self._state
            new = _check_parallelogram(
                state.corner if corner is None else corner,
                state.edge_u if edge_u is None else edge_u,
                state.edge_v if edge_v is None else edge_v,
            )
            self._state = dataclasses.replace(state, corner=new[0], edge_u=new[1], edge_v=new[2])

    @property
    def radiance(self) -> NDArray[np.float32]:
        """Emitted radiance, linear RGB, W·sr⁻¹·m⁻²: read-only float32 of shape (3,) or (h, w, 3)."""
        return self._state.radiance

    @radiance.setter
    def radiance(self, value: ArrayLike) -> None:
        self._change(radiance=as_color_or_image(value, "radiance"))

    @property
    def two_sided(self) -> bool:
        """Whether both sides emit."""
        return self._state.two_sided

    @two_sided.setter
    def two_sided(self, value: bool) -> None:
        self._change(two_sided=as_bool(value, "two_sided"))

    @property
    def visible(self) -> bool:
        """Whether the light is a surface that is seen and blocks rays."""
        return self._state.visible

    @visible.setter
    def visible(self, value: bool) -> None:
        self._change(visible=as_bool(value, "visible"))

    @property
    def filter(self) -> Filter:
        """How an image is read: "nearest" (constant patches) or "linear"."""
        return self._state.filter

    @filter.setter  # noqa: A003 (our property, not the builtin)
    def filter(self, value: Filter) -> None:
        self._change(filter=_as_filter(value))

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal of the side that emits: float64 of shape (3,)."""
        state = self._state
        return unit(np.cross(unit(state.edge_u), unit(state.edge_v)))

    @property
    def area(self) -> float:
        """Area of one side, square scene units."""
        return float(np.linalg.norm(np.cross(self._state.edge_u, self._state.edge_v)))

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Box of the parallelogram: float64 of shape (2, 3)."""
        state = self._state
        u, v = state.edge_u, state.edge_v
        corners = state.corner + np.array([np.zeros(3), u, v, u + v])
        return np.array([corners.min(axis=0), corners.max(axis=0)])

    @property
    def is_textured(self) -> bool:
        """Whether the radiance is an image."""
        return self._state.radiance.ndim == 3

    def copy(self) -> AreaLight:
        """Return an independent light with the same values."""
        light = object.__new__(AreaLight)
        light._state = self._state
        light._texture = self._texture
        return light

    def __repr__(self) -> str:
        state = self._state
        options = "".join(
            f", {name}={value!r}"
            for name, value, default in (
                ("two_sided", state.two_sided, False),
                ("visible", state.visible, True),
                ("filter", state.filter, "nearest"),
            )
            if value != default
        )
        return (
            f"AreaLight(corner={format_vector(state.corner)}, edge_u={format_vector(state.edge_u)}, "
            f"edge_v={format_vector(state.edge_v)}, radiance={format_color(state.radiance)}{options})"
        )

    def __getstate__(self) -> _AreaState:
        return self._state

    def __setstate__(self, state: _AreaState) -> None:
        for array in (state.corner, state.edge_u, state.edge_v, state.radiance):
            array.flags.writeable = False  # pickling forgets it
        self._state = state
        self._texture = None

    def _change(self, **changes: Any) -> None:
        with CHANGE:
            self._state = dataclasses.replace(self._state, **changes)

    def _core_light(self, name: str) -> _core.AreaLight:
        """Hand over the light as it is now; its image is uploaded again only when it is another one."""
        from . import _core

        state = self._state
        radiance: tuple[float, float, float] | _core.Texture = rgb(state.radiance)
        if state.radiance.ndim == 3:
            cached = self._texture
            if cached is None or cached[0] is not state.radiance:
                cached = (state.radiance, _core.Texture(state.radiance))
                self._texture = cached
            radiance = cached[1]
        linear = state.filter == "linear"
        corner, edge_u, edge_v = xyz(state.corner), xyz(state.edge_u), xyz(state.edge_v)
        return _core.AreaLight(name, corner, edge_u, edge_v, radiance, state.two_sided, state.visible, linear)


def _check_parallelogram(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    origin = as_vector(corner, "corner")
    edges = as_vector(edge_u, "edge_u"), as_vector(edge_v, "edge_v")
    for name, edge in zip(("edge_u", "edge_v"), edges, strict=True):
        if not 1e-15 < np.linalg.norm(edge) < 1e15:
            fail(name, edge, "a vector with a length between 1e-15 and 1e15 scene units")
    if np.linalg.norm(np.cross(unit(edges[0]), unit(edges[1]))) < _PARALLEL_SINE:
        fail("edge_v", edges[1], f"a vector that is not parallel to edge_u, {format_vector(edges[0])}")
    return origin, *edges


def _as_filter(value: str) -> Filter:
    return "linear" if as_choice(value, "filter", ("nearest", "linear")) == "linear" else "nearest"
