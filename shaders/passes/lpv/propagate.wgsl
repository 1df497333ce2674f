// One step of light from each cell to the six beside it [KD10 Sec. 3.5]: what flies through a face is the integral over
// the face's solid angle of what leaves the middle of the cell, and all of it arrives.
// Deviation: [KD10] takes the flux through each of the five other faces of the next cell and sends it on as a clamped
// cosine towards that face, which forgets within two cells where light was going: a ceiling 24 cells above a floor gets
// a fiftieth of its light. Here the flux keeps the directions in which it flies, as far as two bands can: a step is the
// sum of the projections onto the six solid angles, whose sum is the identity, so that flux and net flow are kept and
// no light grows in any number of steps. The host's five coefficients make either of it.
// In: flow of the last step, open faces. Out: that of this step. In and out: sum over the steps.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{LOBE, Volume, limited};

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

// What comes to a cell along an axis, `unit` in its flow: of the light of the cells below and above it, zero where the face
// is closed, and of its own that closed faces send back.
fn along_axis(own: vec4f, below: vec4f, above: vec4f, closed: vec2f, unit: vec4f) -> vec4f {
    let both = below + above;
    let apart = below - above;
    let mean = params.mean_of_mean * both.x + params.mean_of_along * dot(apart, unit);
    let net = params.along_of_mean * apart.x + (params.along_of_along - params.across) * dot(both, unit);
    // Diffusely, all channels alike.
    let out_of = params.mean_of_mean * own.x + vec2f(-1.0, 1.0) * params.mean_of_along * dot(own, unit);
    let back = params.reflected * closed * out_of;
    return vec4f(mean + back.x + back.y, params.across * both.yzw) + unit * (net + LOBE * (back.x - back.y));
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
    let strides = vec3u(1u, volume.size.x, volume.size.x * volume.size.y);
    for (var axis = 0u; axis < 3u; axis++) {
        let bits = (vec2u(mask) >> (vec2u(2u * axis) + vec2u(0u, 1u))) & vec2u(1u);
        let is_open = bits == vec2u(1u);
        let step = select(vec2u(0u), vec2u(strides[axis]), is_open);
        let below = select(vec4f(0.0), flow[i - step.x], is_open.x);
        let above = select(vec4f(0.0), flow[i + step.y], is_open.y);
        let unit = vec4f(vec4u(0u, 1u, 2u, 3u) == vec4u(axis + 1u));
        sum += along_axis(own, below, above, select(vec2f(1.0), vec2f(0.0), is_open), unit);
    }
    let made = limited(sum, params.most);
    next[i] = made;
    total[i] += made;
}
