// Whether a texel is too rough to be one fragment, by the metrics of depth and normals.

import package::common::fragment::{ROUGH_DEPTH, ROUGH_NORMAL};
import package::common::gbuffer::floats;
import package::common::pyramid::{footprint, pyramid};
import package::common::view::View;

// Known beforehand, so that nothing is loaded for a metric that is not in use.
override DEPTH_METRIC: u32 = 0u;    // 0 none, 1 range, 2 derivative, 3 plane
override NORMAL_METRIC: u32 = 0u;   // 0 none, 1 component, 2 cone, 3 curvature

struct OnePassParams {
    depth_threshold: f32,
    normal_threshold: f32,
    lights: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: OnePassParams;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(6) var<storage, read> means: array<vec4u>;
@group(0) @binding(7) var<storage, read> ranges: array<vec4f>;
@group(0) @binding(8) var<storage, read> spreads: array<f32>;

// The chord between unit normals 2 sin(angle / 2) is what the normal metrics compare.
fn normal_change(slot: u32, width: f32) -> f32 {
    if NORMAL_METRIC == 2u {
        return sqrt(2.0 * spreads[2u * slot + 1u]);
    }
    if NORMAL_METRIC == 3u {
        return bitcast<f32>(means[3u * slot + 1u].w) * width;
    }
    let apart = ranges[2u * slot + 1u].xyz - ranges[2u * slot].xyz;
    return max(apart.x, max(apart.y, apart.z));
}

fn depth_change(slot: u32) -> f32 {
    if DEPTH_METRIC == 2u {
        return bitcast<f32>(means[3u * slot + 2u].w);
    }
    if DEPTH_METRIC == 3u {
        return spreads[2u * slot];
    }
    return ranges[2u * slot + 1u].w - ranges[2u * slot].w;
}

// Bits of the texel's state, of `level` from 1 on, its row in the pyramid `slot`.
fn roughness(level: u32, texel: vec2u, slot: u32) -> u32 {
    let pixels = footprint(level, texel);
    let surfaces = means[3u * slot].w;
    let depth = dot(view.eye - floats(means[3u * slot]), view.backward);
    let width = f32(1u << level) * pyramid.pixel_width * depth;
    let holes = surfaces < pixels.z * pixels.w;
    var state = 0u;
    if DEPTH_METRIC != 0u && (holes || depth_change(slot) > params.depth_threshold) {
        state |= ROUGH_DEPTH;
    }
    if NORMAL_METRIC != 0u && normal_change(slot, width) > params.normal_threshold {
        state |= ROUGH_NORMAL;
    }
    return state;
}
