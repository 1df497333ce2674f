// Penumbra rays: one ray for each cell of the zone that does not see all of the light, towards a place that it does not
// see: what it meets first says how wide the penumbra is.
// In     the G-buffer, zone_cells, cell_bits, light_points. Out: rays, one a cell

import package::common::cells::{cell_corner, cell_place};
import package::common::grid::{Grid, item_index};
import package::common::list_params::ListParams;
import package::common::ray::{Ray, inactive_ray};
import package::common::receiver::{pattern_of, receiver_of};
import package::common::strata::{BLOCKS, STRATA, cell_pixel, cell_stratum, interleave};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> zone_cells: array<u32>;
@group(0) @binding(6) var<storage, read> cell_bits: array<u32>;
@group(0) @binding(7) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> rays: array<Ray>;

// A hidden block; from cell to cell another one first.
fn hidden_block(bits: u32, cell: vec2u) -> u32 {
    let hidden = (bits >> 16u) & ~bits & 0xffffu;
    let turn = interleave(cell);
    let turned = (hidden >> turn) | ((hidden << (16u - turn)) & 0xffffu);
    return select(BLOCKS, (firstTrailingBit(turned) + turn) & 15u, hidden != 0u);
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
    let index = zone_cells[params.first + i];
    let cell = cell_place(index, params.width);
    let block = hidden_block(cell_bits[index], cell);
    if block == BLOCKS {
        rays[i] = inactive_ray();
        return;
    }
    let pixel = cell_corner(cell, cell_pixel(block));
    let at = pixel.y * params.width + pixel.x;
    let pattern = pattern_of(pixel, params.seed, params.patterns);
    let r = receiver_of(g_position[at], g_normal[at], g_geometric[at], pattern, at);
    let point = light_points[pattern * STRATA + block * 16u + cell_stratum(cell, block)];
    rays[i] = Ray(r.origin, 0.0, point.xyz - r.origin, point.w);
}
