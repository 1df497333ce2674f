// Rays to samples of the patch of a light that each pixel's lobe reaches.
//   flags   which pixels ask: not those of tiles that are proven to see all of the light, or none of it
//   again   which pixels ask more: those whose first samples disagree
//   main    `side` x `side` rays for each pixel of a list
// In: lobe_light, tile_flags; lobe_share; G-buffer, list. Out: lobe_flags in tile order, lobe_share; rays.

import package::common::gbuffer::floats;
import package::common::light_frame::{DARK, LIT};
import package::common::grid::{Grid, item_index};
import package::common::lobe_patch::{glossy_at, integrand, patch_of, source, stratum_of};
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
@group(0) @binding(8) var<storage, read> lobe_light: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> lobe_flags: array<u32>;
@group(0) @binding(10) var<storage, read> tile_flags: array<u32>;
@group(0) @binding(11) var<storage, read_write> lobe_share: array<vec4f>;

// Whether tiles were looked at.
override TILES: bool = false;

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
    let samples = source.side * source.side;
    let pixel = pixel_in_tile_order(lobe_list[i / samples], view.width);
    let at = pixel.y * view.width + pixel.x;
    let point = glossy_at(g_position[at], g_normal[at], g_geometric[at], lobe_surface[at], view.eye);
    let found = patch_of(point);
    let chosen = stratum_of(point, found, at, i % samples).sample;
    var ray = inactive_ray();
    if integrand(point, chosen) > 0.0 {
        let origin = offset_origin(point.origin, point.geometric, bitcast<f32>(g_position[at].w));
        let target_ = source.corner + chosen.x * source.edge_u + chosen.y * source.edge_v;
        ray = Ray(origin, 0.0, target_ - origin, T_MAX);
    }
    rays[i] = ray;
}
