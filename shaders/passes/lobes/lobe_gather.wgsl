// What the lobe of each fragment reflects of one area light, without its colour:
//   sum    over the visible samples of the light, where many lie in the lobe; else over the places in it
//   apply  adds colour times light to the pixels
// In: receivers, bits of the samples, lobe_weights, lobe_seen. In and out: lobe_fragments, specular_radiance.

import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::lobe::{instance_lobes, lobe, mirrored};
import package::common::ray::Receiver;
import package::common::view::View;

struct LobeGatherParams {
    first: u32,         // fragment of item 0
    strata: u32,
    words: u32,         // 0: everything is seen
    two_sided: u32,
    normal: vec3f,      // of the lit side
    places: u32,        // in a lobe
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: LobeGatherParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> points: array<vec4f>;
@group(0) @binding(4) var<storage, read> light_radiance: array<vec4f>;
@group(0) @binding(5) var<storage, read> asked: array<u32>;
@group(0) @binding(6) var<storage, read> lobe_weights: array<vec4f>;
@group(0) @binding(7) var<storage, read> lobe_seen: array<f32>;
@group(0) @binding(8) var<storage, read_write> lobe_fragments: array<vec4f>;

// From the light's samples that the fragment sees.
fn by_samples(i: u32, at: Receiver) -> vec3f {
    let mirror = mirrored(normalize(at.origin - view.eye), at.normal_shade);
    let n = bitcast<f32>(at.flags);
    var sum = vec3f(0.0);
    for (var k = 0u; k < params.strata; k++) {
        let seen = ((asked[i * params.words + k / 32u] >> (k % 32u)) & 1u) != 0u;
        let d = points[at.pattern * params.strata + k].xyz - at.origin;
        let d2 = dot(d, d);
        let w = d * inverseSqrt(d2);
        let cos_s = dot(at.normal_shade, w);
        let away = -dot(params.normal, w);
        let cos_l = select(away, abs(away), params.two_sided != 0u);
        if seen && cos_s > 0.0 && cos_l > 0.0 && dot(at.normal_geo, w) > 0.0 && d2 > 0.0 {
            sum += light_radiance[k].xyz * (lobe(mirror, w, n) * cos_s * cos_l / d2);
        }
    }
    return sum;
}

@compute @workgroup_size(64)
fn sum(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    var light = vec3f(0.0);
    if lobe_weights[i * params.places].w == 0.0 {
        light = by_samples(i, receivers[params.first + i]);
    } else {
        for (var k = 0u; k < params.places; k++) {
            light += lobe_seen[i * params.places + k] * lobe_weights[i * params.places + k].xyz;
        }
    }
    lobe_fragments[params.first + i] += vec4f(light, 0.0);
}

@group(0) @binding(9) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(10) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(11) var<storage, read> lobe_image: array<vec4f>;
@group(0) @binding(12) var<storage, read_write> specular_radiance: array<vec4f>;

@compute @workgroup_size(64)
fn apply(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end && g_normal[i].w == SURFACE {
        let color = instance_lobes[g_albedo[i].w].xyz;
        specular_radiance[i] += vec4f(color * lobe_image[i].xyz, 0.0);
    }
}
