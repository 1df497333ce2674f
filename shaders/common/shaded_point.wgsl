// A point that the eye sees, and what it reflects of a virtual light: irradiance, and the radiance of its lobe.
//   E = flux share,   S = specular f(w) E,   f the Phong lobe about the mirror direction [LW94; NW09 Sec. 4.1]

import package::common::form_factor::{Lit, disc_irradiance};
import package::common::gbuffer::floats;
import package::common::lobe::{lobe, mirrored};
import package::common::surface::offset_origin;

struct ShadedPoint {
    origin: vec3f,
    exponent: f32,      // of the lobe
    normal_shade: vec3f,
    red: f32,           // of what the lobe reflects
    normal_geo: vec3f,
    green: f32,
    mirror: vec3f,
    blue: f32,
}

// How a virtual light is told: the first rows of its record; flux.w: what one of its differences may be.
struct ShortLight {
    place: vec4f,
    facing: vec4f,
    flux: vec4f,
}

fn shaded_point(position: vec4u, normal: vec4u, geometric: vec4u, surface: vec4f, eye: vec3f) -> ShadedPoint {
    let normal_geo = floats(geometric);
    let origin = offset_origin(floats(position), normal_geo, bitcast<f32>(position.w));
    let mirror = mirrored(normalize(origin - eye), floats(normal));
    return ShadedPoint(origin, surface.w, floats(normal), surface.x, normal_geo, surface.y, mirror, surface.z);
}

// What faces no light.
fn no_point() -> ShadedPoint {
    return ShadedPoint(vec3f(0.0), 0.0, vec3f(0.0), 0.0, vec3f(0.0), 0.0, vec3f(0.0), 0.0);
}

fn specular_of(p: ShadedPoint) -> vec3f {
    return vec3f(p.red, p.green, p.blue);
}

// Irradiance a unit of flux, and the lobe times it.
fn shares(p: ShadedPoint, light: ShortLight, disc: bool, reach: f32, glossy: bool) -> vec2f {
    let at = Lit(p.origin, p.normal_shade, p.normal_geo);
    let share = disc_irradiance(at, light.place, light.facing, vec3f(1.0), disc, reach).x;
    if !glossy {
        return vec2f(share, 0.0);
    }
    let w = normalize(light.place.xyz - p.origin);
    return vec2f(share, select(0.0, share * lobe(p.mirror, w, p.exponent), share > 0.0));
}
