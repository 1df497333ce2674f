// Refinement by a list [NW09 Sec. 3.3]: of the coarsest texels those that are rough are split in four, of these the rough
// ones again, until none is, or the finest level is reached. What is never listed is never tested; the fragments are those
// of one_pass. Deviation: a list is compacted from the flags of its level, in the order of the texels.
//   begin  which texels of the coarsest level may be lit
//   split  tests the listed texels of `pyramid.level`, and flags the children of rough ones down to above the finest level
// In: pyramid, list. In and out: texel_state; flags of the next list.

import package::common::fragment::LIT;
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::rough_texel::{OnePassParams, means, params, ranges, roughness, spreads, view};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(9) var<storage, read_write> texel_state: array<u32>;
@group(0) @binding(10) var<storage, read_write> listed: array<u32>;
@group(0) @binding(11) var<storage, read> list: array<u32>;
@group(0) @binding(12) var<storage, read> arguments: array<u32>;

@compute @workgroup_size(64)
fn begin(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        listed[i] = texel_state[pyramid.levels[pyramid.coarsest].z + i] & LIT;
    }
}

@compute @workgroup_size(64)
fn split(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= arguments[3] {
        return;
    }
    let size = pyramid.levels[pyramid.level];
    let texel = texel_of(size, list[i]);
    let number = size.z + list[i];
    let state = roughness(pyramid.level, texel, number - pyramid.levels[1].z);
    texel_state[number] |= state;
    if state == 0u || pyramid.level <= pyramid.finest + 1u {
        return;
    }
    let below = pyramid.levels[pyramid.level - 1u];
    for (var k = 0u; k < 4u; k++) {
        let child = 2u * texel + vec2u(k & 1u, k >> 1u);
        if all(child < below.xy) {
            let at = texel_number(below, child);
            listed[at - below.z] = texel_state[at] & LIT;
        }
    }
}
