"""A point light with a hard-edged cone."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._vectors import CHANGE, format_color, format_vector, rgb, unit, xyz
from .validate import as_color, as_number, as_vector, fail

if TYPE_CHECKING:
    from . import _core

__all__ = ["SpotLight"]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _SpotState:
    position: NDArray[np.float64]
    target: NDArray[np.float64]
    intensity: NDArray[np.float32]
    cutoff: float


class SpotLight:
    """A point that emits alike into a hard-edged cone, and nothing outside it; it has no surface.

    Parameters
    ----------
    position, target : array_like, (3,)
        Where it is and what it points at, scene units; they must differ.
    intensity : array_like of float, (3,)
        Radiant intensity inside the cone, linear RGB, W·sr⁻¹, finite and not negative.
    cutoff : float, default 45.0
        Half-angle of the cone, degrees, in (0, 80].

    Raises
    ------
    SceneError
        From the constructor and from every property set later; the light is then left as it was.

    Examples
    --------
    >>> import miplight as ml
    >>> ml.SpotLight((0, 3, 0), (0, 0, 0), intensity=(50, 50, 50), cutoff=30.0)
    SpotLight(position=(0, 3, 0), target=(0, 0, 0), intensity=(50, 50, 50), cutoff=30)
    """

    __slots__ = ("__weakref__", "_state")

    def __init__(
        self,
        position: ArrayLike,
        target: ArrayLike,
        intensity: ArrayLike = (1.0, 1.0, 1.0),
        cutoff: float = 45.0,
    ) -> None:
        self._state = _SpotState(
            *_check_axis(position, target),
            intensity=as_color(intensity, "intensity"),
            cutoff=_as_cutoff(cutoff),
        )

    @property
    def position(self) -> NDArray[np.float64]:
        """Apex of the cone, scene units: read-only float64 of shape (3,)."""
        return self._state.position

    @position.setter
    def position(self, value: ArrayLike) -> None:
        self.set_geometry(position=value)

    @property
    def target(self) -> NDArray[np.float64]:
        """A point on the cone's axis, scene units: read-only float64 of shape (3,)."""
        return self._state.target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        self.set_geometry(target=value)

    def set_geometry(self, position: ArrayLike | None = None, target: ArrayLike | None = None) -> None:
        """Move the light: change `position`, `target` or both in one step.

        Raises
        ------
        SceneError
            If the two would be the same point; the light is then left as it was.
        """
        with CHANGE:
            state = self._state
            new = _check_axis(
                state.position if position is None else position, state.target if target is None else target
            )
            self._state = dataclasses.replace(state, position=new[0], target=new[1])

    @property
    def intensity(self) -> NDArray[np.float32]:
        """Radiant intensity, linear RGB, W·sr⁻¹: read-only float32 of shape (3,)."""
        return self._state.intensity

    @intensity.setter
    def intensity(self, value: ArrayLike) -> None:
        self._change(intensity=as_color(value, "intensity"))

    @property
    def cutoff(self) -> float:
        """Half-angle of the cone, degrees."""
        return self._state.cutoff

    @cutoff.setter
    def cutoff(self, value: float) -> None:
        self._change(cutoff=_as_cutoff(value))

    @property
    def direction(self) -> NDArray[np.float64]:
        """Unit vector along the axis, from `position` to `target`: float64 of shape (3,)."""
        return unit(self._state.target - self._state.position)

    def copy(self) -> SpotLight:
        """Return an independent light with the same values."""
        light = object.__new__(SpotLight)
        light._state = self._state
        return light

    def __repr__(self) -> str:
        state = self._state
        return (
            f"SpotLight(position={format_vector(state.position)}, target={format_vector(state.target)}, "
            f"intensity={format_color(state.intensity)}, cutoff={state.cutoff:g})"
        )

    def __getstate__(self) -> _SpotState:
        return self._state

    def __setstate__(self, state: _SpotState) -> None:
        for array in (state.position, state.target, state.intensity):
            array.flags.writeable = False
        self._state = state

    def _change(self, **changes: Any) -> None:
        with CHANGE:
            self._state = dataclasses.replace(self._state, **changes)

    def _core_light(self, name: str) -> _core.SpotLight:
        """Hand over the light as it is now."""
        from . import _core

        state = self._state
        return _core.SpotLight(
            name, xyz(state.position), xyz(state.target), rgb(state.intensity), state.cutoff
        )


def _check_axis(position: ArrayLike, target: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    apex, aim = as_vector(position, "position"), as_vector(target, "target")
    if not np.linalg.norm(aim - apex) > 1e-15 * max(1.0, float(np.abs(apex).max())):
        fail("target", aim, f"a point away from position, {format_vector(apex)}")
    return apex, aim


def _as_cutoff(value: float) -> float:
    return as_number(value, "cutoff", above=0.0, at_most=80.0, unit="degrees")
