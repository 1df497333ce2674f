// One ray a pixel, through its centre, in tile order. Out: rays.

import package::common::grid::{Grid, item_index};
import package::common::ray::{Ray, inactive_ray};
import package::common::tiles::pixel_in_tile_order;
import package::common::view::{View, view_direction};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read_write> rays: array<Ray>;

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
    let pixel = pixel_in_tile_order(view.first + i, view.width);
    if pixel.x >= view.width || pixel.y >= view.height {
        rays[i] = inactive_ray();
        return;
    }
    rays[i] = Ray(view.eye, 0.0, view_direction(view, pixel), FAR);
}
