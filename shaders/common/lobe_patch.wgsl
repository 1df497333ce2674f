// The part of a light that a lobe reaches, and how it is integrated over: in the light's own coordinates (a, b) a
// rectangle around the place that the mirror direction meets. Nodes and samples are drawn together about that place by a
// sinh, as for nearly singular integrals [JE05], so that a lobe of any width, near or far, is as smooth to them.

import package::common::gbuffer::floats;
import package::common::lobe::{lobe, mirrored};

struct LobeLight {
    corner: vec3f,      // scene space
    two_sided: u32,
    edge_u: vec3f,
    area: f32,
    edge_v: vec3f,
    light: u32,         // its number in the table
    normal: vec3f,      // of the lit side
    seed: u32,
    dual_u: vec3f,      // in the plane: a = dual_u . (p - corner)
    columns: u32,       // of its picture; 0: one radiance
    dual_v: vec3f,
    rows: u32,
    radiance: vec3f,    // mean
    side: u32,          // samples along each axis of a patch
    least: f32,         // what is left of the lobe at the border of its patch
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> source: LobeLight;

// A shading point with a lobe.
struct Glossy {
    origin: vec3f,
    n: f32,             // exponent
    mirror: vec3f,
    color: vec3f,
    shading: vec3f,
    geometric: vec3f,
}

struct Patch {
    lo: vec2f,          // lo >= hi: the lobe does not reach the light
    hi: vec2f,
    peak: vec2f,
    scale: vec2f,
}

// `surface`: specular reflectance and exponent.
fn glossy_at(position: vec4u, normal: vec4u, geometric: vec4u, surface: vec4f, eye: vec3f) -> Glossy {
    let p = floats(position);
    let mirror = mirrored(normalize(p - eye), floats(normal));
    return Glossy(p, surface.w, mirror, surface.xyz, floats(normal), floats(geometric));
}

// Whether any of the light lies above the plane through the origin with normal n.
fn rises(c: vec3f, n: vec3f) -> bool {
    return dot(n, c) + max(dot(n, source.edge_u), 0.0) + max(dot(n, source.edge_v), 0.0) > 0.0;
}

// Where along one axis the cone about the mirror direction meets the light's plane. Planes through the origin that touch
// the cone have normals m = h e - l L with |m . R| = |m| sin t: a quadratic in l whose roots are the ends.
fn ends(e: vec3f, c: vec3f, h: f32, k: f32, sin2: f32, mirror: vec3f) -> vec2f {
    let across = dot(e, mirror);
    let a = k * k - sin2;
    let b = h * across * k;
    let root = sqrt(max(b * b - a * h * h * (across * across - sin2 * dot(e, e)), 0.0));
    let shift = dot(e, c);
    return clamp(vec2f(b - root, b + root) / a - shift, vec2f(0.0), vec2f(1.0));
}

fn patch_of(at: Glossy) -> Patch {
    let c = source.corner - at.origin;
    let h = dot(source.normal, c);
    let k = dot(source.normal, at.mirror);
    let cos_t = exp2(log2(source.least) / max(at.n, 1e-3));
    let sin2 = 1.0 - cos_t * cos_t;
    var found = Patch(vec2f(0.0), vec2f(1.0), vec2f(0.0), vec2f(0.0));
    // A cone that lies whole on one side of the plane's horizon cuts an ellipse.
    let ellipse = k * k > 1.02 * sin2;
    if ellipse {
        let u = ends(source.dual_u, c, h, k, sin2, at.mirror);
        let v = ends(source.dual_v, c, h, k, sin2, at.mirror);
        found.lo = vec2f(u.x, v.x);
        found.hi = vec2f(u.y, v.y);
    }
    let lit = (h < 0.0 || source.two_sided != 0u) && h != 0.0;
    let ahead = !ellipse || k * h > 0.0;
    if !lit || !ahead || !rises(c, at.shading) || !rises(c, at.geometric) || all(at.color == vec3f(0.0)) {
        found.hi = found.lo;
        return found;
    }
    // Where the mirror direction meets the plane, or far ahead where it does not.
    let size = length(source.edge_u) + length(source.edge_v);
    let far = select(4.0 * (size + length(c)), h / k, k * h > 1e-4 * abs(h));
    let meets = far * at.mirror - c;
    found.peak = clamp(vec2f(dot(source.dual_u, meets), dot(source.dual_v, meets)), found.lo, found.hi);
    let there = c + found.peak.x * source.edge_u + found.peak.y * source.edge_v;
    // Twice the lobe's deviation at that distance, but no wider than the distance.
    let width = length(there) * min(1.4 * inverseSqrt(at.n + 1.0), 1.0);
    found.scale = width * vec2f(length(source.dual_u), length(source.dual_v));
    return found;
}

// One half of one axis: from the peak to an end.
struct Half {
    from_: f32,
    scale: f32,         // towards lower numbers negative
    turn: f32,
}

fn half_of(peak: f32, end: f32, scale: f32) -> Half {
    let ratio = abs(end - peak) / max(scale, 1e-20);
    // asinh, without cancellation for small ratios
    let turn = select(log(ratio + sqrt(ratio * ratio + 1.0)), ratio, ratio < 1e-3);
    return Half(peak, select(-scale, scale, end > peak), turn);
}

// Place of y in [0, 1], and the derivative there.
fn place(half: Half, y: f32) -> vec2f {
    let up = exp(y * half.turn);
    let down = 1.0 / up;
    let rise = select(0.5 * (up - down), y * half.turn, half.turn < 1e-3);
    return vec2f(half.from_ + half.scale * rise, abs(half.scale) * half.turn * 0.5 * (up + down));
}

// Radiance that the lobe sends to the eye from a unit of (a, b) at that place, without colour and radiance of the light.
fn integrand(at: Glossy, ab: vec2f) -> f32 {
    let d = source.corner + ab.x * source.edge_u + ab.y * source.edge_v - at.origin;
    let d2 = dot(d, d);
    let w = d * inverseSqrt(d2);
    let cos_s = dot(at.shading, w);
    let away = -dot(source.normal, w);
    let cos_l = select(away, abs(away), source.two_sided != 0u);
    let seen = cos_s > 0.0 && cos_l > 0.0 && dot(at.geometric, w) > 0.0 && d2 > 0.0;
    return select(0.0, lobe(at.mirror, w, at.n) * cos_s * cos_l / d2 * source.area, seen);
}

// A whole axis of the patch: both halves, one after the other, as their turns are long.
struct Axis {
    below: Half,
    above: Half,
}

fn axis_of(found: Patch, axis: u32) -> Axis {
    return Axis(
        half_of(found.peak[axis], found.lo[axis], found.scale[axis]),
        half_of(found.peak[axis], found.hi[axis], found.scale[axis]),
    );
}

// Place and derivative at t in [0, 1].
fn along(axis: Axis, t: f32) -> vec2f {
    let whole = axis.below.turn + axis.above.turn;
    let turn = t * whole - axis.below.turn;
    let left = turn < 0.0;
    let half = Half(
        axis.below.from_,
        select(axis.above.scale, axis.below.scale, left),
        select(axis.above.turn, axis.below.turn, left),
    );
    let put = place(half, abs(turn) / max(half.turn, 1e-20));
    return vec2f(put.x, put.y * whole / max(half.turn, 1e-20));
}
