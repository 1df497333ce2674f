// Radial basis functions as the paper's text has them, where that can be computed [KJ16 Eqs. 1 to 3]: levels up to 2 are
// copied, above three samples, no constant, and two samples averaged.
// In: fragments and their irradiance, border_samples, level_map. Out: irradiance a pixel.

import package::common::border_samples::LARGE;
import package::common::grid::{Grid, item_index};
import package::common::illumination::own_light;
import package::common::nearest_samples::{nearest_samples, with_nearest};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::radial_basis::{LEAST_PIVOT, Samples, basis};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> level_map: array<u32>;
@group(0) @binding(8) var<storage, read_write> direct_irradiance: array<vec4f>;

fn of_the_paper(s: Samples, here: vec2f, width: f32, own: vec3f) -> vec3f {
    let phi = vec3f(basis(here, s.place[0], width), basis(here, s.place[1], width), basis(here, s.place[2], width));
    if s.count == 2u {
        return (phi.x * s.light[0] + phi.y * s.light[1]) / max(phi.x + phi.y, 1e-30);
    }
    let near = basis(s.place[0], s.place[1], width);
    let far = basis(s.place[0], s.place[2], width);
    let beside = basis(s.place[1], s.place[2], width);
    let a = vec3f(1.0, near, far);
    let b = vec3f(near, 1.0, beside);
    let c = vec3f(far, beside, 1.0);
    // Columns a, b, c: rows of the inverse are these over the determinant.
    let volume = dot(a, cross(b, c));
    let weights = vec3f(dot(phi, vec3f(cross(b, c).x, cross(c, a).x, cross(a, b).x)),
        dot(phi, vec3f(cross(b, c).y, cross(c, a).y, cross(a, b).y)),
        dot(phi, vec3f(cross(b, c).z, cross(c, a).z, cross(a, b).z))) / volume;
    let sum = weights.x * s.light[0] + weights.y * s.light[1] + weights.z * s.light[2];
    return select(own, sum, s.count == 3u && abs(volume) > LEAST_PIVOT);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let level = level_map[i];
    var light = vec3f(0.0);
    if level <= pyramid.coarsest {
        let pixel = texel_of(pyramid.levels[0], i);
        let number = texel_number(pyramid.levels[level], pixel >> vec2u(level));
        light = own_light(number).xyz;
        if level >= LARGE {
            let row = number - pyramid.levels[LARGE].z;
            let first = vec2f((pixel >> vec2u(level)) << vec2u(level));
            let n = nearest_samples(row, vec2f(pixel) - first, true);
            var s: Samples;
            s = with_nearest(s, row, first, n.one, 0.0, true);
            s = with_nearest(s, row, first, n.two, 0.0, true);
            s = with_nearest(s, row, first, n.three, 0.0, true);
            light = of_the_paper(s, vec2f(pixel), f32(1u << level), light);
        }
    }
    direct_irradiance[i] = vec4f(light, 0.0);
}
