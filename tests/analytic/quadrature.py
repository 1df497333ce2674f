"""Irradiance of an area light by Gauss-Legendre quadrature in float64: independent of any closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import miplight as ml

Array = NDArray[np.float64]

POINTS = 10  # of each panel and direction


def graded(middle: float, width: float) -> Array:
    """Ends of panels over [0, 1] that double in size away from `middle`, the first of them `width` wide."""
    steps = width * 2.0 ** np.arange(-1, 40)
    ends = np.concatenate([[0.0, 1.0, middle], middle + steps, middle - steps])
    panels: Array = np.unique(np.clip(ends, 0.0, 1.0))
    return panels


def nodes(panels: Array) -> tuple[Array, Array]:
    """Abscissae and weights of a rule over all panels."""
    x, w = np.polynomial.legendre.leggauss(POINTS)
    half = np.diff(panels)[:, None] / 2
    return (panels[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()


def irradiance_at(light: ml.AreaLight, point: Array, normal: Array) -> float:
    """Irradiance from radiance 1, ∫ cos θ_s cos θ_l / d² dA; no horizon may cross the light.

    The panels are graded towards the foot of the perpendicular, so that a light that all but touches the
    point is integrated as well as one far away.
    """
    u, v, n = light.edge_u, light.edge_v, light.normal
    height = abs(float((point - light.corner) @ n))
    gram = np.array([[u @ u, u @ v], [u @ v, v @ v]])
    foot = np.linalg.solve(gram, [(point - light.corner) @ u, (point - light.corner) @ v])
    (a, wa), (b, wb) = (
        nodes(graded(float(f), max(height, 1e-9) / float(np.linalg.norm(e))))
        for f, e in zip(foot, (u, v), strict=True)
    )
    offset = light.corner + a[:, None, None] * u + b[None, :, None] * v - point
    squared = (offset**2).sum(axis=-1)
    integrand = np.maximum(offset @ normal, 0.0) * np.abs(offset @ n) / squared**2
    area = float(np.linalg.norm(np.cross(u, v)))
    return float(np.einsum("i,j,ij->", wa, wb, integrand)) * area


def irradiance(light: ml.AreaLight, points: Array, normal: Array) -> Array:
    """The same at (n, 3) points, zero where a one-sided light does not shine: (n,)."""
    lit = (points - light.corner) @ light.normal > 0
    return np.array(
        [
            irradiance_at(light, point, normal) if shines or light.two_sided else 0.0
            for point, shines in zip(points, lit, strict=True)
        ]
    )
