// Means of what neighbouring points of a level found, as far as each holds at the other: noise falls with their number.
// In: points as they were gathered. Out: the same of smoother light.

import package::common::gather_point::{GatherPoint, PointParams, change_at, holds};
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: PointParams;
@group(0) @binding(1) var<storage, read> blocks: array<u32>;
@group(0) @binding(2) var<storage, read> point_at: array<u32>;
@group(0) @binding(3) var<storage, read> points: array<GatherPoint>;
@group(0) @binding(4) var<storage, read_write> smoothed: array<GatherPoint>;

// Blocks along an edge of those that a point is smoothed over.
override SIDE: u32 = 5u;

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
    var own = points[params.first + i];
    let size = pyramid.levels[pyramid.level];
    let middle = vec2i(texel_of(size, blocks[i]));
    let here = own.position;
    var weights = 1.0;
    for (var k = 0u; k < SIDE * SIDE; k++) {
        let block = middle + vec2i(vec2u(k % SIDE, k / SIDE)) - i32(SIDE / 2u);
        if all(block == middle) || any(block < vec2i(0)) || any(block >= vec2i(size.xy)) {
            continue;
        }
        let at = point_at[texel_number(size, vec2u(block))];
        if at == 0u {
            continue;
        }
        let other = points[at - 1u];
        let weight = min(
            holds(other, params.reach, own.position, own.normal, 0.0),
            holds(own, params.reach, other.position, other.normal, 0.0),
        );
        weights += weight;
        let change = change_at(other, here);
        own.red += weight * (other.red + change.x * own.normal);
        own.green += weight * (other.green + change.y * own.normal);
        own.blue += weight * (other.blue + change.z * own.normal);
        own.red_slope += weight * other.red_slope;
        own.green_slope += weight * other.green_slope;
        own.blue_slope += weight * other.blue_slope;
    }
    own.red /= weights;
    own.green /= weights;
    own.blue /= weights;
    own.red_slope /= weights;
    own.green_slope /= weights;
    own.blue_slope /= weights;
    smoothed[params.first + i] = own;
}
