"""What a surface reflects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._vectors import format_vector
from .validate import as_color, as_color_or_image, as_number, fail, require

if TYPE_CHECKING:
    from . import _core

__all__ = ["DEFAULT_ALBEDO", "Material"]

DEFAULT_ALBEDO = (0.5, 0.5, 0.5)
"""Albedo of a surface that says nothing of its colour (Mitsuba's default, too)."""


class Material:
    """A diffuse surface with or without a Phong lobe; immutable, and shared freely between meshes.

    It reflects on both sides: the shading normal is turned towards the viewer, as by Mitsuba's ``twosided``.

    Parameters
    ----------
    albedo : array_like of float, (3,) or (h, w, 3), default (0.5, 0.5, 0.5)
        Diffuse reflectance, linear RGB in [0, 1]. An image is looked up at the mesh's UVs (bilinear,
        repeated; row 0 is the top, v = 1) and needs a mesh that has some. Integer arrays are refused:
        use ``ml.srgb_to_linear(uint8_image)``.
    specular : array_like of float, (3,), default (0, 0, 0)
        Reflectance of the energy-normalised Phong lobe specular·(n+2)/(2π)·cosⁿ(reflection, light);
        albedo + specular must not exceed 1 in any channel. The lobe lies about the mirror direction of the
        view, on the shading normal. It reflects what comes straight from the lights; light that was reflected
        before meets the diffuse part alone.
    shininess : float, default 32.0
        The lobe's exponent n, 0 or more.

    Raises
    ------
    SceneError
        For a wrong shape, integers, values outside [0, 1] or not finite, and for albedo + specular above 1.

    Examples
    --------
    >>> import miplight as ml
    >>> ml.Material(albedo=(0.8, 0.7, 0.6))
    Material(albedo=(0.8, 0.7, 0.6))
    """

    __slots__ = ("__weakref__", "_albedo", "_shininess", "_specular", "_texture")

    def __init__(
        self,
        albedo: ArrayLike = DEFAULT_ALBEDO,
        specular: ArrayLike = (0.0, 0.0, 0.0),
        shininess: float = 32.0,
    ) -> None:
        self._albedo = as_color_or_image(albedo, "albedo", maximum=1.0)
        self._specular = as_color(specular, "specular", maximum=1.0)
        self._shininess = as_number(shininess, "shininess", at_least=0.0)
        self._texture: _core.Texture | None = None
        total = self._albedo + self._specular
        # float32 rounds 0.7 + 0.3 up to 1.0000001: half a unit in the last place is no extra energy
        require(total <= 1.0 + 1e-6, "albedo + specular", total, "at most 1 in every channel")

    @property
    def albedo(self) -> NDArray[np.float32]:
        """Diffuse reflectance, linear RGB: read-only float32 of shape (3,) or (h, w, 3)."""
        return self._albedo

    @property
    def specular(self) -> NDArray[np.float32]:
        """Reflectance of the Phong lobe, linear RGB: read-only float32 of shape (3,)."""
        return self._specular

    @property
    def shininess(self) -> float:
        """Exponent of the Phong lobe."""
        return self._shininess

    @property
    def is_textured(self) -> bool:
        """Whether the albedo is an image, which needs a mesh with UVs."""
        return self._albedo.ndim == 3

    def replace(self, **changes: Any) -> Material:
        """Return a copy with some of `albedo`, `specular`, `shininess` changed (and checked again)."""
        values = {"albedo": self._albedo, "specular": self._specular, "shininess": self._shininess}
        unknown = sorted(set(changes) - set(values))
        if unknown:
            fail("Material.replace", ", ".join(unknown), "albedo, specular, shininess")
        return Material(**{**values, **changes})

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Material):
            return NotImplemented
        return self is other or (
            np.array_equal(self._albedo, other._albedo)
            and np.array_equal(self._specular, other._specular)
            and self._shininess == other._shininess
        )

    def __hash__(self) -> int:
        return hash(
            (
                self._albedo.shape,
                self._albedo.ravel()[:3].tobytes(),
                self._specular.tobytes(),
                self._shininess,
            )
        )

    def __repr__(self) -> str:
        if self.is_textured:
            height, width, _ = self._albedo.shape
            albedo = f"<{height}x{width} image>"
        else:
            albedo = format_vector(self._albedo)
        if not self._specular.any():
            return f"Material(albedo={albedo})"
        specular = format_vector(self._specular)
        return f"Material(albedo={albedo}, specular={specular}, shininess={self._shininess:g})"

    def __reduce__(self) -> tuple[Any, ...]:
        return Material, (np.array(self._albedo), np.array(self._specular), self._shininess)

    def __copy__(self) -> Material:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Material:
        return self

    def _core_texture(self) -> _core.Texture | None:
        """Return the image on the core's side: made once, shared by every mesh of this material."""
        if self.is_textured and self._texture is None:
            from . import _core

            self._texture = _core.Texture(self._albedo)
        return self._texture

    def _core_lobe(self) -> tuple[float, float, float, float]:
        """Return the specular reflectance and the exponent of the lobe."""
        red, green, blue = (float(c) for c in self._specular)
        return (red, green, blue, float(self._shininess))

    def _core_albedo(self) -> tuple[float, float, float]:
        """Return the constant factor of the albedo: white where an image carries the colour."""
        if self.is_textured:
            return (1.0, 1.0, 1.0)
        red, green, blue = (float(c) for c in self._albedo)
        return (red, green, blue)
