// What lists of virtual lights need before they are refined [NW09 Sec. 4.1]:
//   middles   the shading point of every texel from level 1 on, its surface pixel nearest to its middle
//   estimate  irradiance of all virtual lights at those of the coarsest level,
//   mean      its mean, which differences are relative to,
//   table     the virtual lights with the difference that each may have. Deviation: those of N virtual lights add up like
//             sqrt(N), so that the threshold is one of all together
// In: G-buffer, instance_lobes, texel_state, virtual_lights. Out: points, table.

import package::common::fragment::LIT;
import package::common::grid::{Grid, item_index};
import package::common::lobe::instance_lobes;
import package::common::middle_pixel::{g_normal, middle_pixel};
import package::common::pyramid::{footprint, level_of, pyramid, texel_of};
import package::common::shaded_point::{ShadedPoint, ShortLight, no_point, shaded_point, shares};
import package::common::view::View;

struct VplPointsParams {
    lights: u32,
    reach: f32,
    threshold: f32,     // difference over the mean irradiance; negative: any
    first: u32,         // virtual light of this part
    end: u32,           // one past its last
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

override DISC: bool = false;
override GLOSSY: bool = false;

const ANY: f32 = 3.0e38;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplPointsParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(5) var<storage, read> texel_state: array<u32>;
@group(0) @binding(6) var<storage, read_write> points: array<ShadedPoint>;
@group(0) @binding(7) var<storage, read> virtual_lights: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> estimates: array<vec2f>;     // irradiance, 1 where there is a surface
@group(0) @binding(9) var<storage, read_write> mean_irradiance: array<f32>;
@group(0) @binding(10) var<storage, read_write> short_lights: array<ShortLight>;

var<workgroup> sums: array<vec2f, 64>;

fn short_light(i: u32, most: f32) -> ShortLight {
    let flux = virtual_lights[4u * i + 2u].xyz;
    return ShortLight(virtual_lights[4u * i], virtual_lights[4u * i + 1u], vec4f(flux, most));
}

@compute @workgroup_size(64)
fn middles(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let number = pyramid.levels[1].z + i;
    if (texel_state[number] & LIT) == 0u {
        points[i] = no_point();
        return;
    }
    let level = level_of(number);
    let size = pyramid.levels[level];
    let pixel = middle_pixel(footprint(level, texel_of(size, number - size.z)));
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    var surface = vec4f(0.0);
    if GLOSSY {
        surface = instance_lobes[g_albedo[at].w];
    }
    points[i] = shaded_point(g_position[at], g_normal[at], g_geometric[at], surface, view.eye);
}

@compute @workgroup_size(64)
fn estimate(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let number = pyramid.levels[pyramid.coarsest].z + i;
    let p = points[number - pyramid.levels[1].z];
    var sum = 0.0;
    for (var j = params.first; j < params.end; j++) {
        let light = short_light(j, 0.0);
        sum += dot(light.flux.xyz, vec3f(1.0 / 3.0)) * shares(p, light, DISC, params.reach, false).x;
    }
    let before = select(estimates[i].x, 0.0, params.first == 0u);
    estimates[i] = vec2f(before + sum, select(0.0, 1.0, (texel_state[number] & LIT) != 0u));
}

// One workgroup.
@compute @workgroup_size(64)
fn mean(@builtin(local_invocation_index) lane: u32) {
    var sum = vec2f(0.0);
    for (var i = lane; i < pyramid.levels[pyramid.coarsest].w; i += 64u) {
        sum += estimates[i];
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        mean_irradiance[0] = sums[0].x / max(sums[0].y, 1.0);
    }
}

@compute @workgroup_size(64)
fn table(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let all = params.threshold * mean_irradiance[0];
        let most = select(all * inverseSqrt(f32(params.lights)), ANY, params.threshold < 0.0);
        short_lights[i] = short_light(i, most);
    }
}
