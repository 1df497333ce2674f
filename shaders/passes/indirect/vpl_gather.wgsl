// Irradiance at each receiver from every virtual light of a list [NSW09 Sec. 3.2.2].
// In: receivers, the list, maps. Out: irradiance, w: its mean over the channels with
// discs alone.

import package::common::form_factor::Lit;
import package::common::grid::{Grid, item_index};
import package::common::near_lights::{Gathered, gather_light, gathered_irradiance, maps, virtual_lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

struct VplGatherParams {
    count: u32,
    reach: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplGatherParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(4) var<storage, read_write> irradiance: array<vec4f>;

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
    var sum: Gathered;
    for (var j = 0u; j < params.count; j++) {
        gather_light(&sum, at, j, params.reach);
    }
    irradiance[r.pixel] = gathered_irradiance(&sum, at, params.reach);
}
