// Irradiance of one light at each receiver, from its visible samples:
//   E += sum_i V_i L_i A/N cos_s cos_l / d^2   [NPW10 Eq. 2; Deviation: N samples, radiance L, A(y_i) = A/N]
// In: receivers, visibility bits, sample points and their radiance times area. In and out: irradiance a pixel.

import package::common::gather_params::GatherParams;
import package::common::grid::{Grid, item_index};
import package::common::light::{SPOT, light_at, lights};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> visibility: array<u32>;
@group(0) @binding(3) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(4) var<storage, read> light_radiance: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> direct_irradiance: array<vec4f>;

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
    let light = light_at(params.light);
    let first = r.pattern * params.strata;
    var sum = vec3f(0.0);
    for (var k = 0u; k < params.strata; k++) {
        var seen = true;
        if params.words != 0u {
            seen = ((visibility[i * params.words + k / 32u] >> (k % 32u)) & 1u) != 0u;
        }
        let d = light_points[first + k].xyz - r.origin;
        let d2 = dot(d, d);
        let inverse = inverseSqrt(d2);
        // The unit vector first: powers of d overflow and underflow sooner than its cosines.
        let w = d * inverse;
        let cos_geo = dot(r.normal_geo, w);
        let cos_s = dot(r.normal_shade, w);
        var cos_l = -dot(light.normal, w);
        if light.kind == SPOT {
            cos_l = select(0.0, 1.0, cos_l >= light.cos_cutoff);
        } else if light.two_sided {
            cos_l = abs(cos_l);
        }
        if seen && cos_geo > 0.0 && cos_s > 0.0 && cos_l > 0.0 && d2 > 0.0 {
            sum += light_radiance[k].xyz * (cos_s * cos_l / d2);
        }
    }
    direct_irradiance[r.pixel] += vec4f(sum, 0.0);
}
