// Virtual lights drawn as densely as flux is reflected [DS06]: stratified places in the unit square, warped down the levels
// of the tree [CJA05] to a texel each. One stands for its texel's flux over how many of the places fall there.
// In: nodes, texels. Out: the list.

import package::common::grid::{Grid, item_index};
import package::common::random::pcg4d;
import package::common::rsm::RSM_ROWS;
import package::common::virtual_light::{VirtualLight, from_morton, tree_level_first, tree_node};

struct VplImportanceParams {
    maps: u32,
    map: u32,
    count: u32,     // of the map
    first: u32,     // place of the map's first in the list
    finest: u32,    // level of the texels
    seed: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplImportanceParams;
@group(0) @binding(1) var<storage, read> nodes: array<VirtualLight>;
@group(0) @binding(2) var<storage, read_write> virtual_lights: array<VirtualLight>;

fn sum_of(v: vec3f) -> f32 {
    return v.x + v.y + v.z;
}

// Which half a place falls into, the share of the first being `share`; the place within the half.
struct Half {
    second: u32,
    place: f32,
}

fn half(place: f32, share: f32) -> Half {
    let second = place >= share;
    let low = select(0.0, share, second);
    let width = select(share, 1.0 - share, second);
    return Half(select(0u, 1u, second), min(max(place - low, 0.0) / max(width, 1e-30), 0.99999994));
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
    // Steps of the R2 sequence from a hashed start [Rob18], in 32-bit fixed point.
    let start = pcg4d(vec4u(params.map, 0u, 9u, params.seed)).xy;
    let bits = start + vec2u(3242174889u, 2447445414u) * i;
    var place = vec2f(bits >> vec2u(8u)) * (1.0 / 16777216.0);
    let whole = sum_of(nodes[tree_node(0u, params.maps, params.map, 0u)].flux);
    var morton = 0u;
    for (var level = 1u; level <= params.finest; level++) {
        let at = tree_node(level, params.maps, params.map, 4u * morton);
        let four = vec4f(
            sum_of(nodes[at].flux), sum_of(nodes[at + 1u].flux), sum_of(nodes[at + 2u].flux), sum_of(nodes[at + 3u].flux));
        let rows = vec2f(four.x + four.y, four.z + four.w);
        // A half without flux is never chosen.
        let down = half(place.y, select(select(rows.x / (rows.x + rows.y), 1.0, rows.y == 0.0), 0.0, rows.x == 0.0));
        let pair = select(four.xy, four.zw, down.second != 0u);
        let across = half(place.x, select(select(pair.x / (pair.x + pair.y), 1.0, pair.y == 0.0), 0.0, pair.x == 0.0));
        place = vec2f(across.place, down.place);
        morton = 4u * morton + 2u * down.second + across.second;
    }
    var light = nodes[tree_node(params.finest, params.maps, params.map, morton)];
    let expected = f32(params.count) * sum_of(light.flux) / max(whole, 1e-37);
    let share = select(0.0, 1.0 / expected, expected > 0.0);
    light.flux *= share;
    light.area *= share;
    light.solid_angle *= share;
    light.radius = sqrt(0.5 * light.area);
    // The block of its one texel is not what it stands for.
    light.extent &= 0xffff0000u;
    virtual_lights[params.first + i] = light;
}
