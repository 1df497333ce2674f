"""The energy-normalised Phong material as a Mitsuba BSDF; Mitsuba has none of its own.

``miplight_phong`` reflects f = ρ/π + ρₛ (n + 2)/(2π) max(0, cos α)ⁿ, α the angle between the outgoing
direction and the mirror direction of the incident one about the shading normal. It is zero below the surface;
`to_dict` puts ``twosided`` around it, as around ``diffuse``. Its parameters:

``diffuse_reflectance``    ρ, a texture, default 0.5
``specular_reflectance``   ρₛ, a texture, default 0.2
``shininess``              n, a float of 0 or more, default 32

A direction is drawn from the cosine or from the whole lobe, in proportion to the mean of the two reflectances
at the point, and weighted by the density of both; what the lobe draws below the horizon is lost and has no
weight.
"""

from __future__ import annotations

from typing import Any

__all__ = ["DEFAULT_SHININESS", "PHONG", "phong"]

PHONG = "miplight_phong"
DEFAULT_SHININESS = 32.0


def phong(mi: Any) -> type:
    """Build the BSDF class for the active variant of `mi`."""
    is_scalar = mi.variant().startswith("scalar")
    diffuse_flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
    glossy_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide

    class Phong(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.diffuse = props.get_texture("diffuse_reflectance", 0.5)
            self.specular = props.get_texture("specular_reflectance", 0.2)
            self.shininess = float(props.get("shininess", DEFAULT_SHININESS))
            if not self.shininess >= 0.0:
                raise ValueError(f"shininess is {self.shininess}; allowed: 0 or more")
            self.m_components = [diffuse_flags, glossy_flags]
            self.m_flags = diffuse_flags | glossy_flags

        def sample(
            self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            import drjit as dr

            share = _glossy_share(mi, self, ctx, si, active)
            is_glossy = sample1 < share
            cosine = mi.warp.square_to_cosine_hemisphere(sample2)
            wo = dr.select(is_glossy, _lobe_direction(mi, self.shininess, si.wi, sample2), cosine)
            value, pdf = self.eval_pdf(ctx, si, wo, active)
            active = mi.Mask(active) & (pdf > 0)
            bs = mi.BSDFSample3f() if is_scalar else dr.zeros(mi.BSDFSample3f)
            bs.wo, bs.pdf, bs.eta = wo, pdf, mi.Float(1.0)
            kinds = [mi.UInt32(int(kind)) for kind in (glossy_flags, diffuse_flags)]
            bs.sampled_type = dr.select(is_glossy, *kinds)
            bs.sampled_component = dr.select(is_glossy, mi.UInt32(1), mi.UInt32(0))
            weight = dr.select(active, value / dr.select(active, pdf, mi.Float(1.0)), mi.Color3f(0.0))
            return bs, weight

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return _value_and_density(mi, self, ctx, si, wo, active)

        def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
            return self.diffuse.eval(si, active)

        def traverse(self, callback: Any) -> None:
            callback.put("diffuse_reflectance", self.diffuse, mi.ParamFlags.Differentiable)
            callback.put("specular_reflectance", self.specular, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return (
                f"Phong[diffuse_reflectance={self.diffuse}, specular_reflectance={self.specular}, "
                f"shininess={self.shininess}]"
            )

    return Phong


def _reflectances(mi: Any, bsdf: Any, ctx: Any, si: Any, active: Any) -> tuple[Any, Any]:
    """ρ and ρₛ at the point, black where `ctx` leaves the component out."""
    diffuse = specular = mi.Color3f(0.0)
    if ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, 0):
        diffuse = mi.Color3f(bsdf.diffuse.eval(si, active))
    if ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 1):
        specular = mi.Color3f(bsdf.specular.eval(si, active))
    return diffuse, specular


def _share(mi: Any, diffuse: Any, specular: Any) -> Any:
    """Probability of the lobe; any would do for a black surface."""
    import drjit as dr

    glossy, total = dr.mean(specular), dr.mean(diffuse) + dr.mean(specular)
    lit = total > 0
    return dr.select(lit, glossy / dr.select(lit, total, mi.Float(1.0)), mi.Float(0.0))


def _glossy_share(mi: Any, bsdf: Any, ctx: Any, si: Any, active: Any) -> Any:
    return _share(mi, *_reflectances(mi, bsdf, ctx, si, active))


def _lobe_direction(mi: Any, shininess: float, wi: Any, sample: Any) -> Any:
    """A direction with the density (n + 1)/(2π) cosⁿα about the mirror direction of `wi`."""
    import drjit as dr

    cosine = dr.power(1.0 - sample.y, 1.0 / (shininess + 1.0))
    sine = dr.sqrt(dr.maximum(1.0 - cosine * cosine, 0.0))
    angle = 2.0 * dr.pi * sample.x
    local = mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), cosine)
    return mi.Frame3f(_mirrored(mi, wi)).to_world(local)


def _mirrored(mi: Any, wi: Any) -> Any:
    return mi.Vector3f(-wi.x, -wi.y, wi.z)


def _value_and_density(mi: Any, bsdf: Any, ctx: Any, si: Any, wo: Any, active: Any) -> tuple[Any, Any]:
    """Return f cosθ and the density of `sample`, both zero below the surface."""
    import drjit as dr

    diffuse, specular = _reflectances(mi, bsdf, ctx, si, active)
    cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
    active = mi.Mask(active) & (cos_i > 0) & (cos_o > 0)
    cos_lobe = dr.dot(_mirrored(mi, si.wi), wo)
    inside = cos_lobe > 0
    n = bsdf.shininess
    power = dr.select(inside, dr.power(dr.select(inside, cos_lobe, mi.Float(1.0)), n), mi.Float(0.0))
    value = (diffuse / dr.pi + specular * ((n + 2.0) / (2.0 * dr.pi) * power)) * cos_o
    share = _share(mi, diffuse, specular)
    lobe_pdf = (n + 1.0) / (2.0 * dr.pi) * power
    pdf = dr.lerp(cos_o / dr.pi, lobe_pdf, share)
    return dr.select(active, value, mi.Color3f(0.0)), dr.select(active, pdf, mi.Float(0.0))
