// Irradiance of one area light at each receiver: the exact unshadowed integral times the visible share of the samples.
//   E += E_polygon(x) sum_i V_i L_i w_i / (L sum_i w_i),  w_i = cos_s cos_l / d^2   [HHM18]
// Where everything is seen the second factor is 1 and no sampling error is left; in shadow it is 0; between them the
// noise is that of visibility alone. L is the light's mean radiance, a channel each, so that textures are right as well.
// In: receivers, visibility bits, sample points and their radiance times area. In and out: irradiance a pixel.

import package::common::gather_params::GatherParams;
import package::common::grid::{Grid, item_index};
import package::common::light::{Light, light_at, lights};
import package::common::polygon::parallelogram_irradiance;
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> visibility: array<u32>;
@group(0) @binding(3) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(4) var<storage, read> light_radiance: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> direct_irradiance: array<vec4f>;

fn unshadowed(r: Receiver, light: Light) -> f32 {
    let corner = light.corner - r.origin;
    if !light.two_sided && dot(light.normal, corner) >= 0.0 {
        return 0.0;
    }
    return parallelogram_irradiance(r.normal_shade, r.normal_geo, corner, light.edge_u, light.edge_v);
}

// Visible share of the light at receiver i, a channel each.
fn visible_share(i: u32, r: Receiver, light: Light) -> vec3f {
    var seen = vec3f(0.0);
    var all_of_it = 0.0;
    for (var k = 0u; k < params.strata; k++) {
        let d = light_points[r.pattern * params.strata + k].xyz - r.origin;
        let d2 = dot(d, d);
        let w = d * inverseSqrt(d2);
        let cos_s = dot(r.normal_shade, w);
        var cos_l = -dot(light.normal, w);
        cos_l = select(cos_l, abs(cos_l), light.two_sided);
        if !(d2 > 0.0) || cos_s <= 0.0 || cos_l <= 0.0 || dot(r.normal_geo, w) <= 0.0 {
            continue;
        }
        let weight = cos_s * cos_l / d2;
        all_of_it += weight;
        if params.words == 0u || ((visibility[i * params.words + k / 32u] >> (k % 32u)) & 1u) != 0u {
            seen += weight * light_radiance[k].xyz;
        }
    }
    let share = light.radiance * (light.area / f32(params.strata)) * all_of_it;
    // A sliver of light above the horizon that no sample fell into: too little to ask for a ray of its own.
    return select(vec3f(1.0), select(vec3f(0.0), seen / share, share > vec3f(0.0)), all_of_it > 0.0);
}

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
    let irradiance = unshadowed(r, light);
    if !(irradiance > 0.0) {
        return;
    }
    var share = vec3f(1.0);
    if params.words != 0u || light.texels != 0u {
        share = visible_share(i, r, light);
    }
    direct_irradiance[r.pixel] += vec4f(light.radiance * irradiance * share, 0.0);
}
