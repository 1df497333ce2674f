// Voxel shadow: which samples of one light each receiver sees through the voxels [NPW10 Sec. 3.3.1].
// In     receivers; points, patterns x strata samples on the light; voxel_bits
// Out    visibility: as `shadow` writes it
//        asked: as the entry of that name in `shadow`
// Rule   main, asked: in equal steps; main_dda, asked_dda: voxel by voxel. Both ends of a ray are moved off their
//        surfaces, by `voxels.bias` voxels along the normal there [NPW10 Sec. 4.3; Deviation: the end on the light as
//        well, so that a ceiling does not hide the light below it].

import package::common::grid::{Grid, item_index};
import package::common::ray::Receiver;
import package::common::shadow_query::{ShadowParams, faces};
import package::common::voxel_march::{Segment, meets_by_voxels, meets_in_steps, segment_of};

const SIZE: u32 = 64u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> params: ShadowParams;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> points: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> visibility: array<u32>;

// From a receiver to a sample; a spot has no surface, so its end moves towards the receiver.
fn segment(receiver: Receiver, point: vec3f) -> Segment {
    let d = point - receiver.origin;
    let lit = select(-params.light_normal, params.light_normal, dot(params.light_normal, d) < 0.0);
    let m = select(lit, -normalize(d), params.cos_cutoff > -1.0);
    return segment_of(receiver.origin, receiver.normal_geo, point, m);
}

fn hidden(receiver: Receiver, point: vec4f, dda: bool) -> bool {
    if !(point.w > 0.0) {
        return true;
    }
    let s = segment(receiver, point.xyz);
    if dda {
        return meets_by_voxels(s);
    }
    return meets_in_steps(s);
}

// Bits of the strata from `first` on, at most 32: of all, or of those in `asked`.
fn bits_of(receiver: Receiver, first: u32, asked: u32, some: bool, dda: bool) -> u32 {
    let row = receiver.pattern * params.strata;
    let count = min(params.strata - first, 32u);
    let all = 0xffffffffu >> (32u - count);
    var todo = select(all, all & asked, some);
    var bits = todo;
    while todo != 0u {
        let k = firstTrailingBit(todo);
        todo &= todo - 1u;
        let point = points[row + first + k];
        let facing = faces(params, receiver, point.xyz - receiver.origin);
        // What does not face stays when it was asked for, and is not seen when all are.
        var gone = !facing && !some;
        if facing {
            gone = hidden(receiver, point, dda);
        }
        if gone {
            bits &= ~(1u << k);
        }
    }
    return bits;
}

fn answer(item: u32, some: bool, dda: bool) {
    let index = item % params.receivers;
    let word = item / params.receivers;
    let at = index * params.words + word;
    let receiver = receivers[index];
    var bits = 0u;
    if receiver.pattern < params.patterns {
        bits = bits_of(receiver, 32u * word, visibility[at], some, dda);
    }
    visibility[at] = bits;
}

@compute @workgroup_size(SIZE)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        answer(item, false, false);
    }
}

@compute @workgroup_size(SIZE)
fn asked(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        answer(item, true, false);
    }
}

@compute @workgroup_size(SIZE)
fn main_dda(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        answer(item, false, true);
    }
}

@compute @workgroup_size(SIZE)
fn asked_dda(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        answer(item, true, true);
    }
}
