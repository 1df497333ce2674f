// Cell rays: what the pixels of open tiles ask of a light, so that each cell of 2 x 2 pixels asks each block of strata
// once [KJ16: a stratum is a bit; Deviation: four pixels share the strata, so that none of them goes unasked].
// In     the G-buffer, the light, open_tiles. Out: receivers, 64 a tile, cell after cell; asked: WORDS words each
//        (area lights), one word each (spots)

import package::common::cells::{TILE_CELLS, cell_corner, cell_place};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::light::{SPOT, light_at, lights};
import package::common::light_facing::facing_of;
import package::common::light_frame::LightFrame;
import package::common::list_params::ListParams;
import package::common::ray::Receiver;
import package::common::receiver::{inactive_receiver, pattern_of, receiver_of};
import package::common::strata::{BLOCKS, WORDS, cell_pixel, cell_stratum};
import package::common::tiles::TILE_PIXELS;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(1) var<uniform> frame: LightFrame;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> open_tiles: array<u32>;
@group(0) @binding(6) var<storage, read_write> receivers: array<Receiver>;
@group(0) @binding(7) var<storage, read_write> asked: array<u32>;

// Cell of thread `i`, in cells of the image.
fn cell_of(i: u32) -> vec2u {
    let tile = open_tiles[params.first + i / TILE_PIXELS];
    return cell_place(tile * TILE_CELLS + (i % TILE_PIXELS) / 4u, params.width);
}

fn receiver_at(pixel: vec2u) -> Receiver {
    let inside = pixel.x < params.width && pixel.y < params.height;
    let at = select(0u, pixel.y * params.width + pixel.x, inside);
    let normal = g_normal[at];
    if !inside || normal.w != SURFACE {
        return inactive_receiver();
    }
    let pattern = pattern_of(pixel, params.seed, params.patterns);
    let r = receiver_of(g_position[at], normal, g_geometric[at], pattern, at);
    if !facing_of(light_at(params.light), frame, r.origin, r.normal_geo, r.normal_shade).facing {
        return inactive_receiver();
    }
    return r;
}

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
    let cell = cell_of(i);
    receivers[i] = receiver_at(cell_corner(cell, i % 4u));
    for (var word = 0u; word < WORDS; word++) {
        var bits = 0u;
        for (var half = 0u; half < 2u; half++) {
            let block = 2u * word + half;
            let bit = (1u << cell_stratum(cell, block)) << (16u * half);
            bits |= select(0u, bit, cell_pixel(block) == i % 4u);
        }
        asked[i * WORDS + word] = bits;
    }
}

@compute @workgroup_size(64)
fn spot(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    receivers[i] = receiver_at(cell_corner(cell_of(i), i % 4u));
    asked[i] = 1u;
}
