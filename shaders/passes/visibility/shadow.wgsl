// Shadow: which samples of one light each receiver sees.
// In     receivers; points, patterns x strata samples on the light, their fourth number the largest t; the trees
// Out    visibility: `words` words a receiver, bit k % 32 of word k / 32 set when sample k faces the surface, the
//        light emits towards it and nothing is in between; counter: how many rays that took
//        asked: on entry a set bit asks for its sample; it stays when nothing is in between, and without a ray when
//        the sample does not face the surface or the light does not emit towards it
// Rule   an item is one word of one receiver; word after word, so that neighbouring threads trace from neighbouring
//        receivers to the same stratum.

import package::common::bvh::{active_ray, trace_ray};
import package::common::grid::{Grid, item_index};
import package::common::ray::{MISS, Ray, Receiver};
import package::common::ray_counter::{add_rays, count_rays};
import package::common::shadow_query::{ShadowParams, faces};

const SIZE: u32 = 64u;

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> params: ShadowParams;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> points: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> visibility: array<u32>;

// Nothing lies between the receiver and the sample.
fn sees(ray: Ray) -> bool {
    count_rays(1u);
    return active_ray(ray) && trace_ray(ray, true).instance == MISS;
}

fn ray_to(receiver: Receiver, point: vec4<f32>) -> Ray {
    return Ray(receiver.origin, 0.0, point.xyz - receiver.origin, point.w);
}

// Bits of the strata from `first` on, at most 32.
fn visible_bits(receiver: Receiver, first: u32) -> u32 {
    var bits = 0u;
    let row = receiver.pattern * params.strata;
    let count = min(params.strata - first, 32u);
    for (var k = 0u; k < count; k++) {
        let ray = ray_to(receiver, points[row + first + k]);
        if faces(params, receiver, ray.direction) && sees(ray) {
            bits |= 1u << k;
        }
    }
    return bits;
}

// Those of the asked bits that nothing hides.
fn bits_left(receiver: Receiver, first: u32, asked: u32) -> u32 {
    let row = receiver.pattern * params.strata;
    let count = min(params.strata - first, 32u);
    var todo = asked & (0xffffffffu >> (32u - count));
    var bits = todo;
    while todo != 0u {
        let k = firstTrailingBit(todo);
        todo &= todo - 1u;
        let ray = ray_to(receiver, points[row + first + k]);
        if faces(params, receiver, ray.direction) && !sees(ray) {
            bits &= ~(1u << k);
        }
    }
    return bits;
}

@compute @workgroup_size(SIZE)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        let index = item % params.receivers;
        let word = item / params.receivers;
        let receiver = receivers[index];
        var bits = 0u;
        if receiver.pattern < params.patterns {
            bits = visible_bits(receiver, 32u * word);
        }
        visibility[index * params.words + word] = bits;
    }
    add_rays(lane);
}

@compute @workgroup_size(SIZE)
fn asked(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        let index = item % params.receivers;
        let word = item / params.receivers;
        let at = index * params.words + word;
        let receiver = receivers[index];
        var bits = 0u;
        if receiver.pattern < params.patterns {
            bits = bits_left(receiver, 32u * word, visibility[at]);
        }
        visibility[at] = bits;
    }
    add_rays(lane);
}
