"""Phong lobes and what they reflect of a light, in float64, by plain sums over the whole light."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .lights import Area
from .structs import record

Array = NDArray[np.float64]

LOBE_LIGHT = np.dtype(
    [
        ("corner", "<f4", 3),
        ("two_sided", "<u4"),
        ("edge_u", "<f4", 3),
        ("area", "<f4"),
        ("edge_v", "<f4", 3),
        ("light", "<u4"),
        ("normal", "<f4", 3),
        ("seed", "<u4"),
        ("dual_u", "<f4", 3),
        ("columns", "<u4"),
        ("dual_v", "<f4", 3),
        ("rows", "<u4"),
        ("radiance", "<f4", 3),
        ("side", "<u4"),
        ("least", "<f4"),
        ("pad", "<u4", 3),
    ]
)


@dataclasses.dataclass
class Glossy:
    """Shading points that look at one eye, one row each."""

    position: Array
    normal: Array
    geometric: Array
    color: Array
    exponent: Array
    eye: Array

    @property
    def mirror(self) -> Array:
        """Directions in which a mirror would send what comes from the eye."""
        along = self.position - self.eye
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        turned: Array = along - 2 * (along * self.normal).sum(1, keepdims=True) * self.normal
        return turned


def lobe_light(light: Area, side: int = 8) -> NDArray[Any]:
    """The uniform of a light with a picture; `side`: samples along each axis of a patch."""
    picture = light.radiance
    normal = light.normal
    across_v, across_u = np.cross(light.v, normal), np.cross(normal, light.u)
    return record(
        LOBE_LIGHT,
        corner=light.corner,
        two_sided=light.two_sided,
        edge_u=light.u,
        area=light.area,
        edge_v=light.v,
        normal=normal,
        dual_u=across_v / (light.u @ across_v),
        dual_v=across_u / (light.v @ across_u),
        rows=picture.shape[0],
        columns=picture.shape[1],
        radiance=picture.mean((0, 1)),
        seed=3,
        side=side,
        least=1e-4,
    )


def sums(light: Area) -> NDArray[np.float32]:
    """Sums of the light's picture less its mean left of and below each corner, from the bottom."""
    picture = light.radiance
    flat = picture[::-1] - picture.mean((0, 1))
    table = np.zeros((picture.shape[0] + 1, picture.shape[1] + 1, 4))
    table[1:, 1:, :3] = flat.cumsum(0).cumsum(1)
    return table.reshape(-1, 4).astype(np.float32)


def adds(light: Area, points: Glossy, ab: Array) -> Array:
    """What a unit of (a, b) at each place of `ab` (n, m, 2) sends to the eye, without colour and radiance."""
    d = light.point(ab) - points.position[:, None]
    far = np.linalg.norm(d, axis=-1)
    w = d / far[..., None]
    cos_l = -(w @ light.normal)
    cos_l = np.abs(cos_l) if light.two_sided else np.clip(cos_l, 0, None)
    cos_s = np.clip((w * points.normal[:, None]).sum(-1), 0, None)
    above = (w * points.geometric[:, None]).sum(-1) > 0
    cosine = (w * points.mirror[:, None]).sum(-1)
    n = points.exponent[:, None]
    lobe = (n + 2) / (2 * np.pi) * np.where(cosine > 0, np.clip(cosine, 1e-300, None) ** n, 0)
    found: Array = np.where(above, lobe * cos_s * cos_l / far**2 * light.area, 0)
    return found


def reflected(light: Area, points: Glossy, side: int = 140) -> Array:
    """Radiance to the eye by a sum over side × side places, (n, 3)."""
    middles = (np.arange(side) + 0.5) / side
    b, a = np.meshgrid(middles, middles, indexing="ij")
    ab = np.stack([a.ravel(), b.ravel()], -1)
    radiance = light.emitted(ab)
    out = [adds(light, one(points, i), ab[None])[0] @ radiance / side**2 for i in range(len(points.position))]
    return points.color * np.array(out)


def one(points: Glossy, i: int) -> Glossy:
    """Point i alone."""
    rows = {f.name: getattr(points, f.name)[i : i + 1] for f in dataclasses.fields(points) if f.name != "eye"}
    return Glossy(**rows, eye=points.eye)
