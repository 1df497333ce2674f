// Rays to samples of the patch of a light that each pixel's lobe reaches.
//   flags   which pixels ask: not those of tiles that are proven to see all of the light, or none of it
//   again   which pixels ask more: those whose first samples disagree
//   main    `side` x `side` rays for each pixel of a list, and what each adds: lobe and cosines at its place times the
//           picture's mean over its stratum
// In: lobe_light, tile_flags; lobe_share; G-buffer, list. Out: lobe_flags in tile order,
// lobe_share; rays, lobe_weights.

import package::common::gbuffer::floats;
import package::common::light_frame::{DARK, LIT};
import package::common::grid::{Grid, item_index};
import package::common::light_strip::{Strip, strip_of, strip_to};
import package::common::light_sums::light_sums;
import package::common::lobe_patch::{along, axis_of, glossy_at, integrand, patch_of, source};
import package::common::random::random4;
import package::common::ray::{Ray, inactive_ray};
import package::common::surface::offset_origin;
import package::common::tiles::{TILE_PIXELS, pixel_in_tile_order};
import package::common::view::View;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> lobe_surface: array<vec4f>;
@group(0) @binding(6) var<storage, read> lobe_list: array<u32>;
@group(0) @binding(7) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(12) var<storage, read_write> lobe_weights: array<vec4f>;
@group(0) @binding(8) var<storage, read> lobe_light: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> lobe_flags: array<u32>;
@group(0) @binding(10) var<storage, read> tile_flags: array<u32>;
@group(0) @binding(11) var<storage, read_write> lobe_share: array<vec4f>;

// Whether tiles were looked at.
override TILES: bool = false;
// Whether the light has a picture.
override PICTURE: bool = true;

// A ray ends just short of its sample, whose own rounding moves its surface (N5).
const T_MAX: f32 = 0.9999;

@compute @workgroup_size(64)
fn flags(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = item_index(grid, group, groups, 64u, lane);
    if place >= grid.end {
        return;
    }
    let pixel = pixel_in_tile_order(place, view.width);
    let inside = all(pixel < vec2u(view.width, view.height));
    let at = select(0u, pixel.y * view.width + pixel.x, inside);
    var known = 0u;
    if TILES {
        known = tile_flags[place / TILE_PIXELS] & (LIT | DARK);
    }
    let reached = inside && lobe_light[at].w != 0.0;
    lobe_flags[place] = select(0u, 1u, reached && known == 0u);
    if reached && known != 0u {
        lobe_share[at] = vec4f(select(0.0, 1.0, (known & LIT) != 0u));
    }
}

@compute @workgroup_size(64)
fn again(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = item_index(grid, group, groups, 64u, lane);
    if place >= grid.end || lobe_flags[place] == 0u {
        return;
    }
    let pixel = pixel_in_tile_order(place, view.width);
    let share = lobe_share[pixel.y * view.width + pixel.x].xyz;
    lobe_flags[place] = select(0u, 1u, any(share > vec3f(0.0)) && any(share < vec3f(1.0)));
}

// A place in [0, 1)^2 that differs from pixel to pixel and stratum to stratum: a hash, and a sequence on top [Rob18].
fn jitter_of(seed: vec2f, k: u32) -> vec2f {
    return fract(seed + f32(k) * vec2f(0.7548776662, 0.5698402910));
}

// A thread for each row of strata of each pixel: the sums of a row of corners are looked up once.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let side = source.side;
    let line = item % side;
    let pixel = pixel_in_tile_order(lobe_list[item / side], view.width);
    let at = pixel.y * view.width + pixel.x;
    let point = glossy_at(g_position[at], g_normal[at], g_geometric[at], lobe_surface[at], view.eye);
    let origin = offset_origin(point.origin, point.geometric, bitcast<f32>(g_position[at].w));
    let found = patch_of(point);
    let across = axis_of(found, 0u);
    let up = axis_of(found, 1u);
    let step = 1.0 / f32(side);
    let seed = random4(vec4u(at, source.light, 0u, source.seed ^ 0x9e3779b9u)).xy;
    let size = vec2u(source.columns, source.rows);
    let rows = vec2f(along(up, f32(line) * step).x, along(up, f32(line + 1u) * step).x);
    var mean: Strip;
    if PICTURE {
        mean = strip_of(size, rows, along(across, 0.0).x, 1.0);
    }
    for (var i = 0u; i < side; i++) {
        let jitter = jitter_of(seed, line * side + i);
        let x = along(across, (f32(i) + jitter.x) * step);
        let y = along(up, (f32(line) + jitter.y) * step);
        var weight = vec3f(step * step * x.y * y.y * integrand(point, vec2f(x.x, y.x)));
        if PICTURE {
            mean = strip_to(mean, size, along(across, f32(i + 1u) * step).x);
            weight *= max(source.radiance + mean.whole, vec3f(0.0));
        }
        let chosen = source.corner + x.x * source.edge_u + y.x * source.edge_v;
        var ray = inactive_ray();
        if any(weight > vec3f(0.0)) {
            ray = Ray(origin, 0.0, chosen - origin, T_MAX);
        }
        rays[item * side + i] = ray;
        lobe_weights[item * side + i] = vec4f(weight, 0.0);
    }
}
