// Leaves the light that surface samples reflect in the cells before them [KD10 Sec. 3.3; KJ16 Sec. 3.2].
// In: points by cell, what they reflect. Out: the cells' light; cells without a point are left as they are.

import package::common::grid::{Grid, item_index};
import package::common::lpv_point::{LpvCell, LpvPoint};
import package::common::lpv_volume::{LOBE, Volume, Y0, limited};

// 1: each point stands for a face of the cell, over their number.
// Deviation: the paper divides by the number of samples, which makes a cell's light independent of how much surface
// is in it; otherwise each point's flux counts.
override SHARED: u32 = 0u;

struct InjectParams {
    side: vec3f,        // way that surfaces face, of one of six flows: the light of each surface is split by the squares of its
                        // normal; 0: all
    most: f32,          // largest net flow, as a share
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<uniform> params: InjectParams;
@group(0) @binding(2) var<storage, read> cells: array<LpvCell>;
@group(0) @binding(3) var<storage, read> points: array<LpvPoint>;
@group(0) @binding(4) var<storage, read> radiosity: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> flow: array<vec4f>;

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
    let held = cells[i];
    var sum = mat3x4f();
    for (var p = held.first; p < held.first + held.count; p++) {
        let facing = max(dot(points[p].normal, params.side), 0.0);
        let part = select(facing * facing, 1.0, all(params.side == vec3f(0.0)));
        let flux = part * radiosity[p].xyz * select(points[p].area, volume.edge * volume.edge / f32(held.count), SHARED == 1u);
        // Intensity flux / pi times the clamped cosine.
        let lobe = Y0 * vec4f(1.0, LOBE * points[p].normal);
        sum += mat3x4f(flux.x * lobe, flux.y * lobe, flux.z * lobe);
    }
    for (var channel = 0u; channel < 3u; channel++) {
        flow[channel * volume.cells + held.cell] = limited(sum[channel], params.most);
    }
}
