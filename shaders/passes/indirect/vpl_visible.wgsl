// The share of its irradiance that each fragment sees: of what the rays stand for, that of the rays that arrive, averaged
// with the fragments around it on the same surface; light itself is never averaged [HHM18, a ratio of sums].
//   sum_up  of each receiver: rgb of what arrives, rgb of all
//   apply   irradiance times the share
// In: rays' answers and weights; fragments, G-buffer. In and out: irradiance.

import package::common::fragment::LEVEL_CULLED;
import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{footprint, pyramid, texel_number, texel_of};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;
import package::common::same_surface::{g_geometric, g_normal, g_position, lies_on, surface_at, view};
import package::common::tiles::pixel_in_tile_order;

struct VplVisibleParams {
    rays: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// Whether every pixel is a fragment, its number that of the pixel.
override PIXELS: bool = false;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplVisibleParams;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(6) var<storage, read> occluded: array<u32>;
@group(0) @binding(7) var<storage, read> ray_weights: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> seen_sums: array<vec4f>;
@group(0) @binding(9) var<storage, read> sums: array<vec4f>;
@group(0) @binding(10) var<storage, read> fragment_list: array<u32>;
@group(0) @binding(11) var<storage, read> level_map: array<u32>;
@group(0) @binding(12) var<storage, read> fragment_at: array<u32>;
@group(0) @binding(13) var<storage, read_write> irradiance: array<vec4f>;

@compute @workgroup_size(64)
fn sum_up(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || receivers[i].pixel == INACTIVE {
        return;
    }
    var arrives = vec3f(0.0);
    var whole = vec3f(0.0);
    for (var k = 0u; k < params.rays; k++) {
        let ray = i * params.rays + k;
        let weight = ray_weights[ray].xyz;
        let seen = ((occluded[ray / 32u] >> (ray % 32u)) & 1u) == 0u;
        arrives += select(vec3f(0.0), weight, seen);
        whole += weight;
    }
    seen_sums[2u * receivers[i].pixel] = vec4f(arrives, 0.0);
    seen_sums[2u * receivers[i].pixel + 1u] = vec4f(whole, 0.0);
}

// Number of the fragment that holds a pixel; not there: 0xffffffff.
fn fragment_of(pixel: vec2u, at: u32) -> u32 {
    if PIXELS {
        return select(0xffffffffu, at, g_normal[at].w == SURFACE);
    }
    let level = level_map[at];
    let shaded = level < LEVEL_CULLED;
    let l = select(0u, level, shaded);
    return select(0xffffffffu, fragment_at[texel_number(pyramid.levels[l], pixel >> vec2u(l))] - 1u, shaded);
}

@compute @workgroup_size(64)
fn apply(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let size = pyramid.levels[0].xy;
    var level = 0u;
    var middle = texel_of(pyramid.levels[0], i);
    if !PIXELS {
        let first = pixel_in_tile_order(fragment_list[i], size.x);
        level = level_map[first.y * size.x + first.x];
        let pixels = footprint(level, first >> vec2u(level));
        middle = pixels.xy + pixels.zw / 2u;
    }
    let own = middle.y * size.x + middle.x;
    if PIXELS && g_normal[own].w != SURFACE {
        return;
    }
    let s = surface_at(own, level);
    var arrives = sums[2u * i].xyz;
    var whole = sums[2u * i + 1u].xyz;
    for (var k = 0u; k < 9u; k++) {
        let step = vec2i(vec2u(k % 3u, k / 3u)) - 1;
        let place = vec2i(middle) + step * i32(1u << level);
        let inside = all(place >= vec2i(0)) && all(place < vec2i(size)) && k != 4u;
        let pixel = select(middle, vec2u(place), inside);
        let at = pixel.y * size.x + pixel.x;
        let other = fragment_of(pixel, at);
        let counts = inside && other != 0xffffffffu && lies_on(s, at);
        let row = 2u * select(i, other, counts);
        let weight = select(0.0, select(0.5, 1.0, (k & 1u) != 0u), counts);
        arrives += weight * sums[row].xyz;
        whole += weight * sums[row + 1u].xyz;
    }
    irradiance[i] *= vec4f(select(vec3f(1.0), arrives / max(whole, vec3f(1e-37)), whole > vec3f(0.0)), 1.0);
}
