// Irradiance at each receiver from a cut of its own through the tree of virtual lights [NSW09 Sec. 3.5].
// In: receivers, the tree, maps. Out: irradiance, w: its mean over the channels with discs alone; in and out: how many nodes were evaluated.

import package::common::form_factor::{DISC, Lit, QUAD, disc_irradiance, is_near};
import package::common::grid::{Grid, item_index};
import package::common::light_cut::{
    after, below, first_visit, node_of, params, ranges, reference_irradiance, splits,
};
import package::common::near_lights::{MOST_NEAR, maps, near_irradiance, virtual_lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

override FORM: u32 = 1u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read_write> irradiance: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> evaluations: array<atomic<u32>>;

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
    var sum = vec3f(0.0);
    var near: array<u32, MOST_NEAR>;
    var nears = 0u;
    var count = 0u;
    var visit = first_visit();
    while !visit.end {
        if splits(at, visit, scale) {
            visit = below(visit);
        } else {
            let node = node_of(visit);
            let place = virtual_lights[4u * node];
            let facing = virtual_lights[4u * node + 1u];
            let flux = virtual_lights[4u * node + 2u].xyz;
            var light = disc_irradiance(at, place, facing, flux, FORM == DISC, params.reach);
            if FORM == QUAD {
                if is_near(at, place, facing) && nears < MOST_NEAR && any(flux > vec3f(0.0)) {
                    near[nears] = node;
                    nears++;
                    light = vec3f(0.0);
                }
            }
            sum += light;
            count++;
            visit = after(visit);
        }
    }
    var unshadowed = (sum.x + sum.y + sum.z) / 3.0;
    for (var k = 0u; k < nears; k++) {
        let light = near_irradiance(at, 4u * near[k], params.reach);
        unshadowed += light.w;
        sum += light.xyz;
    }
    irradiance[r.pixel] = vec4f(sum, unshadowed);
    // Two words, so that their sum may be larger than one.
    atomicAdd(&evaluations[0], count & 255u);
    atomicAdd(&evaluations[1], count >> 8u);
}
