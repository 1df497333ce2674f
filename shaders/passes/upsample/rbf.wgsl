// Interpolation by radial basis functions in a single pass [KJ16 Sec. 3.1.5]: each pixel of a fragment above level 0 takes
// the light of the samples nearest to it that lie on its surface.
//   Phi_ij = exp(-|x_i - x_j|^2 / (C s^2)),  [[Phi, 1], [1^T, 0]] [w; b] = [I; 0],  I(x) = sum_i w_i phi_i(x) + b
// with s the width of the pixel's fragment. Deviations: distances between samples, one s and the constant b, so that Phi is
// symmetric and a constant stays one; clamped to the range of its samples; fragments of levels 1 and 2, too, which look to
// the three neighbours on the pixel's side of their middle.
//   main   pixels of fragments of level 0, which keep their light, and of level 3 and above
//   small  a list of pixels of level 1 or 2
// In: fragments and their irradiance, border_samples, level_map, G-buffer. Out: irradiance a pixel.

import package::common::border_samples::LARGE;
import package::common::fragment::CULLED;
import package::common::grid::{Grid, item_index};
import package::common::illumination::{fragment_at, fragment_irradiance};
import package::common::nearest_samples::{nearest_samples, with_nearest, with_sample};
import package::common::pyramid::{middle_of, pyramid, texel_number, texel_of};
import package::common::radial_basis::{Samples, weights_at};
import package::common::same_surface::{Surface, lies_on, surface_at};
import package::common::tiles::pixel_in_tile_order;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> level_map: array<u32>;
@group(0) @binding(6) var<storage, read> small_pixels: array<u32>;
@group(0) @binding(8) var<storage, read_write> direct_irradiance: array<vec4f>;

// Samples of a pixel, at most 4.
override SAMPLES: u32 = 3;

// Samples nearer to each other than this, in widths of the fragment, are one.
const CLOSE: f32 = 0.125;
const FAR: f32 = 1e30;

// Number of the texel of a level that holds a pixel; what is the same for all threads is looked up for all at once.
fn texel_at(pixel: vec2u, level: u32) -> u32 {
    var number = 0u;
    for (var l = 0u; l <= pyramid.coarsest; l++) {
        number = select(number, texel_number(pyramid.levels[l], pixel >> vec2u(l)), l == level);
    }
    return number;
}

// Adds the fragment at a pixel beside, if that lies on the surface.
fn with_beside(s: Samples, seen: Surface, pixel: vec2u, counts: bool) -> Samples {
    let inside = counts && all(pixel < pyramid.levels[0].xy);
    let at = select(0u, pixel.y * pyramid.levels[0].x + pixel.x, inside);
    let level = level_map[at];
    let alike = lies_on(seen, at);
    let lit = inside && level <= pyramid.coarsest;
    let own = select(0u, level, lit);
    let fragment = fragment_at[texel_at(select(vec2u(0u), pixel, lit), own)];
    let found = lit && alike && fragment != 0u && fragment != CULLED;
    let light = fragment_irradiance[select(0u, fragment - 1u, found)].xyz;
    return with_sample(s, vec2f(middle_of(own, pixel >> vec2u(own))), light, 0.0, found);
}

// The samples of a pixel of level 1 or 2.
fn samples_beside(pixel: vec2u, at: u32, level: u32, own: vec3f) -> Samples {
    let seen = surface_at(at, level);
    let texel = pixel >> vec2u(level);
    let middle = middle_of(level, texel);
    let first = texel << vec2u(level);
    let outside = select(first + (1u << level), first - 1u, pixel < middle);
    var s: Samples;
    s = with_sample(s, vec2f(middle), own, 0.0, true);
    s = with_beside(s, seen, vec2u(outside.x, pixel.y), SAMPLES > 1u);
    s = with_beside(s, seen, vec2u(pixel.x, outside.y), SAMPLES > 2u);
    return with_beside(s, seen, outside, SAMPLES > 3u);
}

// The samples of a pixel of a large fragment.
fn samples_about(pixel: vec2u, number: u32, level: u32, counts: bool) -> Samples {
    let row = select(0u, number - pyramid.levels[LARGE].z, counts);
    let first = vec2f((pixel >> vec2u(level)) << vec2u(level));
    let close = CLOSE * f32(1u << level);
    let n = nearest_samples(row, vec2f(pixel) - first, counts);
    var s: Samples;
    s = with_nearest(s, row, first, n.one, close, counts);
    s = with_nearest(s, row, first, n.two, close, counts && s.count < SAMPLES);
    s = with_nearest(s, row, first, n.three, close, counts && s.count < SAMPLES);
    s = with_nearest(s, row, first, n.four, close, counts && s.count < SAMPLES);
    return with_nearest(s, row, first, n.five, close, counts && s.count < SAMPLES);
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

struct Own {
    number: u32,    // of its texel
    lit: bool,
    light: vec3f,
}

fn own_of(pixel: vec2u, level: u32, shown: bool) -> Own {
    let number = texel_at(pixel, level);
    let fragment = fragment_at[number];
    let lit = shown && fragment != 0u && fragment != CULLED;
    return Own(number, lit, select(vec3f(0.0), fragment_irradiance[select(0u, fragment - 1u, lit)].xyz, lit));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    let pixel = pixel_in_tile_order(i, pyramid.levels[0].x);
    if i >= grid.end || any(pixel >= pyramid.levels[0].xy) {
        return;
    }
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    let shown = level_map[at];
    let level = select(0u, shown, shown <= pyramid.coarsest);
    let own = own_of(pixel, level, shown <= pyramid.coarsest);
    let large = own.lit && level >= LARGE;
    let light = interpolated(samples_about(pixel, own.number, level, large), vec2f(pixel), f32(1u << level));
    direct_irradiance[at] = vec4f(select(own.light, light, large), 0.0);
}

@compute @workgroup_size(64)
fn small(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    // Behind the end of the list lies what was there before: other pixels of these levels, or of none.
    let at = small_pixels[min(i, arrayLength(&small_pixels) - 1u)];
    let pixel = texel_of(pyramid.levels[0], at);
    let level = level_map[at];
    if at >= pyramid.levels[0].w || level == 0u || level >= LARGE || level > pyramid.coarsest {
        return;
    }
    let own = own_of(pixel, level, true);
    let light = interpolated(samples_beside(pixel, at, level, own.light), vec2f(pixel), f32(1u << level));
    direct_irradiance[at] = vec4f(select(own.light, light, own.lit), 0.0);
}
