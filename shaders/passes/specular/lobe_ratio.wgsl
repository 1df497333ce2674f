// Each pixel's lobe light times the share of it that is seen: L += L_lobe S, S = sum V w / sum w over the strata of the
// patch, w what each adds, its picture's mean included, colour by colour [HHM18, for a lobe]. Where every sample is seen, or everything, S has no noise.
//   shares  S of the pixels of a list
//   main    adds lobe light times S, S averaged over 3 x 3 pixels of one surface where it is a fraction
// In: lists, occluded bits of the rays and what each adds, lobe_light, G-buffer. Out: lobe_share. In and out: specular_radiance.

import package::common::alike::alike;
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::lobe_patch::source;
import package::common::ray::Receiver;
import package::common::tiles::pixel_in_tile_order;
import package::common::view::View;

// Whether anything hides the light; if not, lobe_share is not read.
override SHADOWED: bool = true;
// Samples along each axis of a patch.
override SIDE: u32 = 8;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> lobe_surface: array<vec4f>;
@group(0) @binding(6) var<storage, read> lobe_list: array<u32>;
@group(0) @binding(7) var<storage, read> occluded: array<u32>;
@group(0) @binding(11) var<storage, read> lobe_weights: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> lobe_share: array<vec4f>;
@group(0) @binding(9) var<storage, read> lobe_light: array<vec4f>;
@group(0) @binding(10) var<storage, read_write> specular_radiance: array<vec4f>;

@compute @workgroup_size(64)
fn shares(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let samples = source.side * source.side;
    let pixel = pixel_in_tile_order(lobe_list[i], view.width);
    var all_ = vec3f(0.0);
    var seen = vec3f(0.0);
    for (var k = 0u; k < samples; k++) {
        let bit = i * samples + k;
        let weight = lobe_weights[bit].xyz;
        let hidden = ((occluded[bit / 32u] >> (bit % 32u)) & 1u) != 0u;
        all_ += weight;
        seen += select(weight, vec3f(0.0), hidden);
    }
    let share = select(vec3f(1.0), seen / max(all_, vec3f(1e-30)), all_ > vec3f(0.0));
    lobe_share[pixel.y * view.width + pixel.x] = vec4f(share, 1.0);
}

fn receiver(at: u32) -> Receiver {
    return Receiver(floats(g_position[at]), 0u, floats(g_geometric[at]), 0u, floats(g_normal[at]), at);
}

// No further from the pixel's own than its samples may be off.
fn smooth_share(pixel: vec2u, at: u32) -> vec3f {
    let own = lobe_share[at].xyz;
    if all(own <= vec3f(0.0)) || all(own >= vec3f(1.0)) {
        return own;
    }
    let here = receiver(at);
    var sum = vec4f(4.0 * own, 4.0);
    for (var k = 0u; k < 9u; k++) {
        let there = vec2i(pixel) + vec2i(i32(k % 3u), i32(k / 3u)) - 1;
        let inside = all(vec2u(there) < vec2u(view.width, view.height)) && k != 4u;
        let other = select(at, u32(there.y) * view.width + u32(there.x), inside);
        let weight = (2.0 - abs(f32(k % 3u) - 1.0)) * (2.0 - abs(f32(k / 3u) - 1.0));
        let counts = inside && g_normal[other].w == SURFACE && lobe_light[other].w != 0.0
            && all(lobe_surface[other] == lobe_surface[at]);
        if counts && alike(here, receiver(other)) {
            sum += weight * vec4f(lobe_share[other].xyz, 1.0);
        }
    }
    let deviation = sqrt(max(own * (vec3f(1.0) - own), vec3f(0.0))) / (0.5 * pow(f32(SIDE), 1.5));
    return clamp(sum.xyz / sum.w, own - deviation, own + deviation);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || lobe_light[i].w == 0.0 {
        return;
    }
    var share = vec3f(1.0);
    if SHADOWED {
        share = smooth_share(vec2u(i % view.width, i / view.width), i);
    }
    specular_radiance[i] += vec4f(share * lobe_light[i].xyz, 0.0);
}
