// Where refinement ended early, above the pixels: each pixel of a finest fragment takes the light of the nodes around it
// that lie on its own surface, by their distance in pixels [NPW10 Sec. 4.1: "edge-preserving bilateral filters"].
// In: nodes and their irradiance, level_map, G-buffer. In and out: irradiance a pixel.

import package::common::alike::alike;
import package::common::gbuffer::floats;
import package::common::grid::{Grid, item_index};
import package::common::nodes::{node_above, node_at};
import package::common::pyramid::{pyramid, texel_of};
import package::common::ray::Receiver;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<storage, read> level_map: array<u32>;
@group(0) @binding(1) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(5) var<storage, read> node_irradiance: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> direct_irradiance: array<vec4f>;

// Nodes that are asked, on each side of a pixel's own.
const REACH: i32 = 2;
// Of the Gaussian of distances, over the width of a fragment.
const DEVIATION: f32 = 0.6;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || level_map[i] != pyramid.finest {
        return;
    }
    let pixel = texel_of(pyramid.levels[0], i);
    let own = Receiver(floats(g_position[i]), 0u, floats(g_geometric[i]), 0u, floats(g_normal[i]), i);
    let size = pyramid.levels[pyramid.finest];
    let deviation = DEVIATION * f32(1u << pyramid.finest);
    var sum = vec4f(0.0);
    for (var k = 0; k < (2 * REACH + 1) * (2 * REACH + 1); k++) {
        let step = vec2i(k % (2 * REACH + 1), k / (2 * REACH + 1)) - REACH;
        let at = vec2i(pixel >> vec2u(pyramid.finest)) + step;
        // A negative column is a large one as well.
        if any(vec2u(at) >= size.xy) {
            continue;
        }
        let node = node_above(pyramid.finest, vec2u(at));
        if node == 0u || !alike(own, node_receivers[max(node, 1u) - 1u]) {
            continue;
        }
        let there = texel_of(pyramid.levels[0], node_receivers[node - 1u].pixel);
        let apart = (vec2f(there) - vec2f(pixel)) / deviation;
        sum += exp(-0.5 * dot(apart, apart)) * vec4f(node_irradiance[node - 1u].xyz, 1.0);
    }
    // What lies alone keeps the light of its fragment.
    if sum.w > 1e-12 {
        direct_irradiance[i] = vec4f(sum.xyz / sum.w, 0.0);
    }
}
