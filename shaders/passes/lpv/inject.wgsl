// Leaves the light that surface samples reflect in the cells before them [KD10 Sec. 3.3; KJ16 Sec. 3.2].
//   main   points by cell, what they reflect; cells without a point are left as they are
//   enter  of a volume inside of another: what left that through the faces that are this one's border
// Out: the cells' light.

import package::common::grid::{Grid, item_index};
import package::common::lpv_point::{LpvCell, LpvPoint};
import package::common::lpv_volume::{LOBE, NOWHERE, Volume, Y0, cell_place, limited};

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
@group(0) @binding(6) var<uniform> entering: EnterParams;
@group(0) @binding(7) var<storage, read> outer_met: array<f32>;
@group(0) @binding(8) var<storage, read> outer_lower: array<vec4f>;
@group(0) @binding(9) var<storage, read> outer_upper: array<vec4f>;

struct EnterParams {
    side: vec3f,        // way that light flies in which it enters; 0: all
    most: f32,
    outer: vec3u,       // cells of the volume outside, half as fine
    outer_cells: u32,
    first: vec3u,       // that of them with which this volume begins
    pad: u32,
}

// Faces of a cell outside lie before four of the border.
const QUARTER: f32 = 0.25;

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

@compute @workgroup_size(64)
fn enter(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let at = cell_place(volume, i % volume.cells);
    let within = entering.first + at / 2u;
    let number = (within.z * entering.outer.y + within.y) * entering.outer.x + within.x;
    let strides = vec3u(1u, entering.outer.x, entering.outer.x * entering.outer.y);
    let channel = (i / volume.cells) * entering.outer_cells;
    var sum = vec4f(0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let unit = vec3f(vec3u(axis) == vec3u(0u, 1u, 2u));
        let asked = dot(entering.side, unit);
        let all_ways = all(entering.side == vec3f(0.0));
        let low = at[axis] == 0u && within[axis] > 0u;
        let high = at[axis] + 1u == volume.size[axis] && within[axis] + 1u < entering.outer[axis];
        // Upwards through the lower border, from the middle of the cell below, if no surface lies before the border.
        let met = outer_met[axis * entering.outer_cells + select(number, number - strides[axis], low)];
        let up = low && (all_ways || asked > 0.0) && met >= 0.5;
        let down = high && (all_ways || asked < 0.0) && (met < 0.5 || met == NOWHERE);
        let below = outer_upper[channel + select(number, number - strides[axis], up)][axis];
        let above = outer_lower[channel + select(number, number + strides[axis], down)][axis];
        sum += select(vec4f(0.0), QUARTER * below * vec4f(1.0, LOBE * unit), up);
        sum += select(vec4f(0.0), QUARTER * above * vec4f(1.0, -LOBE * unit), down);
    }
    if sum.x > 0.0 {
        flow[i] = limited(flow[i] + sum, entering.most);
    }
}
