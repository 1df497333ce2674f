// Irradiance at each receiver from every virtual light of a list [NSW09 Sec. 3.2.2].
// In: receivers, the list, maps. Out, after the first part also in: irradiance, w: its mean over the channels with discs
// alone; parts: what each part of the list has of that, where there is more than one.

import package::common::form_factor::Lit;
import package::common::grid::{Grid, item_index};
import package::common::near_lights::{Gathered, gather_light, gathered_irradiance, maps, virtual_lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

struct VplGatherParams {
    first: u32,     // virtual light of this part
    end: u32,       // one past its last
    reach: f32,
    part: u32,
    parts: u32,     // of the list
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplGatherParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(4) var<storage, read_write> irradiance: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> parts: array<f32>;

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
    for (var j = params.first; j < params.end; j++) {
        gather_light(&sum, at, j, params.reach, 3.0e38);
    }
    let light = gathered_irradiance(&sum, at, params.reach);
    if params.parts == 1u {
        irradiance[r.pixel] = light;
        return;
    }
    parts[i * params.parts + params.part] = light.w;
    irradiance[r.pixel] = light + select(irradiance[r.pixel], vec4f(0.0), params.part == 0u);
}
