// One cut through the tree of virtual lights for all fragments [NSW09 Sec. 3.4]: nodes as large as hold no discontinuity of
// depth or normals. Deviation: the text starts from dense points and discards those that a larger cluster holds; here
// nodes are chosen, so that a cluster is the mean of what it stands for and energy is the same for every cut.
//   mark  which nodes are in the cut
//   pack  their records, one after the other
// In: nodes, ranges; the list of those in the cut. Out: flags; the packed list.

import package::common::grid::{Grid, item_index};
import package::common::rsm::RSM_FAR;
import package::common::virtual_light::{VirtualLight, tree_level_first};

struct VplClustersParams {
    maps: u32,
    coarsest: u32,
    finest: u32,
    metric: u32,                // 0 plane, 1 range
    depth_threshold: f32,       // negative: never refuses
    normal_threshold: f32,
    first: u32,                 // number of the first node of the coarsest level
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplClustersParams;
@group(0) @binding(1) var<storage, read> nodes: array<VirtualLight>;
@group(0) @binding(2) var<storage, read> ranges: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> in_cut: array<u32>;
@group(0) @binding(4) var<storage, read> chosen: array<u32>;
@group(0) @binding(5) var<storage, read_write> virtual_lights: array<VirtualLight>;

fn is_clean(at: u32) -> bool {
    let node = nodes[at];
    let lo = ranges[2u * at];
    let hi = ranges[2u * at + 1u];
    let component = max(hi.x - lo.x, max(hi.y - lo.y, hi.z - lo.z));
    let by_range = params.metric == 1u;
    let depth = select(node.thickness > params.depth_threshold * node.radius, hi.w - lo.w > params.depth_threshold, by_range);
    // Where some of its texels see no surface, or one that reflects nothing, a silhouette lies in the node.
    let torn = hi.w >= RSM_FAR;
    let turned = select(node.spread, component, by_range) > params.normal_threshold;
    return !(((depth | torn) & (params.depth_threshold >= 0.0)) | (turned & (params.normal_threshold >= 0.0)));
}

@compute @workgroup_size(64)
fn mark(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let at = params.first + i;
    var level = params.coarsest;
    while level < params.finest && at >= tree_level_first(level + 1u, params.maps) {
        level++;
    }
    var number = at - tree_level_first(level, params.maps);
    let flux = nodes[at].flux;
    var chosen_here = any(flux > vec3f(0.0)) && (level == params.finest || is_clean(at));
    while level > params.coarsest && chosen_here {
        level--;
        number >>= 2u;
        chosen_here = !is_clean(tree_level_first(level, params.maps) + number);
    }
    in_cut[i] = select(0u, 1u, chosen_here);
}

@compute @workgroup_size(64)
fn pack(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        virtual_lights[i] = nodes[params.first + chosen[i]];
    }
}
