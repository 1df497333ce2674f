// Irradiance of one light at each pixel of the tiles that face it: the exact unshadowed integral times the share of the
// light that is seen [HHM18], E += L E_polygon share. Devices without branches pay for every form of the integral, so
// tiles are sorted by the one that they need; one workgroup is one tile of 8 x 8 pixels. In: G-buffer, flags a tile,
// class a cell of 2 x 2 pixels, share a pixel. In and out: irradiance. A point in the light's plane stays finite.

import package::common::grid::{dispatch_size, group_index};
import package::common::light_frame::{CLIPPED, DARK, FACING, FAR, NEAR};
import package::common::light_pixel::{
    LightPixel, MOST_ROWS, NO_TILE, PART, UNSEEN, cell_state, g_geometric, g_normal, g_position, light_pixel, params,
    tile_flags, tile_list,
};
import package::common::light_plane::{cut_near, whole_far, whole_near};
import package::common::polygon::{FAR_SIZES, parallelogram_irradiance};

@group(0) @binding(7) var<storage, read> share: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> direct_irradiance: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> tile_lists: array<u32>;
@group(0) @binding(10) var<storage, read_write> arguments: array<u32>;

// Numbers of the lists; spots have all their tiles in the first.
const KINDS: u32 = 4u;
const WHOLE_NEAR: u32 = 0u;
const WHOLE_FAR: u32 = 1u;
const CUT_NEAR: u32 = 2u;
const ANY: u32 = 3u;
const SORTERS: u32 = 256u;

fn kind_of(flags: u32) -> u32 {
    if (flags & FACING) == 0u || (flags & DARK) != 0u {
        return KINDS;
    }
    if params.cos_cutoff > -1.5 {
        return WHOLE_NEAR;
    }
    switch flags & (NEAR | FAR | CLIPPED) {
        case NEAR: { return WHOLE_NEAR; }
        case FAR: { return WHOLE_FAR; }
        case NEAR | CLIPPED: { return CUT_NEAR; }
        default: { return ANY; }
    }
}

var<workgroup> firsts: array<vec4u, SORTERS>;
var<workgroup> counts: vec4u;

// For workgroups of so many tiles each, and the number of tiles.
fn write_arguments(row: u32, tiles: u32, each: u32) {
    let size = dispatch_size(tiles, each);
    arguments[4u * row] = size.x;
    arguments[4u * row + 1u] = size.y;
    arguments[4u * row + 2u] = size.z;
    arguments[4u * row + 3u] = tiles;
}

// One workgroup: each thread counts the kinds of a run of tiles, and lists them behind those of the threads before it.
@compute @workgroup_size(SORTERS)
fn sort(@builtin(local_invocation_index) lane: u32) {
    let run = (params.tiles + SORTERS - 1u) / SORTERS;
    let first = min(lane * run, params.tiles);
    let end = min(first + run, params.tiles);
    let ones = vec4u(0u, 1u, 2u, 3u);
    var mine = vec4u(0u);
    for (var tile = first; tile < end; tile++) {
        mine += select(vec4u(0u), vec4u(1u), ones == vec4u(kind_of(tile_flags[tile])));
    }
    firsts[lane] = mine;
    workgroupBarrier();
    if lane == 0u {
        var sum = vec4u(0u);
        for (var i = 0u; i < SORTERS; i++) {
            let here = firsts[i];
            firsts[i] = sum;
            sum += here;
        }
        counts = sum;
    }
    workgroupBarrier();
    let stride = params.tiles + MOST_ROWS;
    var next = firsts[lane];
    for (var tile = first; tile < end; tile++) {
        let kind = kind_of(tile_flags[tile]);
        if kind < KINDS {
            tile_lists[kind * stride + next[kind]] = tile;
            next[kind]++;
        }
    }
    for (var i = lane; i < KINDS * MOST_ROWS; i += SORTERS) {
        tile_lists[i / MOST_ROWS * stride + counts[i / MOST_ROWS] + i % MOST_ROWS] = NO_TILE;
    }
    if lane < KINDS {
        write_arguments(lane, counts[lane], 1u);
        write_arguments(KINDS + lane, counts[lane], 4u);
    }
}

fn add(p: LightPixel, irradiance: f32) {
    if p.live && p.seen != UNSEEN && irradiance > 0.0 {
        var part = share[p.at].xyz;
        part = select(vec3f(1.0), part, p.seen == PART || params.textured != 0u);
        direct_irradiance[p.at] += vec4f(params.radiance * irradiance * part, 0.0);
    }
}

// Whether the light stands above the geometric horizon, where that does not cross it.
fn above(p: LightPixel) -> bool {
    return dot(p.g, p.corner + vec3f(0.5 * (params.edge.x + params.edge.y), 0.5 * params.edge.z, 0.0)) > 0.0;
}

@compute @workgroup_size(64)
fn near(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = light_pixel(group_index(group, groups), lane);
    add(p, select(0.0, whole_near(p.n, p.corner, params.edge, params.along_v), above(p)));
}

@compute @workgroup_size(64)
fn far(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = light_pixel(group_index(group, groups), lane);
    add(p, select(0.0, whole_far(p.n, p.corner, params.edge), above(p)));
}

@compute @workgroup_size(64)
fn clipped(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = light_pixel(group_index(group, groups), lane);
    add(p, cut_near(p.n, p.g, p.corner, params.edge, params.along_v));
}

// Tiles of several kinds.
@compute @workgroup_size(64)
fn any_kind(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = light_pixel(group_index(group, groups), lane);
    let u = vec3f(params.edge.x, 0.0, 0.0);
    let v = vec3f(params.edge.yz, 0.0);
    let middle = p.corner + 0.5 * (u + v);
    let near = cut_near(p.n, p.g, p.corner, params.edge, params.along_v);
    add(p, select(near, parallelogram_irradiance(p.n, p.g, p.corner, u, v), dot(middle, middle) > FAR_SIZES * FAR_SIZES));
}

@compute @workgroup_size(64)
fn spot(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = light_pixel(group_index(group, groups), lane);
    let d2 = dot(p.corner, p.corner);
    let w = p.corner * inverseSqrt(max(d2, 1e-37));
    let lights = -w.z >= params.cos_cutoff && dot(p.g, w) > 0.0 && d2 > 0.0;
    add(p, select(0.0, dot(p.n, w) / max(d2, 1e-37), lights));
}
