// Which faces of cells light passes: those between whose two middles there is no surface.
// Deviation: the blockers of [KD10 Sec. 3.4] are harmonics of the area near a face, and let some light through walls, and
// through thin ones most of it; this is tight for any closed surface, wherever the grid lies.
// `rays` out: one ray for each upper face. `faces` in: occlusion bits. Out: a mask of open faces a cell.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{Volume, cell_beside, cell_place, face_bit};
import package::common::ray::{Ray, inactive_ray};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(2) var<storage, read> occluded: array<u32>;
@group(0) @binding(3) var<storage, read_write> open: array<u32>;

// A ray begins and ends that much beyond the middles, in cells, so that a surface through one is met.
const BEYOND: f32 = 0.02;

fn axis_vector(axis: u32) -> vec3f {
    return vec3f(vec3u(0u, 1u, 2u) == vec3u(axis));
}

@compute @workgroup_size(64)
fn rays_between(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let axis = i / volume.cells;
    let at = cell_place(volume, i % volume.cells);
    if at[axis] + 1u == volume.size[axis] {
        rays[i] = inactive_ray();
        return;
    }
    let along = axis_vector(axis) * volume.edge;
    let middle = volume.corner + (vec3f(at) + 0.5) * volume.edge;
    rays[i] = Ray(middle - BEYOND * along, 0.0, (1.0 + 2.0 * BEYOND) * along, 1.0);
}

fn is_open(i: u32) -> bool {
    return ((occluded[i / 32u] >> (i % 32u)) & 1u) == 0u;
}

@compute @workgroup_size(64)
fn faces(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = item_index(grid, group, groups, 64u, lane);
    if cell >= grid.end {
        return;
    }
    let at = cell_place(volume, cell);
    var mask = 0u;
    for (var axis = 0u; axis < 3u; axis++) {
        let first = axis * volume.cells;
        if at[axis] + 1u < volume.size[axis] && is_open(first + cell) {
            mask |= face_bit(axis, true);
        }
        if at[axis] > 0u && is_open(first + cell_beside(volume, cell, axis, false)) {
            mask |= face_bit(axis, false);
        }
    }
    open[cell] = mask;
}
