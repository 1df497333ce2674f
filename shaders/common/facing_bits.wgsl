// Which samples of a light face a shading point, a word of bits at a time.

import package::common::ray::Receiver;

struct ReuseParams {
    light_normal: vec3f,
    two_sided: u32,
    cone_axis: vec3f,
    cos_cutoff: f32,    // -1 and below: no cone
    first: u32,         // node of the first receiver
    strata: u32,        // samples that a node asks
    words: u32,         // at most 32
    reuse: u32,         // 0: every sample is asked
    corner: vec3f,      // of the light, or a spot's position
    classes: u32,       // interleaved sets of samples: 1 or 4
    edge_u: vec3f,
    together: u32,      // 1: sub-fragments ask one set, 0: each its own
    edge_v: vec3f,
    above: u32,         // first node of the level above
}

@group(0) @binding(0) var<uniform> params: ReuseParams;
@group(0) @binding(2) var<storage, read> points: array<vec4f>;

// True when the surface faces the sample and the light emits towards the surface, as in `shadow`.
fn faces(receiver: Receiver, point: vec4f) -> bool {
    let d = point.xyz - receiver.origin;
    let emits = (params.two_sided != 0u) | (dot(params.light_normal, d) < 0.0);
    let cone = (params.cos_cutoff <= -1.0) | (params.cos_cutoff * length(d) <= -dot(params.cone_axis, d));
    return emits & cone & (dot(receiver.normal_geo, d) > 0.0) & (dot(receiver.normal_shade, d) > 0.0);
}

fn behind(v: vec4f) -> vec2<bool> {
    return vec2<bool>(all(v <= vec4f(0.0)), any(v <= vec4f(0.0)));
}

// Whether the light as a whole faces the surface or is turned away from it: then so are all its samples.
//   x no sample faces it, y some may not
fn whole(receiver: Receiver) -> vec2<bool> {
    let d0 = params.corner - receiver.origin;
    let d1 = d0 + params.edge_u;
    let d2 = d0 + params.edge_v;
    let d3 = d1 + params.edge_v;
    let g = receiver.normal_geo;
    let s = receiver.normal_shade;
    let geo = behind(vec4f(dot(g, d0), dot(g, d1), dot(g, d2), dot(g, d3)));
    let shade = behind(vec4f(dot(s, d0), dot(s, d1), dot(s, d2), dot(s, d3)));
    // The same for all of the light, but for rounding.
    let emits = (params.two_sided != 0u) | (dot(params.light_normal, d0) < 0.0);
    return vec2<bool>(geo.x | shade.x | !emits, geo.y | shade.y | (params.cos_cutoff > -1.0) | !emits);
}

// Of one word: samples that face the surface. Only where the horizon cuts the light they are looked at one by one.
fn facing_bits(receiver: Receiver, word: u32, known: vec2<bool>) -> u32 {
    let row = receiver.pattern * params.strata + 32u * word;
    let count = min(params.strata - 32u * word, 32u);
    var bits = select(0xffffffffu >> (32u - count), 0u, known.y);
    for (var k = 0u; k < select(0u, count, known.y && !known.x); k++) {
        if faces(receiver, points[row + k]) {
            bits |= 1u << k;
        }
    }
    return bits;
}
