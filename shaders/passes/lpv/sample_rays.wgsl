// Makes the sides of surface samples look like hits of gather rays, so that the lights can be gathered at them: each
// has as many paths as there are points on lights that it asks [KJ16 Sec. 3.2].
// In: points. Out: hits, rays that say from which side, paths whose sum is the radiosity there.

import package::common::basis::PI;
import package::common::gather_path::{GatherPath, GatherWave, NO_PIXEL};
import package::common::grid::{Grid, item_index};
import package::common::lpv_point::LpvPoint;
import package::common::ray::{Hit, Ray, inactive_ray};
import package::common::tiles::TILE_PIXELS;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> wave: GatherWave;
@group(0) @binding(1) var<storage, read> points: array<LpvPoint>;
@group(0) @binding(2) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(3) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(4) var<storage, read_write> paths: array<GatherPath>;

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
    let stratum = row % wave.strata;
    let p = (wave.first_tile + row / wave.strata) * TILE_PIXELS + i % TILE_PIXELS;
    if p >= wave.width {
        rays[i] = inactive_ray();
        paths[i] = GatherPath(vec3f(0.0), NO_PIXEL, vec3f(0.0), stratum, vec3f(0.0), 0u);
        return;
    }
    let point = points[p];
    hits[i] = Hit(0.0, point.u, point.v, point.instance, point.triangle);
    rays[i] = Ray(vec3f(0.0), 0.0, -point.normal, 1.0);
    paths[i] = GatherPath(vec3f(PI / f32(wave.strata)), p, vec3f(0.0), stratum, vec3f(0.0), 0u);
}
