// Virtual lights as dense as the flux that a map's texels reflect [DS06], by warping points down the levels of the tree
// over it [CJAM05; Deviation: the points are an R2 sequence [Rob18], so that they are stratified for every number].
// In: nodes. Out: vpls, map by map.

import package::common::grid::{Grid, item_index};
import package::common::random::pcg4d;
import package::common::virtual_light::{VirtualLight, tree_child, tree_node};

struct VplImportanceParams {
    count: u32,     // lights a map
    maps: u32,
    finest: u32,    // level of texels
    seed: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplImportanceParams;
@group(0) @binding(1) var<storage, read> nodes: array<VirtualLight>;
@group(0) @binding(2) var<storage, read_write> vpls: array<VirtualLight>;

// The largest number below 1.
const BELOW_ONE: f32 = 0.99999994;

fn weight(node: u32) -> f32 {
    let flux = nodes[node].flux;
    return flux.x + flux.y + flux.z;
}

// Steps of the R2 sequence from a hashed start, in 32-bit fixed point so that no precision is lost.
fn point(map: u32, i: u32) -> vec2f {
    let start = pcg4d(vec4u(map, 0u, 2u, params.seed)).xy;
    return vec2f((start + vec2u(3242174889u, 2447445414u) * i) >> vec2u(8u)) * (1.0 / 16777216.0);
}

// Which half x in [0, 1) falls into when the first has `share` of the weight, and where in that half it is.
fn halved(x: f32, share: f32) -> vec2f {
    let second = x >= share;
    let within = select(x / share, (x - share) / (1.0 - share), second);
    return vec2f(select(0.0, 1.0, second), clamp(within, 0.0, BELOW_ONE));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let map = item / params.count;
    let root = tree_node(0u, params.maps, map, 0u);
    let whole = weight(root);
    var light = nodes[root];
    light.block = 0u;
    light.extent = map << 16u;
    if whole > 0.0 {
        var place = point(map, item % params.count);
        var node = root;
        for (var level = 0u; level < params.finest; level++) {
            let first = tree_child(level, params.maps, node);
            let w = vec4f(weight(first), weight(first + 1u), weight(first + 2u), weight(first + 3u));
            // Rows, then columns; what has no weight is never chosen.
            let y = halved(place.y, (w.x + w.y) / (w.x + w.y + w.z + w.w));
            let row = select(w.xy, w.zw, y.x > 0.0);
            let x = halved(place.x, row.x / (row.x + row.y));
            place = vec2f(x.y, y.y);
            node = first + u32(x.x) + 2u * u32(y.x);
        }
        light = nodes[node];
        // One over the count times the texel's probability. The area and the solid angle that a light stands for are at
        // most the map's.
        let share = whole / (f32(params.count) * weight(node));
        let spread_over = min(share, exp2(f32(2u * params.finest)));
        light.flux *= share;
        light.area *= spread_over;
        light.solid_angle *= spread_over;
        light.radius = sqrt(0.5 * light.area);
        light.extent = map << 16u;
    }
    vpls[item] = light;
}
