// The samples that the pixels of each large fragment choose from [KJ16 Fig. 5]: its own middle; the fragments beside it, found
// at pixels just outside of its border; and extra samples on its border [KJ16 Sec. 3.1.4], three of its own and those of the
// fragments to its right and below, or where the image ends those on its last column and row. They lie on the surface that
// the middle sees.
//   spread  extra samples by the texel that they belong to: a stage may bind no more buffers
//   main    a thread for each texel from level 3 on
// In: fragments and their irradiance, extra samples, level_map, G-buffer. Out: extra_rows; border_samples.

import package::common::border_samples::{COUNT, LARGE, SLOTS, is_near, packed};
import package::common::extra_places::{NO_ROW, extra_row};
import package::common::fragment::CULLED;
import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::illumination::{fragment_at, fragment_irradiance};
import package::common::pyramid::{level_of, middle_of, pyramid, texel_number, texel_of};
import package::common::same_surface::{g_normal, lies_on, surface_at};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> level_map: array<u32>;
@group(0) @binding(6) var<storage, read> extra_light: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> border_samples: array<vec4u>;
@group(0) @binding(8) var<storage, read> extra_at: array<u32>;
@group(0) @binding(9) var<storage, read> extra_irradiance: array<vec4f>;
@group(0) @binding(13) var<storage, read_write> extra_rows: array<vec4f>;

// Whether there are extra samples.
override EXTRAS: bool = false;

// Places about the border: a corner and four on each side; and of extra samples on it.
const BESIDE: u32 = 20u;
const ON_BORDER: u32 = 8u;

@compute @workgroup_size(64)
fn spread(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let at = extra_at[i / 3u];
    let light = extra_irradiance[select(0u, 3u * (at - 1u) + i % 3u, at != 0u)];
    extra_rows[i] = select(vec4f(0.0), light, at != 0u);
}

// Place k around a fragment of this width, clockwise from its upper left corner.
fn place_beside(k: u32, width: i32) -> vec2i {
    let side = k / 5u;
    let step = i32(k % 5u);
    let along = select((2 * step - 1) * width / 8, -1, step == 0);
    let back = width - 1 - along;
    let upper = select(vec2i(along, -1), vec2i(width, along), side == 1u);
    let lower = select(vec2i(back, width), vec2i(-1, back), side == 3u);
    return select(upper, lower, side >= 2u);
}

// Place k of extra samples: upper side, corner, left side; those of the fragments to the right, below, and below right, no
// further than the image's `last` column and row.
fn place_on_border(k: u32, width: i32, last: vec2i) -> vec2i {
    let half = width / 2;
    let end = min(vec2i(width), last);
    let column = array(half, 0, 0, end.x, end.x, 0, half, end.x);
    let row = array(0, 0, half, 0, half, end.y, end.y, end.y);
    return vec2i(column[k], row[k]);
}

// Whether no place before is the same: where the image cuts a fragment its end may lie at its middle or its start.
fn is_first(k: u32, width: i32, last: vec2i) -> bool {
    let place = place_on_border(k, width, last);
    var first = true;
    for (var j = 0u; j < k; j++) {
        first = first && any(place_on_border(j, width, last) != place);
    }
    return first;
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
    let number = pyramid.levels[LARGE].z + i;
    let own = fragment_at[number];
    if own == 0u || own == CULLED {
        return;
    }
    let level = level_of(number);
    let width = i32(1u << level);
    let texel = texel_of(pyramid.levels[level], number - pyramid.levels[level].z);
    let first = vec2i(texel << vec2u(level));
    let size = vec2i(pyramid.levels[0].xy);
    let middle = middle_of(level, texel);
    let surface = surface_at(middle.y * pyramid.levels[0].x + middle.x, level);
    let known = g_normal[middle.y * pyramid.levels[0].x + middle.x].w == SURFACE;
    var count = 1u;
    border_samples[SLOTS * i] = vec4u(bitcast<vec3u>(fragment_irradiance[own - 1u].xyz), packed(vec2i(middle) - first));
    var before = own;
    var earliest = own;
    for (var k = 0u; k < BESIDE; k++) {
        let place = first + place_beside(k, width);
        let inside = known && all(place >= vec2i(0)) && all(place < size);
        let at = select(0u, u32(place.y) * pyramid.levels[0].x + u32(place.x), inside);
        let found = level_map[at];
        if inside && found <= pyramid.coarsest && lies_on(surface, at) {
            let beside = vec2u(place) >> vec2u(found);
            let other = fragment_at[texel_number(pyramid.levels[found], beside)];
            let there = vec2i(middle_of(found, beside)) - first;
            if other != before && other != earliest && other != CULLED && is_near(there) {
                let light = bitcast<vec3u>(fragment_irradiance[other - 1u].xyz);
                border_samples[SLOTS * i + count] = vec4u(light, packed(there));
                count++;
                earliest = select(earliest, other, earliest == own);
                before = other;
            }
        }
    }
    for (var k = 0u; k < select(0u, ON_BORDER, EXTRAS); k++) {
        let place = first + place_on_border(k, width, size - 1 - first);
        let inside = known && all(place < size) && is_first(k, width, size - 1 - first);
        let at = select(0u, u32(place.y) * pyramid.levels[0].x + u32(place.x), inside);
        let found = level_map[at];
        if inside && found >= LARGE && found <= pyramid.coarsest && lies_on(surface, at) {
            let row = extra_row(vec2u(place), found);
            let light = extra_light[select(row, 0u, row == NO_ROW)];
            if row != NO_ROW && light.w > 0.0 {
                border_samples[SLOTS * i + count] = vec4u(bitcast<vec3u>(light.xyz), packed(place - first));
                count++;
            }
        }
    }
    border_samples[SLOTS * i + COUNT].w = count;
}
