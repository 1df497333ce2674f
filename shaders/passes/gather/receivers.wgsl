// The shading points of a range of pixels, in tile order. In: G-buffer. Out: receivers, and how many are active.

import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::ray::Receiver;
import package::common::receiver::{INACTIVE, inactive_receiver, pattern_of, receiver_of};
import package::common::tiles::pixel_in_tile_order;

struct ReceiversParams {
    width: u32,
    height: u32,
    first: u32,
    patterns: u32,
    seed: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ReceiversParams;
@group(0) @binding(1) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> receivers: array<Receiver>;
@group(0) @binding(5) var<storage, read_write> active_count: array<atomic<u32>>;

var<workgroup> active_here: atomic<u32>;

fn receiver(index: u32) -> Receiver {
    let pixel = pixel_in_tile_order(index, params.width);
    let at = pixel.y * params.width + pixel.x;
    if pixel.x >= params.width || pixel.y >= params.height || g_normal[at].w != SURFACE {
        return inactive_receiver();
    }
    let pattern = pattern_of(pixel, params.seed, params.patterns);
    return receiver_of(g_position[at], g_normal[at], g_geometric[at], pattern, at);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let made = receiver(params.first + i);
        receivers[i] = made;
        if made.pattern != INACTIVE {
            atomicAdd(&active_here, 1u);
        }
    }
    workgroupBarrier();
    if lane == 0u {
        atomicAdd(&active_count[0], atomicLoad(&active_here));
    }
}
