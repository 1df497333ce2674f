// Extra samples of large fragments [KJ16 Sec. 3.1.4]: three pixels on the upper and left border of each fragment above level 2,
// in the middle of the upper side, in the corner, and in the middle of the left side. Fragments beside it have the others.
// Deviation: where the image ends on the right or below there are samples on its last column or row as well, see
// `extra_places`: else the light of its last fragments would be continued from the middles alone.
//   find    which texels from level 3 on are fragments, for each of three sets
//   points  shading points of their samples; a pixel that sees no surface, or lies outside of the image, is none
// In: fragment_at, G-buffer. Out: extra_flags; extra_receivers, extra_irradiance (fourth number 1 where there is a sample),
// extra_at (set by set, a texel from level 3 on: 1 + its number in the list, or 0), extra_count.

import package::common::border_samples::LARGE;
import package::common::extra_places::{extra_pixel, extra_row, has_set, large_texels};
import package::common::fragment::CULLED;
import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{level_of, pyramid, texel_of};
import package::common::ray::Receiver;
import package::common::receiver::{inactive_receiver, pattern_of, receiver_of};

struct ExtraSamplesParams {
    patterns: u32,
    seed: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ExtraSamplesParams;
@group(0) @binding(1) var<storage, read> fragment_at: array<u32>;
@group(0) @binding(2) var<storage, read_write> extra_flags: array<u32>;
@group(0) @binding(3) var<storage, read> extra_list: array<u32>;
@group(0) @binding(4) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(6) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(7) var<storage, read_write> extra_receivers: array<Receiver>;
@group(0) @binding(8) var<storage, read_write> extra_irradiance: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> extra_at: array<u32>;
@group(0) @binding(10) var<storage, read_write> extra_count: array<atomic<u32>>;

@compute @workgroup_size(64)
fn find(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let number = pyramid.levels[LARGE].z + i % large_texels();
        let size = pyramid.levels[level_of(number)];
        let at = fragment_at[number];
        let counts = at != 0u && at != CULLED && has_set(i / large_texels(), texel_of(size, number - size.z), size);
        extra_flags[i] = select(0u, 1u, counts);
    }
}

// Three for each entry of the list.
@compute @workgroup_size(64)
fn points(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let entry = extra_list[i / 3u];
    let which = i % 3u;
    let number = pyramid.levels[LARGE].z + entry % large_texels();
    let level = level_of(number);
    let size = pyramid.levels[level];
    let texel = texel_of(size, number - size.z);
    let pixel = extra_pixel(entry / large_texels(), which, texel << vec2u(level), level);
    // One that lies in another fragment, or is another sample, is none.
    let own = extra_row(pixel, level) == 3u * entry + which;
    let inside = all(pixel < pyramid.levels[0].xy) && own;
    let at = select(0u, pixel.y * pyramid.levels[0].x + pixel.x, inside);
    let counts = inside && g_normal[at].w == SURFACE;
    extra_receivers[i] = inactive_receiver();
    extra_irradiance[i] = vec4f(0.0, 0.0, 0.0, select(0.0, 1.0, counts));
    if counts {
        let pattern = pattern_of(pixel, params.seed, params.patterns);
        extra_receivers[i] = receiver_of(g_position[at], g_normal[at], g_geometric[at], pattern, at);
        atomicAdd(&extra_count[0], 1u);
    }
    if which == 0u {
        extra_at[entry] = 1u + i / 3u;
    }
}
