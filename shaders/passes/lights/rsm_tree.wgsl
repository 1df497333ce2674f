// The tree over the texels of reflective shadow maps: every node is the virtual light of a square of texels, with bounds
// of where it lies and how it is turned that hold for all of them [NSW09 Sec. 3.5; WFA05].
//   leaves  a node for each texel
//   reduce  a level from the one below it
// In: maps, rsm_texels. Out: nodes, ranges, laid out as virtual_light.wgsl says.

import package::common::grid::{Grid, item_index};
import package::common::rsm::{LEAST_COSINE, RSM_FAR, RSM_ROWS, RsmMap};
import package::common::virtual_light::{VirtualLight, from_morton, tree_child, tree_level_first};

struct RsmTreeParams {
    level: u32,
    finest: u32,
    maps: u32,
    single: u32,        // from this level on nodes are virtual lights, above it clusters of them
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: RsmTreeParams;
@group(0) @binding(1) var<storage, read> maps: array<RsmMap>;
@group(0) @binding(2) var<storage, read> rsm_texels: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> nodes: array<VirtualLight>;
@group(0) @binding(4) var<storage, read_write> ranges: array<vec4f>;

// Largest difference of unit normals from their mean, 30 degrees, for the mean to stand for a virtual light.
const MOST_TILT: f32 = 0.5;
// Shorter than this a mean of unit normals has no direction: it takes that of the child with most flux.
const CANCELS: f32 = 1e-6;

// The node of this item of the level, with its place and nothing else.
fn node_at(item: u32) -> VirtualLight {
    var node: VirtualLight;
    let map = item >> (2u * params.level);
    let width = 1u << (params.finest - params.level);
    let corner = from_morton(item & ((1u << (2u * params.level)) - 1u)) * width;
    node.normal = vec3f(0.0, 0.0, 1.0);
    node.block = corner.x | (corner.y << 16u);
    node.extent = width | (map << 16u);
    return node;
}

@compute @workgroup_size(64)
fn leaves(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    var node = node_at(item);
    let map = node.extent >> 16u;
    let texel = (((map << params.finest) + (node.block >> 16u)) << params.finest) + (node.block & 0xffffu);
    let position = rsm_texels[RSM_ROWS * texel];
    let normal = rsm_texels[RSM_ROWS * texel + 1u];
    let flux = rsm_texels[RSM_ROWS * texel + 2u];
    node.solid_angle = normal.w;
    // What lies in the light and sees nothing is as far as can be; outside of a cone it is not there.
    let hole = normal.w > 0.0 && position.w >= RSM_FAR;
    var least = vec4f(RSM_FAR);
    var largest = vec4f(vec3f(-RSM_FAR), select(-RSM_FAR, RSM_FAR, hole));
    if flux.x + flux.y + flux.z > 0.0 {
        node.position = position.xyz;
        node.normal = normal.xyz;
        node.flux = flux.xyz;
        node.area = flux.w;
        // Its patch is s wide and s / cos long. An area light's own cosine is left out: this one is then too small, and the
        // patch too long.
        let tiles = f32(maps[map].tiles);
        let s2 = normal.w * tiles * tiles * position.w * position.w;
        let cosine = clamp(s2 / max(flux.w, 1e-30), LEAST_COSINE, 1.0);
        node.radius = 0.5 * sqrt(flux.w * (cosine + 1.0 / cosine));
        least = vec4f(normal.xyz, position.w);
        largest = least;
    }
    let at = tree_level_first(params.finest, params.maps) + item;
    nodes[at] = node;
    ranges[2u * at] = least;
    ranges[2u * at + 1u] = largest;
}

fn weight(light: VirtualLight) -> f32 {
    return light.flux.x + light.flux.y + light.flux.z;
}

fn unit_of(v: vec3f) -> vec3f {
    return v / max(length(v), 1e-30);
}

// Sums, and means by flux [Deviation: the text has a point sample everywhere]. Of a virtual light that no cut can split the
// mean may lie on none of its surfaces and look where none does: there the child with most flux stands for it.
fn joined(empty: VirtualLight, children: array<VirtualLight, 4>) -> VirtualLight {
    var node = empty;
    var position = vec3f(0.0);
    var normal = vec3f(0.0);
    var brightest = 0u;
    var all = 0.0;
    var most = 0.0;
    for (var c = 0u; c < 4u; c++) {
        let child = children[c];
        let w = weight(child);
        node.solid_angle += child.solid_angle;
        node.flux += child.flux;
        node.area += child.area;
        position += w * child.position;
        normal += w * child.normal;
        all += w;
        if w > most {
            most = w;
            brightest = c;
        }
    }
    if all == 0.0 {
        return node;
    }
    let mean = normal / all;
    let alike = length(mean);
    let unit = mean / max(alike, CANCELS);
    var tilt = 0.0;
    for (var c = 0u; c < 4u; c++) {
        let turned = length(unit_of(children[c].normal) - unit) + children[c].spread;
        tilt = max(tilt, select(0.0, turned, weight(children[c]) > 0.0));
    }
    let along = unit_of(children[brightest].normal);
    node.position = position / all;
    node.normal = select(CANCELS * along, unit * min(alike, 1.0), alike > CANCELS);
    if params.level >= params.single {
        let alone = tilt > MOST_TILT;
        node.position = select(node.position, children[brightest].position, alone);
        node.normal = select(unit, along, alone);
    }
    return node;
}

@compute @workgroup_size(64)
fn reduce(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let at = tree_level_first(params.level, params.maps) + item;
    let first = tree_child(params.level, params.maps, at);
    var children: array<VirtualLight, 4>;
    var least = vec4f(RSM_FAR);
    var largest = vec4f(-RSM_FAR);
    for (var c = 0u; c < 4u; c++) {
        children[c] = nodes[first + c];
        least = min(least, ranges[2u * (first + c)]);
        largest = max(largest, ranges[2u * (first + c) + 1u]);
    }
    var node = joined(node_at(item), children);
    let unit = unit_of(node.normal);
    for (var c = 0u; c < 4u; c++) {
        let child = children[c];
        if weight(child) > 0.0 {
            let offset = child.position - node.position;
            let turned = length(unit_of(child.normal) - unit);
            node.radius = max(node.radius, length(offset) + child.radius);
            node.spread = max(node.spread, turned + child.spread);
            let off_plane = abs(dot(unit, offset)) + child.thickness + child.radius * turned;
            node.thickness = max(node.thickness, off_plane);
        }
    }
    node.spread = min(node.spread, 2.0);
    node.thickness = min(node.thickness, node.radius);
    nodes[at] = node;
    ranges[2u * at] = least;
    ranges[2u * at + 1u] = largest;
}
