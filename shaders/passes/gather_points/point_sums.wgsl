// Adds what a wave's rays found to the points that sent them, stratum by stratum in a fixed order.
//   distances  sum of 1 / distance to what was met, before the rays go on
//   light      vector irradiance, of what shadow rays let through
// In: hits; paths, occlusion bits. In and out: points.

import package::common::gather_direction::gather_direction;
import package::common::gather_path::{GatherPath, GatherWave};
import package::common::gather_point::{GatherPoint, PointParams};
import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS, Ray};
import package::common::tiles::TILE_PIXELS;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> wave: GatherWave;
@group(0) @binding(1) var<uniform> params: PointParams;
@group(0) @binding(2) var<storage, read> rays: array<Ray>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read> paths: array<GatherPath>;
@group(0) @binding(5) var<storage, read> occluded: array<u32>;
@group(0) @binding(6) var<storage, read_write> points: array<GatherPoint>;

// Light along the surface says little of other normals, and much of its noise.
const STEEPEST: f32 = 3.0;
// No distance is smaller, so that none is divided by zero.
const NEAREST: f32 = 1e-30;

fn first_of(p: u32) -> u32 {
    return p / TILE_PIXELS * TILE_PIXELS * wave.strata + p % TILE_PIXELS;
}

@compute @workgroup_size(64)
fn distances(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = item_index(grid, group, groups, 64u, lane);
    let number = wave.first_tile * TILE_PIXELS + p;
    if p >= grid.end || number >= params.count {
        return;
    }
    var sum = 0.0;
    var count = 0.0;
    for (var s = 0u; s < wave.strata; s++) {
        let i = first_of(p) + s * TILE_PIXELS;
        let met = rays[i].t_max > rays[i].t_min && hits[i].instance != MISS;
        sum += select(0.0, 1.0 / max(hits[i].t, NEAREST), met);
        count += select(0.0, 1.0, met);
    }
    points[params.first + number].inverse += sum;
    points[params.first + number].met += count;
}

@compute @workgroup_size(64)
fn light(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = item_index(grid, group, groups, 64u, lane);
    let number = wave.first_tile * TILE_PIXELS + p;
    if p >= grid.end || number >= params.count {
        return;
    }
    let at = params.first + number;
    let normal = points[at].normal;
    var red = vec3f(0.0);
    var green = vec3f(0.0);
    var blue = vec3f(0.0);
    var red_slope = vec3f(0.0);
    var green_slope = vec3f(0.0);
    var blue_slope = vec3f(0.0);
    for (var s = 0u; s < wave.strata; s++) {
        let i = first_of(p) + s * TILE_PIXELS;
        if ((occluded[i / 32u] >> (i % 32u)) & 1u) == 0u {
            let path = paths[i];
            let w = gather_direction(wave, normal, at, path.stratum);
            let cosine = dot(w, normal);
            let along = (w - cosine * normal) / max(cosine, 1e-6);
            let far = length(along);
            let way = normal + along * (min(far, STEEPEST) / max(far, 1e-6));
            red += path.pending.x * way;
            green += path.pending.y * way;
            blue += path.pending.z * way;
            let slope = path.slope - dot(path.slope, normal) * normal;
            red_slope += path.pending.x * slope;
            green_slope += path.pending.y * slope;
            blue_slope += path.pending.z * slope;
        }
    }
    points[at].red += red;
    points[at].green += green;
    points[at].blue += blue;
    points[at].red_slope += red_slope;
    points[at].green_slope += green_slope;
    points[at].blue_slope += blue_slope;
}
