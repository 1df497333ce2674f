// Which faces of cells light passes: those between whose two middles there is no surface.
// Deviation: the blockers of [KD10 Sec. 3.4] are harmonics of the area near a face, and let some light through walls, and
// through thin ones most of it; this is tight for any closed surface, wherever the grid lies.
// `rays_between` out: one ray for each upper face of a part. `meet` in: their hits. Out: where each face's ray meets a
// surface. `faces` in: all of these. Out: a mask of open faces a cell.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{NOWHERE, Volume, cell_beside, cell_place, face_bit};
import package::common::ray::{Hit, MISS, Ray, inactive_ray};

struct BlockersParams {
    first: u32,         // face of the part: axis by axis, cell by cell
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<uniform> params: BlockersParams;
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read_write> met: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<f32>;
@group(0) @binding(6) var<storage, read_write> open: array<u32>;

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
    let face = params.first + i;
    let axis = face / volume.cells;
    let at = cell_place(volume, face % volume.cells);
    if at[axis] + 1u == volume.size[axis] {
        rays[i] = inactive_ray();
        return;
    }
    let along = axis_vector(axis) * volume.edge;
    let middle = volume.corner + (vec3f(at) + 0.5) * volume.edge;
    rays[i] = Ray(middle - BEYOND * along, 0.0, (1.0 + 2.0 * BEYOND) * along, 1.0);
}

@compute @workgroup_size(64)
fn meet(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let hit = hits[i];
    met[params.first + i] = select((1.0 + 2.0 * BEYOND) * hit.t - BEYOND, NOWHERE, hit.instance == MISS);
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
        if at[axis] + 1u < volume.size[axis] && surfaces[first + cell] == NOWHERE {
            mask |= face_bit(axis, true);
        }
        if at[axis] > 0u && surfaces[first + cell_beside(volume, cell, axis, false)] == NOWHERE {
            mask |= face_bit(axis, false);
        }
    }
    open[cell] = mask;
}
