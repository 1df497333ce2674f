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
import package::common::voxel_march::{Segment, segment_of};
import package::common::voxel_steps::meets_in_steps;
import package::common::voxel_walk::meets_by_voxels;

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

// What a workgroup marches: the rays of its 64 words of samples, side by side, however they are spread over the receivers.
// Else a thread with many rays would keep those waiting that have few.
var<workgroup> rays: array<u32, 2048>;          // 32 lane + sample
var<workgroup> asked_rays: atomic<u32>;
var<workgroup> gone: array<atomic<u32>, SIZE>;

// Samples of a word that may be seen: all, or those in `before`.
fn asked_of(receiver: Receiver, word: u32, before: u32, some: bool) -> u32 {
    let all = 0xffffffffu >> (32u - min(params.strata - 32u * word, 32u));
    return select(0u, select(all, all & before, some), receiver.pattern < params.patterns);
}

// Adds the rays to those samples that face the receiver. What does not face stays when it was asked for, and is not seen
// when all are. No order shows.
fn push(receiver: Receiver, word: u32, bits: u32, lane: u32, some: bool) {
    let row = select(0u, receiver.pattern, bits != 0u) * params.strata + 32u * word;
    var facing = 0u;
    for (var todo = bits; todo != 0u; todo &= todo - 1u) {
        let k = firstTrailingBit(todo);
        if faces(params, receiver, points[row + k].xyz - receiver.origin) {
            facing |= 1u << k;
        }
    }
    if !some {
        atomicOr(&gone[lane], bits & ~facing);
    }
    var at = atomicAdd(&asked_rays, countOneBits(facing));
    for (var todo = facing; todo != 0u; todo &= todo - 1u) {
        rays[at] = 32u * lane + firstTrailingBit(todo);
        at++;
    }
}

fn answer(first: u32, lane: u32, some: bool, dda: bool) {
    let item = first + lane;
    let inside = item < grid.end;
    let held = select(0u, item, inside);
    let index = held % params.receivers;
    let word = held / params.receivers;
    let at = index * params.words + word;
    let receiver = receivers[index];
    let bits = select(0u, asked_of(receiver, word, visibility[at], some), inside);
    atomicStore(&gone[lane], 0u);
    if lane == 0u {
        atomicStore(&asked_rays, 0u);
    }
    workgroupBarrier();
    push(receiver, word, bits, lane, some);
    workgroupBarrier();
    let count = atomicLoad(&asked_rays);
    for (var i = lane; i < count; i += SIZE) {
        let asking = first + rays[i] / 32u;
        let k = rays[i] % 32u;
        let other = receivers[asking % params.receivers];
        let point = points[other.pattern * params.strata + 32u * (asking / params.receivers) + k];
        if hidden(other, point, dda) {
            atomicOr(&gone[rays[i] / 32u], 1u << k);
        }
    }
    workgroupBarrier();
    if inside {
        visibility[at] = bits & ~atomicLoad(&gone[lane]);
    }
}

fn first_item(group: vec3u, groups: vec3u) -> u32 {
    return item_index(grid, group, groups, SIZE, 0u);
}

@compute @workgroup_size(SIZE)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    answer(first_item(group, groups), lane, false, false);
}

@compute @workgroup_size(SIZE)
fn asked(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    answer(first_item(group, groups), lane, true, false);
}

@compute @workgroup_size(SIZE)
fn main_dda(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    answer(first_item(group, groups), lane, false, true);
}

@compute @workgroup_size(SIZE)
fn asked_dda(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    answer(first_item(group, groups), lane, true, true);
}
