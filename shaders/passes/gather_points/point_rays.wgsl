// Stratified cosine-weighted rays from the places that gather [WRC88].
// In: G-buffer, blocks in a list, which of their pixels. Out: the points, for the first strata; rays and paths of a wave.

import package::common::basis::PI;
import package::common::gather_direction::gather_direction;
import package::common::gather_path::{GatherPath, GatherWave, NO_PIXEL};
import package::common::gather_point::{GatherPoint, PointParams, place_of};
import package::common::gbuffer::floats;
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::ray::{Ray, inactive_ray};
import package::common::surface::offset_origin;
import package::common::tiles::TILE_PIXELS;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> wave: GatherWave;
@group(0) @binding(1) var<uniform> params: PointParams;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> blocks: array<u32>;
@group(0) @binding(6) var<storage, read> marks: array<u32>;
@group(0) @binding(7) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(8) var<storage, read_write> paths: array<GatherPath>;
@group(0) @binding(9) var<storage, read_write> points: array<GatherPoint>;
@group(0) @binding(10) var<storage, read_write> point_at: array<u32>;

const FAR: f32 = 3e38;

// The pixel that a block's mark names.
fn marked_pixel(block: u32) -> u32 {
    let level = pyramid.level;
    let pixel = (texel_of(pyramid.levels[level], block) << vec2u(level)) + place_of(level, marks[block]);
    return pixel.y * pyramid.levels[0].x + pixel.x;
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
    let at = marked_pixel(blocks[i]);
    let normal = floats(g_normal[at]);
    var point: GatherPoint;
    point.position = floats(g_position[at]);
    point.normal = normal;
    point.level = pyramid.level;
    points[params.first + i] = point;
    point_at[pyramid.levels[pyramid.level].z + blocks[i]] = params.first + i + 1u;
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
    let row = i / TILE_PIXELS;
    let stratum = wave.first_stratum + row % wave.strata;
    let number = (wave.first_tile + row / wave.strata) * TILE_PIXELS + i % TILE_PIXELS;
    rays[i] = inactive_ray();
    paths[i] = GatherPath(vec3f(0.0), NO_PIXEL, vec3f(0.0), stratum, vec3f(0.0), 0u);
    if number >= params.count {
        return;
    }
    let at = marked_pixel(blocks[number]);
    let direction = gather_direction(wave, floats(g_normal[at]), params.first + number, stratum);
    // A path without a ray still says whose it is.
    paths[i].pixel = params.first + number;
    let normal_geo = floats(g_geometric[at]);
    if dot(direction, normal_geo) <= 0.0 {
        return;
    }
    let origin = offset_origin(floats(g_position[at]), normal_geo, bitcast<f32>(g_position[at].w));
    rays[i] = Ray(origin, 0.0, direction, FAR);
    paths[i].throughput = vec3f(PI / f32(wave.strata_u * wave.strata_v));
}
