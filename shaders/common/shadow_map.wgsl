// Shadow maps of light samples: the distance to the first thing in each direction of a hemisphere, which a square holds
// by the octahedral map [CDE14]; of a spot in the frustum about its cone [NW09; NSW09].

import package::common::basis::tangents;

struct MapParams {
    normal: vec3f,      // of the light's lit side, or a spot's axis
    resolution: u32,    // texels along an edge
    sides: u32,         // 2: a second map of each sample looks the other way
    first: u32,         // map_rays: first texel of the list, of this light; map_shadow: first texel of this light
    samples: u32,       // that have maps: those of all interleaved sets
    offset: f32,        // how far off the light its rays start
    tan_half: f32,      // half of the frustum's width at distance 1; 0: a hemisphere
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// Nothing is there.
const FAR: f32 = 1e30;
// Width of a texel of a hemisphere as an angle times the resolution: the square root of its solid angle.
const HEMISPHERE: f32 = 2.5066283;

// Middle of a texel as a unit direction about n.
fn map_direction(map: MapParams, n: vec3f, texel: vec2u) -> vec3f {
    let square = (vec2f(texel) + 0.5) / f32(map.resolution) * 2.0 - 1.0;
    let turned = 0.5 * vec2f(square.x + square.y, square.x - square.y);
    let octahedron = vec3f(turned, 1.0 - abs(turned.x) - abs(turned.y));
    let frustum = vec3f(map.tan_half * square, 1.0);
    let local = select(octahedron, frustum, map.tan_half > 0.0);
    return normalize(tangents(n) * local.xy + n * local.z);
}

// The texel that a direction about n lies in, of any length; of one outside of the map the nearest.
fn map_texel(map: MapParams, n: vec3f, d: vec3f) -> vec2u {
    let t = tangents(n);
    let local = vec3f(dot(t[0], d), dot(t[1], d), max(dot(n, d), 0.0));
    let p = local.xy / max(abs(local.x) + abs(local.y) + local.z, 1e-30);
    let frustum = clamp(local.xy / max(map.tan_half * local.z, 1e-30), vec2f(-2.0), vec2f(2.0));
    let square = 0.5 * select(vec2f(p.x + p.y, p.x - p.y), frustum, map.tan_half > 0.0) + 0.5;
    return vec2u(clamp(vec2i(square * f32(map.resolution)), vec2i(0), vec2i(i32(map.resolution) - 1)));
}

// Width of a texel as an angle, at most.
fn texel_angle(map: MapParams) -> f32 {
    return select(HEMISPHERE, 2.0 * map.tan_half, map.tan_half > 0.0) / f32(map.resolution);
}
