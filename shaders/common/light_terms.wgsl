// What samples of a light that are dealt to interleaved sets add to a shading point, when they are seen:
//   L_k A/N cos_s cos_l / d^2   [NPW10 Eq. 2; Deviation: N samples, radiance L, A(y_k) = A/N]

import package::common::ray::Receiver;

// Interleaved samples in the middle of their strata: where they are follows from the loop, the same for all threads; else
// they are looked up.
override GRID: bool = false;
// One radiance for all samples.
override CONSTANT: bool = false;

struct InterleavedParams {
    first: u32,         // node of item 0
    strata: u32,        // samples that a node asks
    words: u32,         // 0: everything is seen
    classes: u32,       // sets of samples: 1 or 4
    normal: vec3f,      // of the lit side, or a spot's axis
    cos_cutoff: f32,    // of a spot; -2 for an area light
    corner: vec3f,      // of the light; of a spot its position
    two_sided: u32,
    step_u: vec3f,      // from stratum to stratum
    row: u32,           // samples of a set along a row of the light
    step_v: vec3f,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: InterleavedParams;
@group(0) @binding(4) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(5) var<storage, read> light_radiance: array<vec4f>;

// What a sample at `point` adds when it is seen.
fn term(at: Receiver, point: vec3f) -> f32 {
    let d = point - at.origin;
    let d2 = dot(d, d);
    // The unit vector first: powers of d overflow and underflow sooner than its cosines.
    let w = d * inverseSqrt(d2);
    let cos_geo = dot(at.normal_geo, w);
    let cos_s = dot(at.normal_shade, w);
    var cos_l = -dot(params.normal, w);
    if params.cos_cutoff >= -1.0 {
        cos_l = select(0.0, 1.0, cos_l >= params.cos_cutoff);
    } else if params.two_sided != 0u {
        cos_l = abs(cos_l);
    }
    let counts = cos_geo > 0.0 && cos_s > 0.0 && cos_l > 0.0 && d2 > 0.0;
    return select(0.0, cos_s * cos_l / d2, counts);
}

// A light as a node sees it: vectors from the node to its first sample and from sample to sample, and their products with
// both normals, (geometric, shading). Lengths are shares of what lies between node and light, so that none of their powers
// overflows.
struct Seen {
    first: vec3f,
    along_u: vec3f,
    along_v: vec3f,
    cos_first: vec2f,
    cos_u: vec2f,
    cos_v: vec2f,
    height: f32,        // of the node over the light's plane, on a side that emits
    scale: f32,
}

fn products(at: Receiver, v: vec3f) -> vec2f {
    return vec2f(dot(at.normal_geo, v), dot(at.normal_shade, v));
}

fn light_from(at: Receiver) -> Seen {
    let far = params.corner - at.origin;
    let scale = 1.0 / (length(far) + f32(params.row) * length(params.step_u) + length(params.step_v));
    let u = params.step_u * scale;
    let v = params.step_v * scale;
    let first = far * scale + 0.5 * (u + v);
    let height = -dot(params.normal, first);
    let emitting = select(height, abs(height), params.two_sided != 0u);
    return Seen(first, u, v, products(at, first), products(at, u), products(at, v), emitting, scale);
}

// The same as `term` for the sample in a column and a row of the light, over the square of the scale.
fn grid_term(s: Seen, cell: vec2f) -> f32 {
    let d = s.first + cell.x * s.along_u + cell.y * s.along_v;
    let cosines = s.cos_first + cell.x * s.cos_u + cell.y * s.cos_v;
    let d2 = dot(d, d);
    let near = 1.0 / d2;
    let counts = cosines.x > 0.0 && cosines.y > 0.0 && s.height > 0.0 && d2 > 0.0;
    return select(0.0, (cosines.y * near) * (s.height * near), counts);
}

// Sample of set `set_` in a column and row of that set: what it adds, without a radiance that all share.
fn sample_of(at: Receiver, s: Seen, first: u32, j: u32, place: vec2f, set_: u32) -> vec3f {
    let sample = set_ * params.strata + j;
    var weight = 0.0;
    if GRID {
        weight = grid_term(s, place + vec2f(vec2u(set_ & 1u, set_ >> 1u)));
    } else {
        weight = term(at, light_points[first + sample].xyz);
    }
    if CONSTANT {
        return vec3f(weight);
    }
    return weight * light_radiance[sample].xyz;
}

// Column and row of the next sample of a set.
fn after(place: vec2f) -> vec2f {
    return select(vec2f(place.x + 2.0, place.y), vec2f(0.0, place.y + 2.0), place.x + 2.0 == 2.0 * f32(params.row));
}

// All sets at one place, each by its share.
fn samples_of(at: Receiver, s: Seen, first: u32, j: u32, place: vec2f, shares: vec4f) -> vec3f {
    var sum = shares.x * sample_of(at, s, first, j, place, 0u);
    if params.classes == 4u {
        sum += shares.y * sample_of(at, s, first, j, place, 1u);
        sum += shares.z * sample_of(at, s, first, j, place, 2u);
        sum += shares.w * sample_of(at, s, first, j, place, 3u);
    }
    return sum;
}
