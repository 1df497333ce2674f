// Virtual lights of clusters as large as depth and normals allow [NSW09 Sec. 3.4; Deviation: a cut through the tree over
// the maps, not points of a grid that are discarded one by one, so that every texel with flux is in one cluster]. A node
// is taken when it is clean or of the finest level, and none above it is clean. Deviation: all of those are asked, not
// the parent alone, because a metric relative to the cluster's size may be clean above and rough below.
//   judge   which nodes have flux, and which are clean
//   choose  which are taken
//   pack    their records, in the order of the list
// In: nodes, ranges, chosen_list. Out: states, chosen, vpls. Items are nodes from params.first on.

import package::common::grid::{Grid, item_index};
import package::common::rsm::RSM_FAR;
import package::common::virtual_light::{VirtualLight, tree_level_first, tree_node};

struct VplClustersParams {
    first: u32,             // node of the list
    maps: u32,
    first_spot: u32,        // map; those of area lights come before
    by_range: u32,          // 1: metric "range", 0: "plane"
    coarsest_area: u32,     // levels
    finest_area: u32,
    coarsest_spot: u32,
    finest_spot: u32,
    depth_threshold: f32,   // RSM_FAR: none
    normal_threshold: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplClustersParams;
@group(0) @binding(1) var<storage, read> nodes: array<VirtualLight>;
@group(0) @binding(2) var<storage, read> ranges: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> states: array<u32>;
@group(0) @binding(4) var<storage, read_write> chosen: array<u32>;
@group(0) @binding(5) var<storage, read> chosen_list: array<u32>;
@group(0) @binding(6) var<storage, read_write> vpls: array<VirtualLight>;

const LIT: u32 = 1u;
const CLEAN: u32 = 2u;

@compute @workgroup_size(64)
fn judge(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let node = params.first + item;
    let light = nodes[node];
    let least = ranges[2u * node];
    let largest = ranges[2u * node + 1u];
    // Where a surface ends and nothing is behind it, depth is as rough as can be.
    let hole = largest.w >= RSM_FAR && params.depth_threshold < RSM_FAR;
    let apart = largest - least;
    let by_plane = light.thickness > params.depth_threshold * light.radius || light.spread > params.normal_threshold;
    let normal_range = max(apart.x, max(apart.y, apart.z));
    let by_range = apart.w > params.depth_threshold || normal_range > params.normal_threshold;
    let rough = hole || select(by_plane, by_range, params.by_range != 0u);
    let lit = light.flux.x + light.flux.y + light.flux.z > 0.0;
    states[item] = select(0u, LIT, lit) | select(CLEAN, 0u, rough);
}

@compute @workgroup_size(64)
fn choose(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let node = params.first + item;
    var level = min(params.coarsest_area, params.coarsest_spot);
    while node >= tree_level_first(level + 1u, params.maps) {
        level++;
    }
    let within = node - tree_level_first(level, params.maps);
    let map = within >> (2u * level);
    let morton = within & ((1u << (2u * level)) - 1u);
    let spot = map >= params.first_spot;
    let coarsest = select(params.coarsest_area, params.coarsest_spot, spot);
    let finest = select(params.finest_area, params.finest_spot, spot);
    let state = states[item];
    let last = (state & CLEAN) != 0u || level == finest;
    var taken = level >= coarsest && level <= finest && (state & LIT) != 0u && last;
    for (var above = coarsest; above < level; above++) {
        let number = tree_node(above, params.maps, map, morton >> (2u * (level - above)));
        taken = taken && (states[number - params.first] & CLEAN) == 0u;
    }
    chosen[item] = select(0u, 1u, taken);
}

@compute @workgroup_size(64)
fn pack(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item < grid.end {
        vpls[item] = nodes[params.first + chosen_list[item]];
    }
}
