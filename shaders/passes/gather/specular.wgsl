// Radiance that the lobe of each receiver's surface reflects of one light, from its visible samples:
//   L += specular sum_i V_i L_i A/N f(w_i) cos_s cos_l / d^2,   f the Phong lobe [LW94; NPW10 Sec. 3.2.1]
// In: receivers, visibility bits, sample points and their radiance times area, instance_lobes. In and out:
// specular_radiance a pixel.

import package::common::gather_params::GatherParams;
import package::common::grid::{Grid, item_index};
import package::common::light::{SPOT, light_at, lights};
import package::common::lobe::{instance_lobes, lobe, mirrored};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;
import package::common::view::View;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> visibility: array<u32>;
@group(0) @binding(4) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(5) var<storage, read> light_radiance: array<vec4f>;
@group(0) @binding(6) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(7) var<storage, read_write> specular_radiance: array<vec4f>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || receivers[i].pattern == INACTIVE {
        return;
    }
    let r = receivers[i];
    let surface = instance_lobes[g_albedo[r.pixel].w];
    if all(surface.xyz == vec3f(0.0)) {
        return;
    }
    let light = light_at(params.light);
    let mirror = mirrored(normalize(r.origin - view.eye), r.normal_shade);
    let first = r.pattern * params.strata;
    var sum = vec3f(0.0);
    for (var k = 0u; k < params.strata; k++) {
        var seen = true;
        if params.words != 0u {
            seen = ((visibility[i * params.words + k / 32u] >> (k % 32u)) & 1u) != 0u;
        }
        let d = light_points[first + k].xyz - r.origin;
        let d2 = dot(d, d);
        let w = d * inverseSqrt(d2);
        let cos_s = dot(r.normal_shade, w);
        var cos_l = -dot(light.normal, w);
        if light.kind == SPOT {
            cos_l = select(0.0, 1.0, cos_l >= light.cos_cutoff);
        } else if light.two_sided {
            cos_l = abs(cos_l);
        }
        if seen && dot(r.normal_geo, w) > 0.0 && cos_s > 0.0 && cos_l > 0.0 && d2 > 0.0 {
            sum += light_radiance[k].xyz * (lobe(mirror, w, surface.w) * cos_s * cos_l / d2);
        }
    }
    specular_radiance[r.pixel] += vec4f(surface.xyz * sum, 0.0);
}
