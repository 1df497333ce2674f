// Interpolation by radial basis functions in a single pass [KJ16 Sec. 3.1.5]: each pixel of a fragment above level 0 takes
// the light of the fragments nearest to it that lie on its own surface, whatever their levels.
//   Phi_ij = exp(-|x_i - x_j|^2 / (C s^2)),  [[Phi, 1], [1^T, 0]] [w; b] = [I; 0],  I(x) = sum_i w_i phi_i(x) + b
// with s the width of the pixel's fragment. Deviations: distances between samples, one s and the constant b, so that Phi is
// symmetric and a constant stays one; clamped to the range of its samples; fragments of levels 1 and 2, too.
// Entry `paper` is the text as it stands, where it can be computed: each sample with its own width, no constant, levels up
// to 2 copied, two samples averaged.
// In: fragments and their irradiance, level_map, G-buffer. Out: irradiance a pixel.

import package::common::alike::MOST_TURNED;
import package::common::fragment::CULLED;
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::illumination::{MOST_OFF, fragment_at, fragment_irradiance, own_light};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::radial_basis::{LEAST_PIVOT, Samples, basis, weights_at};
import package::common::view::View;

struct RbfParams {
    samples: u32,       // at most 4
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: RbfParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> level_map: array<u32>;
@group(0) @binding(3) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(8) var<storage, read_write> direct_irradiance: array<vec4f>;

// Samples nearer to each other than this, in widths of the fragment, are one.
const CLOSE: f32 = 0.125;
const FAR: f32 = 1e30;

// A fragment beside a pixel: 1 + its number, 0 for none; its middle and width.
struct Beside {
    fragment: u32,
    place: vec2f,
    width: f32,
}

// What a pixel sees, and how far off its plane something may lie.
struct Seen {
    pixel: vec2u,
    position: vec3f,
    normal: vec3f,
    across: vec3f,
    reach: f32,
}

fn seen_at(pixel: vec2u, at: u32, level: u32) -> Seen {
    let p = floats(g_position[at]);
    let depth = max(dot(view.eye - p, view.backward), 1e-30);
    let reach = MOST_OFF * f32(1u << level) * pyramid.pixel_width * depth;
    return Seen(pixel, p, floats(g_normal[at]), floats(g_geometric[at]), reach);
}

// Whether pixel `other` lies on the same surface.
fn on_surface(seen: Seen, other: u32) -> bool {
    let there = g_normal[other];
    let off = abs(dot(seen.across, floats(g_position[other]) - seen.position));
    let turned = floats(there) - seen.normal;
    return there.w == SURFACE && off < seen.reach && dot(turned, turned) < MOST_TURNED * MOST_TURNED;
}

// The fragment at the pixel that is nearest to the one seen, in neighbour k of 9 of its texel of `level`.
fn beside(seen: Seen, level: u32, k: u32) -> Beside {
    let texel = vec2i(seen.pixel >> vec2u(level)) + vec2i(i32(k % 3u), i32(k / 3u)) - 1;
    let none = Beside(0u, vec2f(0.0), 1.0);
    // A negative column is a large one as well.
    if any(vec2u(texel) >= pyramid.levels[level].xy) {
        return none;
    }
    let first = vec2u(texel) << vec2u(level);
    let last = min(first + (1u << level), pyramid.levels[0].xy) - 1u;
    let near = clamp(seen.pixel, first, last);
    let other = near.y * pyramid.levels[0].x + near.x;
    let own = level_map[other];
    if own > pyramid.coarsest || !on_surface(seen, other) {
        return none;
    }
    let place = near >> vec2u(own);
    let fragment = fragment_at[texel_number(pyramid.levels[own], place)];
    let width = f32(1u << own);
    // The pixel in the middle of a fragment lies half a pixel beyond the middle.
    let middle = (vec2f(place) + 0.5) * width + select(0.0, 0.5, own > 0u);
    return Beside(select(fragment, 0u, fragment == CULLED), middle, width);
}

// The nearest fragments on the surface, each once, and none beside another.
fn samples_of(pixel: vec2u, at: u32, level: u32, most: u32) -> Samples {
    let seen = seen_at(pixel, at, level);
    var all: array<Beside, 9>;
    for (var k = 0u; k < 9u; k++) {
        all[k] = beside(seen, level, k);
    }
    let here = vec2f(pixel) + 0.5;
    let close = CLOSE * f32(1u << level);
    var found: Samples;
    for (var n = 0u; n < most; n++) {
        var nearest = FAR;
        var chosen = 0u;
        for (var k = 0u; k < 9u; k++) {
            let step = all[k].place - here;
            let far = dot(step, step);
            var counts = all[k].fragment != 0u && far < nearest;
            for (var m = 0u; m < found.count; m++) {
                counts = counts && distance(all[k].place, found.place[m]) > close;
            }
            nearest = select(nearest, far, counts);
            chosen = select(chosen, k, counts);
        }
        if nearest < FAR {
            found.place[found.count] = all[chosen].place;
            found.width[found.count] = all[chosen].width;
            found.light[found.count] = fragment_irradiance[all[chosen].fragment - 1u].xyz;
            found.count++;
        }
    }
    return found;
}

fn interpolated(s: Samples, here: vec2f, width: f32) -> vec3f {
    let weights = weights_at(s, here, width);
    var sum = vec3f(0.0);
    var lo = vec3f(FAR);
    var hi = vec3f(-FAR);
    for (var i = 0u; i < 4u; i++) {
        sum += weights[i] * s.light[i];
        lo = select(lo, min(lo, s.light[i]), i < s.count);
        hi = select(hi, max(hi, s.light[i]), i < s.count);
    }
    return clamp(sum, lo, hi);
}

// [KJ16 Eqs. 1 to 3], literally.
fn of_the_paper(s: Samples, here: vec2f, own: vec3f) -> vec3f {
    let phi = vec3f(
        basis(here, s.place[0], s.width[0]), basis(here, s.place[1], s.width[1]), basis(here, s.place[2], s.width[2]));
    if s.count == 2u {
        return (phi.x * s.light[0] + phi.y * s.light[1]) / max(phi.x + phi.y, 1e-30);
    }
    let a = vec3f(1.0, basis(s.place[1], s.place[0], s.width[0]), basis(s.place[2], s.place[0], s.width[0]));
    let b = vec3f(basis(s.place[0], s.place[1], s.width[1]), 1.0, basis(s.place[2], s.place[1], s.width[1]));
    let c = vec3f(basis(s.place[0], s.place[2], s.width[2]), basis(s.place[1], s.place[2], s.width[2]), 1.0);
    // Columns a, b, c: rows of the inverse are these over the determinant.
    let volume = dot(a, cross(b, c));
    let weights = vec3f(dot(phi, vec3f(cross(b, c).x, cross(c, a).x, cross(a, b).x)),
        dot(phi, vec3f(cross(b, c).y, cross(c, a).y, cross(a, b).y)),
        dot(phi, vec3f(cross(b, c).z, cross(c, a).z, cross(a, b).z))) / volume;
    let sum = weights.x * s.light[0] + weights.y * s.light[1] + weights.z * s.light[2];
    return select(own, sum, s.count == 3u && abs(volume) > LEAST_PIVOT);
}

fn write(i: u32, paper: bool) {
    let level = level_map[i];
    var light = vec3f(0.0);
    if level <= pyramid.coarsest {
        let pixel = texel_of(pyramid.levels[0], i);
        let here = vec2f(pixel) + 0.5;
        let width = f32(1u << level);
        light = own_light(texel_number(pyramid.levels[level], pixel >> vec2u(level))).xyz;
        if paper && level > 2u {
            light = of_the_paper(samples_of(pixel, i, level, 3u), here, light);
        } else if !paper && level > 0u {
            light = interpolated(samples_of(pixel, i, level, params.samples), here, width);
        }
    }
    direct_irradiance[i] = vec4f(light, 0.0);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        write(i, false);
    }
}

@compute @workgroup_size(64)
fn paper(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        write(i, true);
    }
}
