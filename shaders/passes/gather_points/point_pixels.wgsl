// Pixels and the gather points around them, level by level from the coarsest.
//   begin        marks every block of the coarsest level that sees a surface
//   interpolate  adds to each pixel the points of one level around it, and marks the blocks of the level below in which a
//                pixel lacks points that hold for it: the one nearest to the block's middle gathers for itself
//   finish       irradiance a pixel, and the level of the block that stands for it
// In: G-buffer, points of the level. In and out: sums and coverage a pixel. Out: marks.

import package::common::fragment::{LEVEL_NOTHING, REASON_COARSEST, REASON_ILLUMINATION, REASON_NOTHING};
import package::common::gather_point::{GatherPoint, PointMean, PointParams, add_point, added, holds, mark_of};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::view::View;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: PointParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
// A block, all levels numbered through: 0 none, else 1 + the number of its point.
@group(0) @binding(4) var<storage, read> point_at: array<u32>;
@group(0) @binding(5) var<storage, read> points: array<GatherPoint>;
// rgb sum of irradiance times weight, w sum of weights.
@group(0) @binding(6) var<storage, read_write> sums: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> coverage: array<f32>;
@group(0) @binding(8) var<storage, read_write> marks: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> irradiance: array<vec4f>;
@group(0) @binding(10) var<storage, read_write> level_map: array<u32>;
@group(0) @binding(11) var<storage, read_write> reason_map: array<u32>;

// Marks the block of `level` that a pixel is in; the pixel nearest to the block's middle, and of these the first, stays.
fn mark(level: u32, pixel: vec2u) {
    let block = pixel >> vec2u(level);
    let within = pixel - (block << vec2u(level));
    atomicMax(&marks[block.y * pyramid.levels[level].x + block.x], mark_of(level, within));
}

@compute @workgroup_size(64)
fn begin(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    sums[i] = vec4f(0.0);
    coverage[i] = 0.0;
    if g_normal[i].w == SURFACE {
        mark(pyramid.level, texel_of(pyramid.levels[0], i));
    }
}

@compute @workgroup_size(64)
fn interpolate(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || g_normal[i].w != SURFACE {
        return;
    }
    let level = pyramid.level;
    let size = pyramid.levels[level];
    let pixel = texel_of(pyramid.levels[0], i);
    let p = floats(g_position[i]);
    let n = floats(g_normal[i]);
    let width = pyramid.pixel_width * max(dot(view.eye - p, view.backward), 1e-30);
    let place = (vec2f(pixel) + 0.5) / f32(1u << level) - 0.5;
    let corner = floor(place);
    let part = place - corner;
    var mean: PointMean;
    for (var k = 0u; k < 4u; k++) {
        let step = vec2u(k & 1u, k >> 1u);
        let block = clamp(vec2i(corner) + vec2i(step), vec2i(0), vec2i(size.xy) - 1);
        let at = point_at[texel_number(size, vec2u(block))];
        if at != 0u {
            let point = points[at - 1u];
            let weights = select(1.0 - part, part, step == vec2u(1u));
            let weight = weights.x * weights.y * holds(point, params.reach, p, n, width);
            add_point(&mean, point, weight, p, n);
        }
    }
    // Points of a level count four times those of the next.
    let share = exp2(2.0 * f32(pyramid.coarsest - level));
    sums[i] += share * vec4f(mean.light + added(mean), mean.weight);
    let covered = coverage[i] + mean.weight;
    coverage[i] = covered;
    if level > 0u && covered < params.covered {
        mark(level - 1u, pixel);
    }
}

// Level of the block that stands for a pixel: those of which no part has a point of its own.
fn level_of_pixel(pixel: vec2u) -> u32 {
    var level = pyramid.coarsest;
    for (var below = pyramid.coarsest; below > 0u; below--) {
        let size = pyramid.levels[below - 1u];
        let block = (pixel >> vec2u(below)) << vec2u(1u);
        var parts = 0u;
        for (var k = 0u; k < 4u; k++) {
            let part = min(block + vec2u(k & 1u, k >> 1u), size.xy - 1u);
            parts |= point_at[texel_number(size, part)];
        }
        if level == below && parts != 0u {
            level = below - 1u;
        }
    }
    return level;
}

@compute @workgroup_size(64)
fn finish(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let surface = g_normal[i].w == SURFACE;
    let sum = sums[i];
    irradiance[i] = vec4f(select(vec3f(0.0), sum.xyz / max(sum.w, 1e-30), surface && sum.w > 0.0), 0.0);
    let level = level_of_pixel(texel_of(pyramid.levels[0], i));
    level_map[i] = select(LEVEL_NOTHING, level, surface);
    reason_map[i] = select(REASON_NOTHING, select(REASON_ILLUMINATION, REASON_COARSEST, level == pyramid.coarsest), surface);
}
