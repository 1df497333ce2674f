// Shadow maps of light samples: the distance to the first thing in each direction of a hemisphere, which a square holds
// by the octahedral map [CDE14].

import package::common::basis::tangents;

struct MapParams {
    normal: vec3f,      // of the light's lit side, or a spot's axis
    resolution: u32,    // texels along an edge
    sides: u32,         // 2: a second map of each sample looks the other way
    first: u32,         // map_rays: first texel of the list, of this light; map_shadow: first texel of this light
    samples: u32,       // that have maps: those of all interleaved sets
    offset: f32,        // how far off the light its rays start
}

// Nothing is there.
const FAR: f32 = 1e30;

// Middle of a texel as a unit direction about n.
fn map_direction(n: vec3f, texel: vec2u, resolution: u32) -> vec3f {
    let square = (vec2f(texel) + 0.5) / f32(resolution) * 2.0 - 1.0;
    let p = 0.5 * vec2f(square.x + square.y, square.x - square.y);
    let z = 1.0 - abs(p.x) - abs(p.y);
    return normalize(tangents(n) * p + n * z);
}

// The texel that a direction about n lies in, of any length; below the horizon the nearest.
fn map_texel(n: vec3f, d: vec3f, resolution: u32) -> vec2u {
    let t = tangents(n);
    let local = vec3f(dot(t[0], d), dot(t[1], d), max(dot(n, d), 0.0));
    let p = local.xy / max(abs(local.x) + abs(local.y) + local.z, 1e-30);
    let square = 0.5 * vec2f(p.x + p.y, p.x - p.y) + 0.5;
    return vec2u(clamp(vec2i(square * f32(resolution)), vec2i(0), vec2i(i32(resolution) - 1)));
}
