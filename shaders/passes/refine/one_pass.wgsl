// One-pass refinement [NSW09 Sec. 3.2.1]: every texel decides alone whether it is a fragment: it is clean, or of the
// finest level, and no texel that holds it is. Deviation: all of those are asked, not the parent alone, because a metric
// relative to the fragment's width may be clean above and rough below.
//   cull      which pixels any light may reach; a texel is culled when none of its pixels is
//   all_lit   in its place where light comes from everywhere: pixels that see a surface are lit
//   classify  which texels are rough, from the pyramid; with ALL_LIT which are lit, too, so that neither is needed
//   choose    level and reason of every pixel, and the first pixel of every fragment
// In: G-buffer, pyramid, lights. Out: texel_state, level_map, reason_map, fragment_flags, fragment_at.

import package::common::fragment::{
    CULLED, FACES_AWAY, FRAGMENT, LEVEL_CULLED, LEVEL_NOTHING, LIES_BEHIND, LIT, ON_SURFACE, OUTSIDE_LOBE,
    REASON_BEHIND_LIGHT, REASON_COARSEST, REASON_DEPTH, REASON_EMITTER, REASON_FACING_AWAY, REASON_LOBE, REASON_NORMAL,
    REASON_NOTHING, REASON_OUTSIDE_LOBE, ROUGH, ROUGH_DEPTH, ROUGH_LOBE, ROUGH_NORMAL,
};
import package::common::gbuffer::{NOTHING, SURFACE, floats};
import package::common::grid::{Grid, item_index, not_uniform};
import package::common::light::{Light, SPOT, light_at, lights};
import package::common::pyramid::{level_of, pyramid, texel_number, texel_of};
import package::common::rough_texel::{OnePassParams, means, params, ranges, roughness, spreads, view};
import package::common::tiles::pixel_in_tile_order;

// What light comes from everywhere reaches every surface: what `classify` and `choose` need no marks for.
override ALL_LIT: bool = false;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(3) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(9) var<storage, read_write> marks: array<atomic<u32>>;   // texel_state
@group(0) @binding(10) var<storage, read_write> texel_state: array<u32>;
@group(0) @binding(11) var<storage, read_write> level_map: array<u32>;
@group(0) @binding(12) var<storage, read_write> reason_map: array<u32>;
@group(0) @binding(13) var<storage, read_write> fragment_flags: array<u32>;
@group(0) @binding(14) var<storage, read_write> fragment_at: array<u32>;

// What a light may do to a point p with geometric normal n: LIT, FACES_AWAY or LIES_BEHIND. Where rounding could tell
// otherwise it counts as lit.
fn reach(light: Light, p: vec3f, n: vec3f) -> u32 {
    let q = light.corner - p;
    let slack = 1e-5 * (length(q) + length(light.edge_u) + length(light.edge_v));
    let height = -dot(light.normal, q);
    var behind = height < -slack && !light.two_sided;
    if light.kind == SPOT {
        behind = height < light.cos_cutoff * length(q) - slack;
    }
    let far_corner = max(max(0.0, dot(n, light.edge_u)), max(dot(n, light.edge_v), dot(n, light.edge_u + light.edge_v)));
    let away = dot(n, q) + select(far_corner, 0.0, light.kind == SPOT) < -slack;
    return select(select(LIT, FACES_AWAY, away), LIES_BEHIND, behind);
}

// A thread for each block of 2 x 2 pixels.
@compute @workgroup_size(64)
fn cull(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let first = texel_of(pyramid.levels[1], i);
    let x = vec4u(2u * first.x) + vec4u(0u, 1u, 0u, 1u);
    let y = vec4u(2u * first.y) + vec4u(0u, 0u, 1u, 1u);
    let inside = (x < vec4u(pyramid.levels[0].x)) & (y < vec4u(pyramid.levels[0].y));
    let at = select(vec4u(0u), y * pyramid.levels[0].x + x, inside);
    var positions: array<vec3f, 4>;
    var normals: array<vec3f, 4>;
    for (var p = 0u; p < 4u; p++) {
        positions[p] = floats(g_position[at[p]]);
        normals[p] = floats(g_geometric[at[p]]);
    }
    var found: array<u32, 4>;
    // A light is read once for all four.
    for (var k = 0u; k < params.lights && (found[0] & found[1] & found[2] & found[3] & LIT) == 0u; k++) {
        let light = light_at(k);
        for (var p = 0u; p < 4u; p++) {
            found[p] |= reach(light, positions[p], normals[p]);
        }
    }
    var any_of = 0u;
    for (var p = 0u; p < 4u; p++) {
        if inside[p] && g_normal[at[p]].w == SURFACE {
            // The best of what each light may do: LIT, FACES_AWAY, LIES_BEHIND from the lowest bit on.
            let all_of = found[p] | LIES_BEHIND;
            let best = all_of & (~all_of + 1u);
            any_of |= best;
            atomicOr(&marks[at[p]], best);
        }
    }
    if any_of != 0u {
        for (var level = 1u; level <= not_uniform(pyramid.coarsest, i); level++) {
            atomicOr(&marks[texel_number(pyramid.levels[level], first >> vec2u(level - 1u))], any_of);
        }
    }
}

// A thread for each block of 2 x 2 pixels.
@compute @workgroup_size(64)
fn all_lit(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let first = texel_of(pyramid.levels[1], i);
    var any_of = 0u;
    for (var p = 0u; p < 4u; p++) {
        let pixel = 2u * first + vec2u(p & 1u, p >> 1u);
        let inside = all(pixel < pyramid.levels[0].xy);
        let at = select(0u, pixel.y * pyramid.levels[0].x + pixel.x, inside);
        let state = select(0u, LIT, inside && g_normal[at].w == SURFACE);
        if inside {
            atomicStore(&marks[at], state);
        }
        any_of |= state;
    }
    if any_of != 0u {
        for (var level = 1u; level <= not_uniform(pyramid.coarsest, i); level++) {
            atomicOr(&marks[texel_number(pyramid.levels[level], first >> vec2u(level - 1u))], any_of);
        }
    }
}

// A thread for each texel from level 1 on.
@compute @workgroup_size(64)
fn classify(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = item_index(grid, group, groups, 64u, lane);
    if slot >= grid.end {
        return;
    }
    let number = pyramid.levels[1].z + slot;
    let level = level_of(number);
    let size = pyramid.levels[level];
    let state = roughness(level, texel_of(size, number - size.z), slot);
    let seen = means[3u * slot].w != 0u;
    if ALL_LIT {
        texel_state[number] = select(0u, LIT | state, seen);
    } else if seen {
        texel_state[number] |= state;
    }
}

// State of a texel; with ALL_LIT nobody has written those of pixels.
fn state_at(level: u32, number: u32, kind: u32) -> u32 {
    if ALL_LIT {
        return select(texel_state[number], select(0u, LIT, kind == SURFACE), level == 0u);
    }
    return texel_state[number];
}

// A thread for each place of the tile order.
@compute @workgroup_size(64)
fn choose(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = item_index(grid, group, groups, 64u, lane);
    if place >= grid.end {
        return;
    }
    let pixel = pixel_in_tile_order(place, pyramid.levels[0].x);
    if any(pixel >= pyramid.levels[0].xy) {
        fragment_flags[place] = 0u;
        return;
    }
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    let kind = g_normal[at].w;
    var level = pyramid.coarsest;
    var number = texel_number(pyramid.levels[level], pixel >> vec2u(level));
    var state = state_at(level, number, kind);
    var above = 0u;
    while level > pyramid.finest && (state & ROUGH) != 0u && (state & LIT) != 0u {
        above = state;
        level--;
        number = texel_number(pyramid.levels[level], pixel >> vec2u(level));
        state = state_at(level, number, kind);
    }
    let culled = (state & LIT) == 0u;
    let lobe = select(REASON_COARSEST, REASON_LOBE, (above & ROUGH_LOBE) != 0u);
    let finer = select(select(lobe, REASON_NORMAL, (above & ROUGH_NORMAL) != 0u), REASON_DEPTH, (above & ROUGH_DEPTH) != 0u);
    let away = select(REASON_BEHIND_LIGHT, REASON_FACING_AWAY, (state & FACES_AWAY) != 0u);
    let dark = select(away, REASON_OUTSIDE_LOBE, (state & OUTSIDE_LOBE) != 0u);
    let outside = select(vec2u(LEVEL_CULLED, REASON_EMITTER), vec2u(LEVEL_NOTHING, REASON_NOTHING), kind == NOTHING);
    let inside = select(vec2u(level, finer), vec2u(LEVEL_CULLED, dark), culled);
    let answer = select(outside, inside, kind == SURFACE);
    level_map[at] = answer.x;
    reason_map[at] = answer.y;
    let leads = (state & ON_SURFACE) != 0u && all((pixel & vec2u((1u << level) - 1u)) == vec2u(0u));
    fragment_flags[place] = select(0u, FRAGMENT | (level + 1u), leads && !culled);
    if leads && culled {
        fragment_at[number] = CULLED;
    }
}
