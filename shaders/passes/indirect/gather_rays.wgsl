// Stratified cosine-weighted rays from the pixels' hemispheres [WRC88].
// In: G-buffer. Out: rays and paths of one wave.

import package::common::basis::PI;
import package::common::gather_direction::gather_direction;
import package::common::gather_path::{GatherPath, GatherWave, NO_PIXEL};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::ray::{Ray, inactive_ray};
import package::common::surface::offset_origin;
import package::common::tiles::{TILE_PIXELS, pixel_in_tile_order};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> wave: GatherWave;
@group(0) @binding(1) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(5) var<storage, read_write> paths: array<GatherPath>;

const FAR: f32 = 3e38;

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
    let tile = wave.first_tile + row / wave.strata;
    let pixel = pixel_in_tile_order(tile * TILE_PIXELS + i % TILE_PIXELS, wave.width);
    let at = pixel.y * wave.width + pixel.x;
    rays[i] = inactive_ray();
    paths[i] = GatherPath(vec3f(0.0), NO_PIXEL, vec3f(0.0), stratum, vec3f(0.0), 0u);
    if pixel.x >= wave.width || pixel.y >= wave.height || g_normal[at].w != SURFACE {
        return;
    }
    let direction = gather_direction(wave, floats(g_normal[at]), at, stratum);
    let normal_geo = floats(g_geometric[at]);
    if dot(direction, normal_geo) <= 0.0 {
        return;
    }
    let origin = offset_origin(floats(g_position[at]), normal_geo, bitcast<f32>(g_position[at].w));
    rays[i] = Ray(origin, 0.0, direction, FAR);
    // Density cos/pi: each of the N rays stands for pi/N of irradiance a unit of radiance.
    paths[i] = GatherPath(vec3f(PI / f32(wave.strata_u * wave.strata_v)), at, vec3f(0.0), stratum, vec3f(0.0), 0u);
}
