// Irradiance at each receiver from a cut of its own through the tree of virtual lights [NSW09 Sec. 3.5].
// In: receivers, the tree, maps. Out: irradiance, w: its mean over the channels with discs alone; in and out: how many nodes were evaluated.

import package::common::evaluations::{evaluated, evaluations};
import package::common::form_factor::Lit;
import package::common::grid::{Grid, item_index};
import package::common::light_cut::{
    after, below, first_visit, node_of, params, ranges, reference_irradiance, splits,
};
import package::common::near_lights::{Gathered, gather_light, gathered_irradiance, maps, virtual_lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read_write> irradiance: array<vec4f>;

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
    let scale = reference_irradiance(at);
    var sum: Gathered;
    var count = 0u;
    var visit = first_visit();
    while !visit.end {
        if splits(at, visit, scale) {
            visit = below(visit);
        } else {
            gather_light(&sum, at, node_of(visit), params.reach);
            count++;
            visit = after(visit);
        }
    }
    irradiance[r.pixel] = gathered_irradiance(&sum, at, params.reach);
    evaluated(count);
}
