// Irradiance at receivers from the light that passed the cells before them [KD10 Sec. 3.6].
// In: receivers, the sum over all steps, open faces. Out: irradiance.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{CLEAR, Volume, cell_number, face_bit};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

struct LookUpParams {
    mean: f32,          // irradiance of a unit of each coefficient
    along: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<uniform> params: LookUpParams;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> total: array<vec4f>;
@group(0) @binding(4) var<storage, read> open: array<u32>;
@group(0) @binding(5) var<storage, read_write> irradiance: array<vec4f>;

// Where among the cells a receiver looks, in cells: half a cell before it, so that the cell there lies on its side.
fn looked_at(r: Receiver) -> vec3f {
    let n = r.normal_geo;
    let before = 0.5 * CLEAR * (abs(n.x) + abs(n.y) + abs(n.z));
    let place = (r.origin - volume.corner) / volume.edge + before * n;
    return clamp(place, vec3f(0.0), vec3f(volume.size) - 0.001);
}

// Of the cells about a place: share of a cell by the trilinear weights, less where its middle is nearer to the receiver's
// plane than half a cell, and none where a surface lies between it and the cell that the receiver looks from.
fn share_of(r: Receiver, place: vec3f, own: vec3u, mask: u32, beside: vec3<bool>) -> f32 {
    let away = fract(place) - 0.5;
    let weights = select(1.0 - abs(away), abs(away), beside);
    var share = weights.x * weights.y * weights.z;
    let step = select(vec3f(0.0), sign(away), beside);
    let middle = volume.corner + (vec3f(own) + 0.5 + step) * volume.edge;
    share *= clamp(2.0 * dot(middle - r.origin, r.normal_geo) / volume.edge, 0.0, 1.0);
    for (var axis = 0u; axis < 3u; axis++) {
        if beside[axis] && (mask & face_bit(axis, away[axis] > 0.0)) == 0u {
            share = 0.0;
        }
    }
    return share;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || receivers[i].pixel == INACTIVE {
        return;
    }
    let r = receivers[i];
    let place = looked_at(r);
    let own = vec3u(place);
    let mask = open[cell_number(volume, own)];
    var sum = mat3x4f();
    var shares = 0.0;
    for (var corner = 0u; corner < 8u; corner++) {
        let beside = vec3<bool>((corner & 1u) != 0u, (corner & 2u) != 0u, (corner & 4u) != 0u);
        let share = share_of(r, place, own, mask, beside);
        if share > 0.0 {
            let step = select(vec3i(0), vec3i(sign(fract(place) - 0.5)), beside);
            let cell = cell_number(volume, vec3u(vec3i(own) + step));
            shares += share;
            for (var channel = 0u; channel < 3u; channel++) {
                sum[channel] += share * total[channel * volume.cells + cell];
            }
        }
    }
    // Light arrives against the normal.
    let facing = vec4f(params.mean, -params.along * r.normal_shade);
    let found = vec3f(dot(sum[0], facing), dot(sum[1], facing), dot(sum[2], facing)) / max(shares, 1e-6);
    irradiance[r.pixel] = vec4f(max(found, vec3f(0.0)), 0.0);
}
