// Adds what a wave's shadow rays let through to each pixel's indirect irradiance, stratum by stratum in a fixed order.
// In: paths, occlusion bits. In and out: indirect irradiance a pixel.

import package::common::gather_path::{GatherPath, GatherWave, NO_PIXEL};
import package::common::grid::{Grid, item_index};
import package::common::tiles::TILE_PIXELS;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> wave: GatherWave;
@group(0) @binding(1) var<storage, read> paths: array<GatherPath>;
@group(0) @binding(2) var<storage, read> occluded: array<u32>;
@group(0) @binding(3) var<storage, read_write> indirect_irradiance: array<vec4f>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let p = item_index(grid, group, groups, 64u, lane);
    if p >= grid.end {
        return;
    }
    let first = p / TILE_PIXELS * TILE_PIXELS * wave.strata + p % TILE_PIXELS;
    var pixel = NO_PIXEL;
    var sum = vec3f(0.0);
    for (var s = 0u; s < wave.strata; s++) {
        let i = first + s * TILE_PIXELS;
        if ((occluded[i / 32u] >> (i % 32u)) & 1u) == 0u {
            sum += paths[i].pending;
        }
        pixel = min(pixel, paths[i].pixel);
    }
    if pixel != NO_PIXEL {
        indirect_irradiance[pixel] += vec4f(sum, 0.0);
    }
}
