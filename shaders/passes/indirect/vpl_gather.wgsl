// Irradiance at each receiver from every virtual light of a list [NSW09 Sec. 3.2.2].
// In: receivers, the list, maps. Out: irradiance, w: its mean over the channels with
// discs alone.

import package::common::form_factor::{DISC, Lit, QUAD, disc_irradiance, is_near};
import package::common::grid::{Grid, item_index};
import package::common::near_lights::{MOST_NEAR, maps, near_irradiance, virtual_lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

struct VplGatherParams {
    count: u32,
    reach: f32,
    pad0: u32,
    pad1: u32,
}

override FORM: u32 = 0u;

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
    var sum = vec3f(0.0);
    var near: array<u32, MOST_NEAR>;
    var nears = 0u;
    for (var j = 0u; j < params.count; j++) {
        let place = virtual_lights[4u * j];
        let facing = virtual_lights[4u * j + 1u];
        let flux = virtual_lights[4u * j + 2u].xyz;
        var light = disc_irradiance(at, place, facing, flux, FORM == DISC, params.reach);
        if FORM == QUAD {
            if is_near(at, place, facing) && nears < MOST_NEAR && any(flux > vec3f(0.0)) {
                near[nears] = j;
                nears++;
                light = vec3f(0.0);
            }
        }
        sum += light;
    }
    var unshadowed = (sum.x + sum.y + sum.z) / 3.0;
    for (var k = 0u; k < nears; k++) {
        let light = near_irradiance(at, 4u * near[k], params.reach);
        unshadowed += light.w;
        sum += light.xyz;
    }
    irradiance[r.pixel] = vec4f(sum, unshadowed);
}
