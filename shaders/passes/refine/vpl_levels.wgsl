// The partition of the image that the fragments of all virtual lights have in common: at each pixel the finest of theirs
// [NW09 Sec. 4.1], and why it was split.
// In: G-buffer, texel_state, masks of a batch. Out, in batches after the first also in: level_map, reason_map.

import package::common::fragment::{
    LEVEL_CULLED, LEVEL_NOTHING, REASON_COARSEST, REASON_DEPTH, REASON_EMITTER, REASON_ILLUMINATION, REASON_NORMAL,
    REASON_NOTHING, ROUGH_DEPTH, ROUGH_NORMAL,
};
import package::common::gbuffer::{NOTHING, SURFACE};
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::vpl_masks::{VplListsParams, mask_at};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplListsParams;
@group(0) @binding(1) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(2) var<storage, read> texel_state: array<u32>;
@group(0) @binding(3) var<storage, read> masks: array<u32>;
@group(0) @binding(4) var<storage, read_write> level_map: array<u32>;
@group(0) @binding(5) var<storage, read_write> reason_map: array<u32>;

// Whether the texel has handed virtual lights of the batch on.
fn hands_on(number: u32) -> bool {
    var left = 0u;
    for (var word = 0u; word < params.words; word++) {
        left |= masks[mask_at(params, number, word)];
    }
    return left != 0u;
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
    let pixel = texel_of(pyramid.levels[0], i);
    let kind = g_normal[i].w;
    var found = vec2u(pyramid.coarsest - 1u, REASON_COARSEST);
    // What a texel keeps lights its children.
    for (var level = pyramid.coarsest; level >= max(params.lowest, 2u); level--) {
        let number = texel_number(pyramid.levels[level], pixel >> vec2u(level));
        if !hands_on(number) {
            break;
        }
        let state = texel_state[number];
        let plain = select(REASON_ILLUMINATION, REASON_NORMAL, (state & ROUGH_NORMAL) != 0u);
        found = vec2u(level - 2u, select(plain, REASON_DEPTH, (state & ROUGH_DEPTH) != 0u));
    }
    if params.first != 0u && level_map[i] <= found.x {
        return;
    }
    let outside = select(vec2u(LEVEL_CULLED, REASON_EMITTER), vec2u(LEVEL_NOTHING, REASON_NOTHING), kind == NOTHING);
    let answer = select(outside, found, kind == SURFACE);
    level_map[i] = answer.x;
    reason_map[i] = answer.y;
}
