// From the hits of the primary rays to the G-buffer. In: hits, in tile order. Out: four rows a pixel, in image order.

import package::common::gbuffer::{FIRST_LIGHT, NOTHING, SURFACE, words};
import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS};
import package::common::surface::{NO_LIGHT, geometry, instances, surface_with, texels};
import package::common::tiles::pixel_in_tile_order;
import package::common::view::{View, view_direction};

// Of the instances: SMOOTH, COLORS, TEXTURE.
override FEATURES: u32 = 7u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> hits: array<Hit>;
@group(0) @binding(2) var<storage, read_write> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> g_albedo: array<vec4u>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    let pixel = pixel_in_tile_order(view.first + i, view.width);
    if i >= grid.end || pixel.x >= view.width || pixel.y >= view.height {
        return;
    }
    let at = pixel.y * view.width + pixel.x;
    let hit = hits[i];
    if hit.instance == MISS {
        g_position[at] = vec4u(0u);
        g_normal[at] = vec4u(0u, 0u, 0u, NOTHING);
        g_geometric[at] = vec4u(0u, 0u, 0u, MISS);
        g_albedo[at] = vec4u(0u, 0u, 0u, MISS);
        return;
    }
    let s = surface_with(hit, view_direction(view, pixel), FEATURES);
    let seen_light = s.light != NO_LIGHT;
    let kind = select(SURFACE, FIRST_LIGHT + s.light, seen_light);
    // The unit quad of a light has its corners at (0,0), (1,0), (1,1), (0,1): see src/scene/prepare.rs.
    let second = hit.triangle == 1u;
    let ab = select(vec2f(hit.u + hit.v, hit.v), vec2f(hit.u, hit.u + hit.v), second);
    let color = select(s.albedo, vec3f(ab, select(0.0, 1.0, s.front)), seen_light);
    g_position[at] = words(s.position, bitcast<u32>(s.origin_error));
    g_normal[at] = words(s.normal_shade, kind);
    g_geometric[at] = words(s.normal_geo, select(hit.triangle, MISS, seen_light));
    g_albedo[at] = words(color, hit.instance);
}
