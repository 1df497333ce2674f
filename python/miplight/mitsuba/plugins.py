"""Plugins that Mitsuba lacks and an exact translation of a miplight scene needs.

``miplight_invisible_light``   a parallelogram that lights and is no surface (``AreaLight(visible=False)``)
``miplight_product``           the product of two textures (a base-colour image times vertex colours)
``miplight_pinhole``           any pinhole (fx, fy, cx, cy), each sample at its pixel's centre if asked to
``miplight_phong``             the energy-normalised Phong material (`miplight.mitsuba.phong`)

They are written against Mitsuba's public Python interface and work in every RGB variant.
"""

from __future__ import annotations

from typing import Any

from .phong import PHONG, phong

__all__ = ["INVISIBLE_LIGHT", "PHONG", "PINHOLE", "PRODUCT", "register"]

INVISIBLE_LIGHT = "miplight_invisible_light"
PINHOLE = "miplight_pinhole"
PRODUCT = "miplight_product"

_registered: set[str] = set()


def register(mi: Any) -> None:
    """Make the plugins known to the active variant of `mi`; a second call does nothing."""
    variant = mi.variant()
    if variant in _registered:
        return
    mi.register_emitter(INVISIBLE_LIGHT, _invisible_light(mi))
    mi.register_texture(PRODUCT, _product(mi))
    mi.register_sensor(PINHOLE, _pinhole(mi))
    mi.register_bsdf(PHONG, phong(mi))
    _registered.add(variant)


def _zeros(mi: Any, kind: Any) -> Any:
    """A record of zeros: scalar variants cannot make one by ``drjit.zeros``."""
    import drjit as dr

    return kind() if mi.variant().startswith("scalar") else dr.zeros(kind)


def _invisible_light(mi: Any) -> type:
    """Build the emitter class for the active variant.

    A point is taken uniformly on the parallelogram and answered as a position of its own (``delta``): emitter
    sampling alone reaches it, with weight one under multiple importance sampling, and no ray can hit it.
    The weight of a sample is L·cosθ·A/d²: the area form of the direct light integral.
    """
    import drjit as dr

    class InvisibleLight(mi.Emitter):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.corner = mi.ScalarPoint3f(props["corner"])
            self.edge_u = mi.ScalarVector3f(props["edge_u"])
            self.edge_v = mi.ScalarVector3f(props["edge_v"])
            cross = dr.cross(self.edge_u, self.edge_v)
            self.area = float(dr.norm(cross))
            self.normal = mi.ScalarNormal3f(cross / self.area)
            self.two_sided = bool(props.get("two_sided", False))
            self.radiance = props.get_emissive_texture("radiance")
            self.m_flags = mi.EmitterFlags.DeltaPosition
            self.m_needs_sample_2 = True

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            return _sample_parallelogram(mi, self, it, sample, active)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:  # noqa: ARG002
            return mi.Float(0.0)

        def eval(self, si: Any, active: Any = True) -> Any:  # noqa: ARG002
            return mi.Color3f(0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:  # noqa: ARG002
            return mi.Color3f(0.0)

        def bbox(self) -> Any:
            # no surface, so no bounds: an empty box leaves the scene's as they are
            return mi.ScalarBoundingBox3f()

        def traverse(self, callback: Any) -> None:
            callback.put("radiance", self.radiance, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"InvisibleLight[corner={self.corner}, edge_u={self.edge_u}, edge_v={self.edge_v}]"

    return InvisibleLight


def _sample_parallelogram(mi: Any, light: Any, it: Any, sample: Any, active: Any) -> tuple[Any, Any]:
    """Draw a point of the light for the interaction `it`: its direction sample and weight."""
    import drjit as dr

    corner, normal = mi.Point3f(light.corner), mi.Normal3f(light.normal)
    point = corner + sample.x * mi.Vector3f(light.edge_u) + sample.y * mi.Vector3f(light.edge_v)
    offset = point - it.p
    distance2 = dr.squared_norm(offset)
    distance = dr.sqrt(distance2)
    direction = offset / distance
    cosine = -dr.dot(direction, normal)
    if light.two_sided:
        cosine = dr.abs(cosine)
    active = mi.Mask(active) & (cosine > 0)
    ds = _zeros(mi, mi.DirectionSample3f)
    ds.p, ds.n, ds.uv, ds.time = point, normal, mi.Point2f(sample), it.time
    ds.d, ds.dist, ds.delta = direction, distance, mi.Bool(True)
    ds.pdf = dr.select(active, mi.Float(1.0), mi.Float(0.0))
    ds.emitter = light if mi.variant().startswith("scalar") else mi.EmitterPtr(light)
    si = _zeros(mi, mi.SurfaceInteraction3f)
    si.uv, si.time = mi.Point2f(sample), it.time
    weight = light.radiance.eval(si, active) * (light.area * cosine / distance2)
    return ds, dr.select(active, weight, mi.Color3f(0.0))


def _product(mi: Any) -> type:
    """Build the texture class for the active variant."""

    class Product(mi.Texture):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.first = props["first"]
            self.second = props["second"]

        def eval(self, si: Any, active: Any = True) -> Any:
            return self.first.eval(si, active) * self.second.eval(si, active)

        def eval_3(self, si: Any, active: Any = True) -> Any:
            return self.first.eval_3(si, active) * self.second.eval_3(si, active)

        def mean(self) -> Any:
            return self.first.mean() * self.second.mean()

        def max(self) -> Any:
            return self.first.max() * self.second.max()

        def is_spatially_varying(self) -> bool:
            return True

        def traverse(self, callback: Any) -> None:
            callback.put("first", self.first, mi.ParamFlags.Differentiable)
            callback.put("second", self.second, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"Product[{self.first}, {self.second}]"

    return Product


def _pinhole(mi: Any) -> type:
    """Build the sensor class for the active variant."""
    import drjit as dr

    class Pinhole(mi.Sensor):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.focal = mi.ScalarPoint2f(props["fx"], props["fy"])
            self.centre = mi.ScalarPoint2f(props["cx"], props["cy"])
            self.at_centre = bool(props.get("pixel_centre", False))
            pose = props["to_world"].matrix
            self.axes = [mi.ScalarVector3f(*(pose[row, column] for row in range(3))) for column in range(3)]
            self.position = mi.ScalarPoint3f(*(pose[row, 3] for row in range(3)))
            self.m_needs_sample_2 = True
            self.m_needs_sample_3 = False

        def sample_ray(
            self,
            time: Any,
            wavelength: Any,  # noqa: ARG002
            position: Any,
            aperture: Any,  # noqa: ARG002
            active: Any = True,  # noqa: ARG002
        ) -> tuple[Any, Any]:
            film = self.film()
            pixel = position * mi.ScalarVector2f(film.crop_size()) + mi.ScalarVector2f(film.crop_offset())
            if self.at_centre:
                pixel = dr.floor(pixel) + 0.5
            x = (pixel.x - self.centre.x) / self.focal.x
            y = (self.centre.y - pixel.y) / self.focal.y
            right, up, backward = (mi.Vector3f(axis) for axis in self.axes)
            ray = _zeros(mi, mi.Ray3f)
            ray.o = mi.Point3f(self.position)
            ray.d = dr.normalize(x * right + y * up - backward)
            ray.time = time
            ray.maxt = 3.4e38
            return ray, mi.Color3f(1.0)

        def sample_ray_differential(
            self, time: Any, wavelength: Any, position: Any, aperture: Any, active: Any = True
        ) -> tuple[Any, Any]:
            ray, weight = self.sample_ray(time, wavelength, position, aperture, active)
            return mi.RayDifferential3f(ray), weight

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f(self.position)

        def to_string(self) -> str:
            return f"Pinhole[focal={self.focal}, centre={self.centre}, pixel_centre={self.at_centre}]"

    return Pinhole
