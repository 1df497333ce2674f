// Virtual lights of all sizes: the tree over the texels of each map [NSW09 Sec. 3.5], every bound in it conservative.
// Deviation: a node is the mean by flux of what is below it, not a point sample of it, and knows how far that reaches.
//   leaves  one node for each texel
//   reduce  the nodes of level `params.level` from those below
// In: texels, maps. In and out: nodes; ranges, two rows a node: xyz least normal, w least distance from the light | xyz largest
// normal, w largest distance. Texels without flux count for the solid angle, and for nothing else; where some of a node's
// texels in the light's cone have none, its largest distance is RSM_FAR.

import package::common::grid::{Grid, item_index};
import package::common::rsm::{RSM_FAR, RSM_ROWS, RsmMap};
import package::common::virtual_light::{VirtualLight, from_morton, tree_child, tree_level_first};

struct RsmTreeParams {
    maps: u32,
    level: u32,
    finest: u32,    // level of the texels
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: RsmTreeParams;
@group(0) @binding(1) var<storage, read> rsm_texels: array<vec4f>;
@group(0) @binding(4) var<storage, read> maps: array<RsmMap>;
@group(0) @binding(2) var<storage, read_write> nodes: array<VirtualLight>;
@group(0) @binding(3) var<storage, read_write> ranges: array<vec4f>;

// A mean normal shorter than this has no direction: the normals cancel.
const NO_NORMAL: f32 = 1e-6;
// From this difference of unit normals on, 30 degrees, the child with most flux stands for a node.
const MOST_TILT: f32 = 0.5;
// Roundings of a few sums.
const SLACK: f32 = 1.000001;

fn sum_of(v: vec3f) -> f32 {
    return v.x + v.y + v.z;
}

// Block and extent of the node with this number in its level.
fn block_of(number: u32, level: u32) -> vec2u {
    let width = 1u << (params.finest - level);
    let map = number >> (2u * level);
    let first = width * from_morton(number & ((1u << (2u * level)) - 1u));
    return vec2u(first.x | (first.y << 16u), width | (map << 16u));
}

@compute @workgroup_size(64)
fn leaves(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let shape = block_of(i, params.finest);
    let size = 1u << params.finest;
    let texel = (shape.y >> 16u) * size * size + (shape.x >> 16u) * size + (shape.x & 0xffffu);
    let place = rsm_texels[RSM_ROWS * texel];
    let facing = rsm_texels[RSM_ROWS * texel + 1u];
    let flux = rsm_texels[RSM_ROWS * texel + 2u];
    let lights = sum_of(flux.xyz) > 0.0;
    // The half-diagonal of a patch that is as much longer than wide as it is tilted. The points of an area light share the
    // map, but each sees all of the patch; cosines at the light are left out, which only makes the patch longer.
    let tiles = maps[shape.y >> 16u].tiles;
    let across = facing.w * f32(tiles * tiles) * place.w * place.w;
    let side = sqrt(max(min(across, flux.w), 0.0));
    let along = flux.w / max(side, 1e-30);
    var node: VirtualLight;
    node.position = select(vec3f(0.0), place.xyz, lights);
    node.normal = select(vec3f(0.0), facing.xyz, lights);
    node.area = select(0.0, flux.w, lights);
    node.radius = select(0.0, 0.5 * SLACK * length(vec2f(side, along)), lights);
    node.flux = flux.xyz;
    node.solid_angle = facing.w;
    node.block = shape.x;
    node.extent = shape.y;
    let at = tree_level_first(params.finest, params.maps) + i;
    nodes[at] = node;
    let in_cone = facing.w > 0.0;
    let nearest = select(RSM_FAR, place.w, lights);
    let farthest = select(select(-RSM_FAR, RSM_FAR, in_cone), place.w, lights);
    ranges[2u * at] = vec4f(select(vec3f(RSM_FAR), facing.xyz, lights), nearest);
    ranges[2u * at + 1u] = vec4f(select(vec3f(-RSM_FAR), facing.xyz, lights), farthest);
}

@compute @workgroup_size(64)
fn reduce(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let at = tree_level_first(params.level, params.maps) + i;
    let first = tree_child(params.level, params.maps, at);
    let shape = block_of(i, params.level);
    var node: VirtualLight;
    var heaviest = 0.0;
    var weight = 0.0;
    var stand_in = vec3f(0.0);
    var stand_in_place = vec3f(0.0);
    var lo = vec4f(RSM_FAR);
    var hi = vec4f(-RSM_FAR);
    for (var k = 0u; k < 4u; k++) {
        let child = nodes[first + k];
        let w = sum_of(child.flux);
        weight += w;
        node.position += w * child.position;
        node.normal += w * child.normal;
        node.flux += child.flux;
        node.area += child.area;
        node.solid_angle += child.solid_angle;
        stand_in = select(stand_in, child.normal, w > heaviest);
        stand_in_place = select(stand_in_place, child.position, w > heaviest);
        heaviest = max(heaviest, w);
        lo = min(lo, ranges[2u * (first + k)]);
        hi = max(hi, ranges[2u * (first + k) + 1u]);
    }
    let share = 1.0 / max(weight, 1e-37);
    node.position *= share;
    let long = length(node.normal) * share;
    node.normal *= share / max(long, NO_NORMAL);
    // Where its surfaces face different ways their mean lies on none of them, and looks where none does.
    var tilt = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let child = nodes[first + k];
        let turned = length(child.normal - node.normal) + child.spread;
        tilt = max(tilt, select(0.0, turned, sum_of(child.flux) > 0.0));
    }
    let bent = tilt > MOST_TILT || long < NO_NORMAL;
    node.position = select(node.position, stand_in_place, bent);
    node.normal = select(node.normal, stand_in, bent);
    for (var k = 0u; k < 4u; k++) {
        let child = nodes[first + k];
        let lights = sum_of(child.flux) > 0.0;
        let apart = child.position - node.position;
        let turned = length(child.normal - node.normal);
        let off = abs(dot(node.normal, apart)) + child.thickness + child.radius * turned;
        node.radius = max(node.radius, select(0.0, SLACK * (length(apart) + child.radius), lights));
        node.spread = max(node.spread, select(0.0, turned + child.spread, lights));
        node.thickness = max(node.thickness, select(0.0, SLACK * off, lights));
    }
    node.spread = min(node.spread, 2.0);
    node.thickness = min(node.thickness, node.radius);
    node.block = shape.x;
    node.extent = shape.y;
    nodes[at] = node;
    ranges[2u * at] = lo;
    ranges[2u * at + 1u] = hi;
}
