// The nodes of a level: of the coarsest every texel that a light may reach, of the others the children of split nodes
// [NPW10 Sec. 3.4; Deviation: lists in place of a stencil, so that only what was split is looked at].
//   roots     which texels of the coarsest level are nodes
//   children  which of the four children of each split node are
//   main      writes the nodes of a list, and their shading points: the surface pixel nearest to the middle
// In: texel_state, G-buffer, nodes of the level above. Out: node_flags; node_rows, node_at, node_receivers.

import package::common::fragment::{LIT, ROUGH};
import package::common::grid::{Grid, item_index};
import package::common::middle_pixel::{g_normal, middle_pixel};
import package::common::nodes::{AGAIN, SKIPS, SPLIT, class_of, node_at, node_rows};
import package::common::pyramid::{footprint, pyramid, texel_number, texel_of};
import package::common::ray::Receiver;
import package::common::receiver::{pattern_of, receiver_of};

struct NodesParams {
    base: u32,          // first node of this level
    parents: u32,       // first node of the level above
    patterns: u32,
    classes: u32,       // interleaved sets of samples: 1 or 4
    seed: u32,
    inherit: u32,       // 1: pixels use the sample points of the node above
    pad1: u32,
    pad2: u32,
}

const NO_PARENT: u32 = 0xffffffffu;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: NodesParams;
@group(0) @binding(1) var<storage, read> texel_state: array<u32>;
@group(0) @binding(2) var<storage, read_write> node_flags: array<u32>;
@group(0) @binding(3) var<storage, read> node_list: array<u32>;
@group(0) @binding(4) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(6) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(7) var<storage, read_write> node_receivers: array<Receiver>;

@compute @workgroup_size(64)
fn roots(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        node_flags[i] = texel_state[pyramid.levels[pyramid.level].z + i] & LIT;
    }
}

// Texel of entry i of a list of this level, which has four places for each node of the level above.
fn texel_at(i: u32) -> vec2u {
    if pyramid.level == pyramid.coarsest {
        return texel_of(pyramid.levels[pyramid.level], i);
    }
    let above = pyramid.levels[pyramid.level + 1u];
    let parent = texel_of(above, node_rows[params.parents + i / 4u].x - above.z);
    return 2u * parent + vec2u(i & 1u, (i >> 1u) & 1u);
}

@compute @workgroup_size(64)
fn children(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    var flag = 0u;
    let size = pyramid.levels[pyramid.level];
    if (node_rows[params.parents + i / 4u].z & SPLIT) != 0u {
        let texel = texel_at(i);
        if all(texel < size.xy) {
            flag = texel_state[texel_number(size, texel)] & LIT;
        }
    }
    node_flags[i] = flag;
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
    let entry = node_list[i];
    let size = pyramid.levels[pyramid.level];
    let texel = texel_at(entry);
    let number = texel_number(size, texel);
    let node = params.base + i;
    let pixel = middle_pixel(footprint(pyramid.level, texel));
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    let root = pyramid.level == pyramid.coarsest;
    let parent = select(params.parents + entry / 4u, NO_PARENT, root);
    // Nothing splits what is of the finest level.
    let above = node_rows[select(parent, node, root)].z;
    let skips = select(0u, SKIPS, !root && (above & (AGAIN << (entry & 3u))) != 0u);
    let state = select((texel_state[number] & ROUGH) | skips, 0u, pyramid.level == pyramid.finest);
    node_rows[node] = vec4u(number, at, state, parent);
    node_at[number] = node + 1u;
    var pattern = pattern_of(pixel, params.seed, params.patterns) * params.classes + class_of(texel, params.classes);
    if params.inherit != 0u && pyramid.level == 0u && !root {
        pattern = node_receivers[parent].pattern;
    }
    node_receivers[node] = receiver_of(g_position[at], g_normal[at], g_geometric[at], pattern, at);
}
