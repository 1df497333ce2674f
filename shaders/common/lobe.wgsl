// The Phong lobe of a surface: specular (n + 2) / (2 pi) cos^n(mirror direction, direction to the light), whose integral
// over the hemisphere is at most `specular`, and equal to it at normal incidence [LW94].

import package::common::basis::PI;

// A row an instance: specular reflectance, and the exponent n.
@group(0) @binding(22) var<storage, read> instance_lobes: array<vec4f>;

// Direction in which a mirror with unit normal n would send what comes along the unit `view` direction from the eye.
fn mirrored(view: vec3f, n: vec3f) -> vec3f {
    return view - 2.0 * dot(view, n) * n;
}

// cos^n for a cosine of any sign; n = 0 is 1 in the whole upper half, as cos^0 is.
fn cos_power(cosine: f32, n: f32) -> f32 {
    return select(0.0, exp2(n * log2(max(cosine, 1e-30))), cosine > 0.0);
}

// The lobe in direction w, without the specular reflectance; r: the mirror direction, both unit.
fn lobe(r: vec3f, w: vec3f, n: f32) -> f32 {
    return (n + 2.0) / (2.0 * PI) * cos_power(dot(r, w), n);
}
