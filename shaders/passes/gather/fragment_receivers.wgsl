// The shading point of each fragment: its surface pixel nearest to its middle. In: G-buffer, list of fragments.
// Out: receivers, whose `pixel` is the fragment's number in the list; fragment_at.

import package::common::grid::{Grid, item_index};
import package::common::middle_pixel::{g_normal, middle_pixel};
import package::common::pyramid::{footprint, pyramid, texel_number};
import package::common::ray::Receiver;
import package::common::receiver::{pattern_of, receiver_of};
import package::common::tiles::pixel_in_tile_order;

struct FragmentReceiversParams {
    first: u32,
    patterns: u32,
    seed: u32,
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: FragmentReceiversParams;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> fragment_list: array<u32>;
@group(0) @binding(6) var<storage, read> fragment_flags: array<u32>;
@group(0) @binding(7) var<storage, read_write> receivers: array<Receiver>;
@group(0) @binding(8) var<storage, read_write> fragment_at: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let fragment = params.first + i;
    let place = fragment_list[fragment];
    let level = (fragment_flags[place] & 255u) - 1u;
    let texel = pixel_in_tile_order(place, pyramid.levels[0].x) >> vec2u(level);
    let pixel = middle_pixel(footprint(level, texel));
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    let pattern = pattern_of(pixel, params.seed, params.patterns);
    receivers[i] = receiver_of(g_position[at], g_normal[at], g_geometric[at], pattern, fragment);
    fragment_at[texel_number(pyramid.levels[level], texel)] = fragment + 1u;
}
