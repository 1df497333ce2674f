// Irradiance at each receiver from a cut of its own through the tree of virtual lights [NSW09 Sec. 3.5].
//   main  a thread for each receiver
//   wide  LANES threads for each, which share the nodes of the coarsest level: for a device with more threads than receivers
// In: receivers, the tree, maps. Out, after the first part also in: irradiance, w: its mean over the channels with discs
// alone; parts: what each part of the coarsest level, or each thread, has of that; in and out: how many nodes were evaluated.

import package::common::evaluations::{evaluated, evaluations};
import package::common::form_factor::Lit;
import package::common::grid::{Grid, item_index};
import package::common::light_cut::{
    after, below, first_visit, judged, node_of, params, ranges, reference_irradiance,
};
import package::common::near_lights::{Gathered, gather_light, gathered_irradiance, maps, virtual_lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

override LANES: u32 = 1u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read_write> irradiance: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> parts: array<f32>;

var<workgroup> estimates: array<f32, 64>;
var<workgroup> sums: array<vec4f, 64>;

// Irradiance from every LANES-th node of the coarsest level and what is below it, from `first` on.
fn cut_light(at: Lit, scale: f32, first: u32) -> vec4f {
    var sum: Gathered;
    var count = 0u;
    var visit = first_visit(first);
    while !visit.end {
        let known = judged(at, visit, scale);
        if known.split {
            visit = below(visit);
        } else {
            gather_light(&sum, at, node_of(visit), params.reach, known.most);
            count++;
            visit = after(visit, LANES);
        }
    }
    evaluated(count);
    return gathered_irradiance(&sum, at, params.reach);
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
    let at = Lit(r.origin, r.normal_shade, r.normal_geo);
    let light = cut_light(at, reference_irradiance(at, 0u, 1u), params.first_root);
    if params.parts == 1u {
        irradiance[r.pixel] = light;
        return;
    }
    parts[i * params.parts + params.part] = light.w;
    irradiance[r.pixel] = light + select(irradiance[r.pixel], vec4f(0.0), params.part == 0u);
}

@compute @workgroup_size(64)
fn wide(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    let r = receivers[min(item, grid.end - 1u) / LANES];
    let at = Lit(r.origin, r.normal_shade, r.normal_geo);
    let part = lane % LANES;
    let first = lane - part;
    let works = item < grid.end && r.pixel != INACTIVE;
    if works {
        estimates[lane] = reference_irradiance(at, part, LANES);
    }
    workgroupBarrier();
    if works {
        var scale = 0.0;
        for (var k = 0u; k < LANES; k++) {
            scale += estimates[first + k];
        }
        sums[lane] = cut_light(at, scale, part);
        parts[item] = sums[lane].w;
    }
    workgroupBarrier();
    if works && part == 0u {
        var all_of = vec4f(0.0);
        for (var k = 0u; k < LANES; k++) {
            all_of += sums[first + k];
        }
        irradiance[r.pixel] = all_of;
    }
}
