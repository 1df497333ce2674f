// Means of what neighbouring points of a level found, as far as each holds at the other: noise falls with their number.
// In: points as they were gathered. Out: the same of smoother light.

import package::common::gather_point::{GatherPoint, PointMean, PointParams, add_point, added, holds};
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
    var mean: PointMean;
    var red = vec3f(0.0);
    var green = vec3f(0.0);
    var blue = vec3f(0.0);
    for (var k = 0u; k < SIDE * SIDE; k++) {
        let block = middle + vec2i(vec2u(k % SIDE, k / SIDE)) - i32(SIDE / 2u);
        if any(block < vec2i(0)) || any(block >= vec2i(size.xy)) {
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
        add_point(&mean, other, weight, own.position, own.normal);
        red += weight * other.red;
        green += weight * other.green;
        blue += weight * other.blue;
    }
    let more = added(mean);
    let share = 1.0 / mean.weight;
    own.red = share * (red + more.x * own.normal);
    own.green = share * (green + more.y * own.normal);
    own.blue = share * (blue + more.z * own.normal);
    own.red_slope = share * mean.red_slope;
    own.green_slope = share * mean.green_slope;
    own.blue_slope = share * mean.blue_slope;
    smoothed[params.first + i] = own;
}
