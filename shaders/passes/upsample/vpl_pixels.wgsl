// From lists of fragments of virtual lights to pixels [NW09 Secs. 3.5, 4.1].
//   pixels  adds the virtual lights that a texel of level 1 has left, at each of its pixels
//   levels  adds what each level holds. Deviation: interpolated between the four children of the texel that keeps it, and
//           beyond their middles; nothing is taken from other texels, which keep other virtual lights. Where geometry is
//           rough, or a child sees no surface, each child's light is its own pixels'.
// In: G-buffer, points, short_lights, masks, texel_state, held_irradiance, held_radiance. In and out: irradiance and
// specular_radiance a pixel.

import package::common::fragment::{LIT, ROUGH};
import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::lobe::instance_lobes;
import package::common::pyramid::{middle_of, pyramid, texel_number, texel_of};
import package::common::shaded_point::{ShadedPoint, ShortLight, shaded_point, shares, specular_of};
import package::common::tiles::pixel_in_tile_order;
import package::common::view::View;
import package::common::vpl_masks::{VplListsParams, mask_at};

override DISC: bool = false;
override GLOSSY: bool = false;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplListsParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(6) var<storage, read> short_lights: array<ShortLight>;
@group(0) @binding(7) var<storage, read> masks: array<u32>;
@group(0) @binding(8) var<storage, read> texel_state: array<u32>;
@group(0) @binding(9) var<storage, read> held: array<vec4f>;
@group(0) @binding(10) var<storage, read_write> light: array<vec4f>;

// A thread for each place of the tile order.
@compute @workgroup_size(64)
fn pixels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = item_index(grid, group, groups, 64u, lane);
    let pixel = pixel_in_tile_order(place, pyramid.levels[0].x);
    if place >= grid.end || any(pixel >= pyramid.levels[0].xy) {
        return;
    }
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    if g_normal[at].w != SURFACE {
        return;
    }
    var surface = vec4f(1.0);
    if GLOSSY {
        surface = instance_lobes[g_albedo[at].w];
        if all(surface.xyz == vec3f(0.0)) {
            return;
        }
    }
    let p = shaded_point(g_position[at], g_normal[at], g_geometric[at], surface, view.eye);
    let number = texel_number(pyramid.levels[1], pixel >> vec2u(1u));
    var sum = vec3f(0.0);
    for (var word = 0u; word < params.words; word++) {
        for (var mask = masks[mask_at(params, number, word)]; mask != 0u; mask &= mask - 1u) {
            let lamp = short_lights[params.first + 32u * word + firstTrailingBit(mask)];
            let share = shares(p, lamp, DISC, params.reach, GLOSSY);
            sum += lamp.flux.xyz * select(share.x, share.y, GLOSSY);
        }
    }
    light[at] += vec4f(specular_of(p) * sum, 0.0);
}

fn state_of(size: vec4u, texel: vec2u) -> u32 {
    let inside = all(texel < size.xy);
    return select(0u, texel_state[select(0u, texel_number(size, texel), inside)], inside);
}

// Of the texels of `level` that a texel above keeps light for, at a pixel.
fn held_at(level: u32, pixel: vec2u) -> vec3f {
    let size = pyramid.levels[level];
    let parent = pixel >> vec2u(level + 1u);
    var whole = (state_of(pyramid.levels[level + 1u], parent) & ROUGH) == 0u;
    for (var k = 0u; k < 4u; k++) {
        whole = whole && (state_of(size, 2u * parent + vec2u(k & 1u, k >> 1u)) & LIT) != 0u;
    }
    let first = texel_number(size, 2u * parent) - pyramid.levels[1].z;
    let own = texel_number(size, pixel >> vec2u(level)) - pyramid.levels[1].z;
    if !whole {
        return held[own].xyz;
    }
    let start = vec2f(middle_of(level, 2u * parent));
    let t = (vec2f(pixel) - start) / (vec2f(middle_of(level, 2u * parent + 1u)) - start);
    let above = mix(held[first].xyz, held[first + 1u].xyz, t.x);
    let below = mix(held[first + size.x].xyz, held[first + size.x + 1u].xyz, t.x);
    return max(mix(above, below, t.y), vec3f(0.0));
}

@compute @workgroup_size(64)
fn levels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || (texel_state[min(i, grid.end - 1u)] & LIT) == 0u {
        return;
    }
    let pixel = texel_of(pyramid.levels[0], i);
    var sum = vec3f(0.0);
    for (var level = max(params.lowest, 2u) - 1u; level < pyramid.coarsest; level++) {
        sum += held_at(level, pixel);
    }
    light[i] += vec4f(sum, 0.0);
}
