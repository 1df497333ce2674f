// One step of light from each cell to the six beside it [KD10 Sec. 3.5]: what flies through a face is the integral over
// the face's solid angle of what leaves the middle of the cell, and all of it arrives.
// Deviation: [KD10] takes the flux through each of the five other faces of the next cell and sends it on as a clamped
// cosine towards that face, which forgets within two cells where light was going: a ceiling 24 cells above a floor gets
// a fiftieth of its light. Here the flux keeps the directions in which it flies, as far as two bands can: a step is the
// sum of the projections onto the six solid angles, whose sum is the identity, so that flux and net flow are kept and
// no light grows in any number of steps. The host's five coefficients make either of it.
// In: flow of the last step, open faces. Out: that of this step. In and out: sum over the steps.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{LOBE, Volume, cell_beside, face_bit, limited};

struct PropagateParams {
    mean_of_mean: f32,
    mean_of_along: f32,
    along_of_mean: f32,
    along_of_along: f32,
    across: f32,
    most: f32,          // largest net flow, as a share
    reflected: f32,     // share of what closed faces get that they send back
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<uniform> params: PropagateParams;
@group(0) @binding(2) var<storage, read> flow: array<vec4f>;
@group(0) @binding(3) var<storage, read> open: array<u32>;
@group(0) @binding(4) var<storage, read_write> next: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> total: array<vec4f>;

// What arrives of `source` that flies along an axis, upwards or downwards.
fn arrived(source: vec4f, axis: u32, up: bool) -> vec4f {
    let sign = select(-1.0, 1.0, up);
    let along = source[axis + 1u];
    var to = params.across * source;
    to.x = params.mean_of_mean * source.x + sign * params.mean_of_along * along;
    to[axis + 1u] = sign * params.along_of_mean * source.x + params.along_of_along * along;
    return to;
}

// What a closed face sends back of `own`: diffusely, all channels alike.
fn sent_back(own: vec4f, axis: u32, up: bool) -> vec4f {
    let sign = select(-1.0, 1.0, up);
    var back = vec4f(0.0);
    back.x = params.reflected * (params.mean_of_mean * own.x + sign * params.mean_of_along * own[axis + 1u]);
    back[axis + 1u] = -sign * LOBE * back.x;
    return back;
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
    let cell = i % volume.cells;
    let mask = open[cell];
    let own = flow[i];
    var sum = vec4f(0.0);
    for (var face = 0u; face < 6u; face++) {
        let axis = face / 2u;
        let up = (face & 1u) == 1u;
        if (mask & face_bit(axis, up)) != 0u {
            // What comes in through the upper face flies downwards.
            sum += arrived(flow[i - cell + cell_beside(volume, cell, axis, up)], axis, !up);
        } else {
            sum += sent_back(own, axis, up);
        }
    }
    let made = limited(sum, params.most);
    next[i] = made;
    total[i] += made;
}
