// Voxelize: in each cell whose middle a triangle covers, the slices that it passes through there [NPW10 Sec. 3.3;
// Deviation: all slices of the triangle inside the cell, where a rasterised fragment has one depth].
// In     geometry, instances; first_triangles, for each instance the number of triangles before it; lists from
//        `params.first` on
// Out    bits: set, never cleared
// Rule   count: a thread a triangle; a triangle over few cells is marked at once, of a larger one the tiles of 8 x 8
//        cells are counted; scan: sums of these over all blocks; fill: a workgroup a tile, a thread a cell.
//        Bits are set by `or`, so that no order shows.

import package::common::grid::{Grid, dispatch_size, group_index, item_index};
import package::common::surface::{Instance, geometry, geometry_vec3, instances, scene_direction};
import package::common::voxel_triangle::{Triangle, depths_in, eye_triangle};
import package::common::voxels::{Voxels, eye_direction, slice_at, word_mask};

struct VoxelizeParams {
    first: u32,     // first triangle of this batch, all instances counted
    triangles: u32, // of this batch
    instances: u32,
    blocks: u32,    // of BLOCK triangles
}

const BLOCK: u32 = 256u;
const TILE: u32 = 8u;
// Cells that one thread goes through.
const FEW: u32 = 16u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VoxelizeParams;
@group(0) @binding(1) var<uniform> voxels: Voxels;
@group(0) @binding(2) var<storage, read> first_triangles: array<u32>;
@group(0) @binding(3) var<storage, read_write> before: array<u32>;  // tiles before a triangle in its block
@group(0) @binding(4) var<storage, read_write> totals: array<u32>;  // of blocks; scanned: tiles before a block, and all
@group(0) @binding(5) var<storage, read_write> arguments: array<u32>;
@group(0) @binding(6) var<storage, read_write> bits: array<atomic<u32>>;

fn instance_of(triangle: u32) -> u32 {
    var lo = 0u;
    var hi = params.instances;
    while hi - lo > 1u {
        let middle = (lo + hi) / 2u;
        if first_triangles[middle] <= triangle {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    return lo;
}

fn eye_corner(at: Instance, vertex: u32) -> vec3f {
    let origin = vec3f(at.scene_from_object[0].w, at.scene_from_object[1].w, at.scene_from_object[2].w);
    return eye_direction(voxels, scene_direction(at, geometry_vec3(at.positions, vertex)) + (origin - voxels.eye));
}

fn triangle_at(index: u32) -> Triangle {
    let instance = instance_of(index);
    let at = instances[instance];
    let first = at.triangles + 3u * (index - first_triangles[instance]);
    let a = eye_corner(at, geometry[first]);
    return eye_triangle(voxels, array(a, eye_corner(at, geometry[first + 1u]), eye_corner(at, geometry[first + 2u])));
}

fn mark(t: Triangle, cell: vec2u) {
    let depths = depths_in(voxels, t, cell);
    if depths.x > depths.y {
        return;
    }
    let first = slice_at(voxels, depths.x);
    let last = slice_at(voxels, depths.y);
    let at = (cell.y * voxels.columns + cell.x) * voxels.words;
    for (var word = first / 32u; word <= last / 32u; word++) {
        atomicOr(&bits[at + word], word_mask(word, first, last));
    }
}

var<workgroup> sums: array<u32, BLOCK>;

// Sum of `value` over the lanes before this one; `sums[BLOCK - 1]` is that of all.
fn scan_block(lane: u32, value: u32) -> u32 {
    sums[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < BLOCK; step *= 2u) {
        var lower = 0u;
        if lane >= step {
            lower = sums[lane - step];
        }
        workgroupBarrier();
        sums[lane] += lower;
        workgroupBarrier();
    }
    return sums[lane] - value;
}

@compute @workgroup_size(BLOCK)
fn count(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, BLOCK, lane);
    var tiles = 0u;
    if item < grid.end {
        let t = triangle_at(params.first + item);
        let size = t.hi - t.lo + 1u;
        if t.empty {
        } else if size.x * size.y > FEW {
            let across = t.hi / TILE - t.lo / TILE + 1u;
            tiles = across.x * across.y;
        } else {
            for (var i = 0u; i < size.x * size.y; i++) {
                mark(t, t.lo + vec2u(i % size.x, i / size.x));
            }
        }
    }
    let sum = scan_block(lane, tiles);
    if item < grid.end {
        before[item] = sum;
        if lane == 0u {
            totals[item / BLOCK] = sums[BLOCK - 1u];
        }
    }
}

@compute @workgroup_size(BLOCK)
fn scan(@builtin(local_invocation_index) lane: u32) {
    var all_before = 0u;
    for (var first = 0u; first < params.blocks; first += BLOCK) {
        let at = first + lane;
        var value = 0u;
        if at < params.blocks {
            value = totals[at];
        }
        let sum = scan_block(lane, value);
        if at < params.blocks {
            totals[at] = all_before + sum;
        }
        all_before += sums[BLOCK - 1u];
        workgroupBarrier();
    }
    if lane == 0u {
        let groups = dispatch_size(all_before, 1u);
        arguments[0] = groups.x;
        arguments[1] = groups.y;
        arguments[2] = groups.z;
        totals[params.blocks] = all_before;
    }
}

@compute @workgroup_size(64)
fn fill(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group_index(group, groups);
    if index >= totals[params.blocks] {
        return;
    }
    // The last block, and in it the last triangle, that begins at or before this tile.
    var lo = 0u;
    var hi = params.blocks;
    while hi - lo > 1u {
        let middle = (lo + hi) / 2u;
        if totals[middle] <= index {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    let rest = index - totals[lo];
    hi = min((lo + 1u) * BLOCK, params.triangles);
    lo *= BLOCK;
    while hi - lo > 1u {
        let middle = (lo + hi) / 2u;
        if before[middle] <= rest {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    let t = triangle_at(params.first + lo);
    let tile = rest - before[lo];
    let first = t.lo / TILE;
    let across = t.hi.x / TILE - first.x + 1u;
    let cell = (first + vec2u(tile % across, tile / across)) * TILE + vec2u(lane % TILE, lane / TILE);
    if all(cell >= t.lo) && all(cell <= t.hi) {
        mark(t, cell);
    }
}
