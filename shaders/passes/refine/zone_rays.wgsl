// Zone rays: what the pixels in a penumbra ask of a light for themselves: strata of the blocks on which their cell's
// neighbourhood does not agree [NPW10: incremental visibility], as many as the plan of their cell says.
// In     the G-buffer, the light, traced_cells, cell_agreed, cell_plan. Out: receivers, four a cell; asked, WORDS each

import package::common::cells::{PLAN_SUBS_SHIFT, cell_corner, cell_place};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::list_params::ListParams;
import package::common::ray::Receiver;
import package::common::receiver::{inactive_receiver, pattern_of, receiver_of};
import package::common::strata::{WORDS, asked_by_plan};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(1) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read> traced_cells: array<u32>;
@group(0) @binding(5) var<storage, read> cell_agreed: array<u32>;
@group(0) @binding(6) var<storage, read> cell_plan: array<u32>;
@group(0) @binding(7) var<storage, read_write> receivers: array<Receiver>;
@group(0) @binding(8) var<storage, read_write> asked: array<u32>;

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
    let index = traced_cells[params.first + i / 4u];
    let pixel = cell_corner(cell_place(index, params.width), i % 4u);
    let inside = pixel.x < params.width && pixel.y < params.height;
    let at = select(0u, pixel.y * params.width + pixel.x, inside);
    let normal = g_normal[at];
    if inside && normal.w == SURFACE {
        let pattern = pattern_of(pixel, params.seed, params.patterns);
        receivers[i] = receiver_of(g_position[at], normal, g_geometric[at], pattern, at);
    } else {
        receivers[i] = inactive_receiver();
    }
    let agreed = cell_agreed[index];
    let subs = (cell_plan[index] >> PLAN_SUBS_SHIFT) & 31u;
    for (var word = 0u; word < WORDS; word++) {
        let low = asked_by_plan(agreed, subs, params.boosts, pixel, 2u * word);
        let high = asked_by_plan(agreed, subs, params.boosts, pixel, 2u * word + 1u);
        asked[i * WORDS + word] = low | (high << 16u);
    }
}
