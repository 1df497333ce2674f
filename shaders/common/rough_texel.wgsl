// Whether a texel is too rough to be one fragment, by the metrics of depth and normals.

import package::common::fragment::{ROUGH_DEPTH, ROUGH_NORMAL};
import package::common::gbuffer::floats;
import package::common::pyramid::{footprint, pyramid};
import package::common::view::View;

struct OnePassParams {
    depth_threshold: f32,
    normal_threshold: f32,
    depth_metric: u32,      // 0 none, 1 range, 2 derivative, 3 plane
    normal_metric: u32,     // 0 none, 1 component, 2 cone, 3 curvature
    lights: u32,
    all_lit: u32,           // 1: no light culls anything
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: OnePassParams;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(6) var<storage, read> means: array<vec4u>;
@group(0) @binding(7) var<storage, read> ranges: array<vec4f>;
@group(0) @binding(8) var<storage, read> spreads: array<f32>;

// The chord between unit normals 2 sin(angle / 2) is what the normal metrics compare.
fn normal_change(slot: u32, width: f32) -> f32 {
    let apart = ranges[2u * slot + 1u].xyz - ranges[2u * slot].xyz;
    let component = max(apart.x, max(apart.y, apart.z));
    let cone = sqrt(2.0 * spreads[2u * slot + 1u]);
    let curvature = bitcast<f32>(means[3u * slot + 1u].w) * width;
    return select(select(component, cone, params.normal_metric == 2u), curvature, params.normal_metric == 3u);
}

fn depth_change(slot: u32) -> f32 {
    let range = ranges[2u * slot + 1u].w - ranges[2u * slot].w;
    let slope = bitcast<f32>(means[3u * slot + 2u].w);
    return select(select(range, slope, params.depth_metric == 2u), spreads[2u * slot], params.depth_metric == 3u);
}

// Bits of the texel's state, of `level` from 1 on, its row in the pyramid `slot`.
fn roughness(level: u32, texel: vec2u, slot: u32) -> u32 {
    let pixels = footprint(level, texel);
    let surfaces = means[3u * slot].w;
    let depth = dot(view.eye - floats(means[3u * slot]), view.backward);
    let width = f32(1u << level) * pyramid.pixel_width * depth;
    let holes = surfaces < pixels.z * pixels.w;
    var state = 0u;
    if params.depth_metric != 0u && (holes || depth_change(slot) > params.depth_threshold) {
        state |= ROUGH_DEPTH;
    }
    if params.normal_metric != 0u && normal_change(slot, width) > params.normal_threshold {
        state |= ROUGH_NORMAL;
    }
    return state;
}
