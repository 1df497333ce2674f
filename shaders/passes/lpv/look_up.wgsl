// Irradiance at receivers from the light that passed the cells before them [KD10 Sec. 3.6].
// In: receivers, the sum over all steps, open faces, and where surfaces close the others. Out: irradiance.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{CLEAR, NOWHERE, Volume, cell_beside, cell_number, face_bit};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

struct LookUpParams {
    scale: f32,         // irradiance of a unit of mean that left through a face
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<uniform> params: LookUpParams;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> passed_lower: array<vec4f>;
@group(0) @binding(4) var<storage, read> passed_upper: array<vec4f>;
@group(0) @binding(5) var<storage, read> open: array<u32>;
@group(0) @binding(6) var<storage, read> met: array<f32>;
@group(0) @binding(7) var<storage, read_write> irradiance: array<vec4f>;

// 1: the volume lies inside of another, whose irradiance is there.
override NESTED: u32 = 0u;
// Cells over which it goes over into that.
const BLENDED: f32 = 2.0;

// Share of the own cell by its distance from the receiver's plane, at least.
const LEAST: f32 = 0.05;

// Where among the cells a receiver looks, in cells: half a cell before it, so that the cell there lies on the right side of it.
fn looked_at(r: Receiver) -> vec3f {
    let n = r.normal_geo;
    let before = 0.5 * CLEAR * (abs(n.x) + abs(n.y) + abs(n.z));
    let place = (r.origin - volume.corner) / volume.edge + before * n;
    return clamp(place, vec3f(0.0), vec3f(volume.size) - 0.001);
}

// Share of a volume inside of another: none on its border, where light of surfaces outside is missing.
fn share_of_volume(r: Receiver) -> f32 {
    let place = (r.origin - volume.corner) / volume.edge;
    let inside = min(place, vec3f(volume.size) - place);
    return clamp(min(inside.x, min(inside.y, inside.z)) / BLENDED, 0.0, 1.0);
}

// The cell that a place is in, or the one beside it where a surface between their middles lies nearer to this one's
// middle than the place does: then the other's is on the place's side.
fn seen_from(place: vec3f) -> vec3u {
    var own = vec3u(place);
    for (var axis = 0u; axis < 3u; axis++) {
        let middle = f32(own[axis]) + 0.5;
        let up = place[axis] > middle;
        let cell = cell_number(volume, own);
        if (up && own[axis] + 1u < volume.size[axis]) || (!up && own[axis] > 0u) {
            let lower = select(cell_beside(volume, cell, axis, false), cell, up);
            let surface = met[axis * volume.cells + lower];
            let at = middle + surface - select(1.0, 0.0, up);
            if surface != NOWHERE && select(place[axis] < at, place[axis] > at, up) {
                own[axis] = select(own[axis] - 1u, own[axis] + 1u, up);
            }
        }
    }
    return own;
}

// Of the cells about a place: share of a cell by the trilinear weights, less where its middle is nearer to the receiver's
// plane than half a cell, and none where a surface lies between it and the cell that the receiver looks from.
fn share_of(r: Receiver, away: vec3f, own: vec3u, mask: u32, beside: vec3<bool>) -> f32 {
    // The place may lie outside of its own cell.
    let far = min(abs(away), vec3f(0.5));
    let weights = select(1.0 - far, far, beside);
    let step = select(vec3f(0.0), sign(away), beside);
    let middle = volume.corner + (vec3f(own) + 0.5 + step) * volume.edge;
    let least = select(LEAST, 0.0, any(beside));
    var share = weights.x * weights.y * weights.z;
    share *= clamp(2.0 * dot(middle - r.origin, r.normal_geo) / volume.edge, least, 1.0);
    for (var axis = 0u; axis < 3u; axis++) {
        if beside[axis] && (mask & face_bit(axis, away[axis] > 0.0)) == 0u {
            share = 0.0;
        }
    }
    return share;
}

// What falls on a surface of normal n of what left through a cell's lower and upper faces. What falls on its two sides is
// apart by the net flow along n, and together about the faces' mean by the squares of n. It is no less than what the
// faces' own weighted by those squares are, and no more than if all of it came against n.
fn towards(n: vec3f, lower: vec3f, upper: vec3f) -> f32 {
    let falling = max(select(upper, lower, n > vec3f(0.0)), vec3f(0.0));
    let sides = dot(n, lower - upper) + dot(n * n, lower + upper);
    return clamp(0.5 * sides, dot(n * n, falling), dot(abs(n), falling));
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
    let taken = select(1.0, share_of_volume(r), NESTED == 1u);
    if taken == 0.0 {
        return;
    }
    let place = looked_at(r);
    let own = seen_from(place);
    let away = place - (vec3f(own) + 0.5);
    let mask = open[cell_number(volume, own)];
    var lower = mat3x3f();
    var upper = mat3x3f();
    var shares = 0.0;
    for (var corner = 0u; corner < 8u; corner++) {
        let beside = vec3<bool>((corner & 1u) != 0u, (corner & 2u) != 0u, (corner & 4u) != 0u);
        let share = share_of(r, away, own, mask, beside);
        if share > 0.0 {
            let step = select(vec3i(0), vec3i(sign(away)), beside);
            let cell = cell_number(volume, vec3u(vec3i(own) + step));
            shares += share;
            for (var channel = 0u; channel < 3u; channel++) {
                let i = channel * volume.cells + cell;
                lower[channel] += share * passed_lower[i].xyz;
                upper[channel] += share * passed_upper[i].xyz;
            }
        }
    }
    let n = r.normal_shade;
    let found = vec3f(towards(n, lower[0], upper[0]), towards(n, lower[1], upper[1]), towards(n, lower[2], upper[2]));
    let light = vec4f(found * params.scale / max(shares, 1e-6), 0.0);
    if NESTED == 1u {
        irradiance[r.pixel] = mix(irradiance[r.pixel], light, taken);
    } else {
        irradiance[r.pixel] = light;
    }
}
