// Uniform levels: the fragment of each pixel, the largest block that every light sees alike, and why it is no larger.
//   add    two bits a light in cell_word: something lit, something dark; a penumbra sets both. Bit 31: pixels asked for
//          themselves
//   tiles  the same for each tile; tops: the level of each tile; map: level and reason of each pixel
// A block is uniform when no light has both of its bits in it. Blocks inside uniform blocks are uniform, so that the
// fragments are a partition [NSW09; Deviation: bottom-up, no parent is asked].

import package::common::cells::{CELLS_ACROSS, PLAN_TRACED, STATE_DARK, STATE_LIT, STATE_ZONE, TILE_CELLS, cell_in_image, cell_index, cell_place};
import package::common::fragment::{
    LEVEL_CULLED, LEVEL_NOTHING, REASON_BEHIND_LIGHT, REASON_COARSEST, REASON_EMITTER, REASON_FACING_AWAY, REASON_NOTHING,
    REASON_VISIBILITY,
};
import package::common::gbuffer::{NOTHING, SURFACE};
import package::common::grid::{Grid, item_index};
import package::common::tiles::TILE;

struct UniformLevelsParams {
    width: u32,
    height: u32,
    slot: u32,          // of the light in the words, 0 to 14
    coarsest: u32,
    own_pixels: u32,    // the light's zone is shaded pixel by pixel
    again: u32,         // the levels by geometry or by other lights are there already
    last: u32,          // no other lights follow
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: UniformLevelsParams;
@group(0) @binding(1) var<storage, read> cell_state: array<u32>;
@group(0) @binding(2) var<storage, read> cell_plan: array<u32>;
@group(0) @binding(3) var<storage, read_write> cell_word: array<u32>;
@group(0) @binding(4) var<storage, read_write> tile_word: array<u32>;
@group(0) @binding(5) var<storage, read_write> tile_level: array<u32>;
@group(0) @binding(6) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(7) var<storage, read> pixel_lights: array<u32>;
@group(0) @binding(8) var<storage, read_write> level_map: array<u32>;
@group(0) @binding(9) var<storage, read_write> reason_map: array<u32>;

const EACH_LIGHT: u32 = 0x15555555u;
const OWN_PIXELS: u32 = 0x80000000u;
const TILE_LEVEL: u32 = 3u;
// Bits of pixel_lights: see light_bounds.
const FACED: u32 = 1u;
const AWAY: u32 = 2u;

fn is_uniform(word: u32) -> bool {
    return (word & (word >> 1u) & EACH_LIGHT) == 0u && (word & OWN_PIXELS) == 0u;
}

@compute @workgroup_size(64)
fn add(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    let place = cell_place(i, params.width);
    if i >= grid.end || any(place >= (vec2u(params.width, params.height) + 1u) / 2u) {
        return;
    }
    let state = cell_state[cell_in_image(place, params.width)];
    // The states' own values: lit 1, dark 2, zone 3.
    var word = (state << (2u * params.slot));
    let own = params.own_pixels != 0u || (cell_plan[i] & PLAN_TRACED) != 0u;
    word |= select(0u, OWN_PIXELS, state == STATE_ZONE && own);
    cell_word[i] |= word;
}

@compute @workgroup_size(64)
fn tiles(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    var word = 0u;
    for (var k = 0u; k < TILE_CELLS; k++) {
        word |= cell_word[i * TILE_CELLS + k];
    }
    tile_word[i] = word;
}

@compute @workgroup_size(64)
fn tops(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let tiles = (vec2u(params.width, params.height) + TILE - 1u) / TILE;
    let place = vec2u(i % tiles.x, i / tiles.x);
    var level = select(0u, TILE_LEVEL, is_uniform(tile_word[i]));
    for (var above = 1u; level == TILE_LEVEL + above - 1u && TILE_LEVEL + above <= params.coarsest; above++) {
        let lo = (place >> vec2u(above)) << vec2u(above);
        let hi = min(lo + (1u << above), tiles);
        var word = 0u;
        for (var y = lo.y; y < hi.y; y++) {
            for (var x = lo.x; x < hi.x; x++) {
                word |= tile_word[y * tiles.x + x];
            }
        }
        level += select(0u, 1u, is_uniform(word));
    }
    tile_level[i] = level;
}

// Level inside a tile that is not uniform.
fn small_level(cell: vec2u) -> u32 {
    let quad = cell & vec2u(0xfffffffeu);
    var word = 0u;
    for (var k = 0u; k < 4u; k++) {
        word |= cell_word[cell_index(quad + vec2u(k & 1u, k >> 1u), params.width)];
    }
    let own = (cell_word[cell_index(cell, params.width)] & OWN_PIXELS) != 0u;
    return select(select(1u, 0u, own), 2u, is_uniform(word));
}

@compute @workgroup_size(64)
fn map(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let pixel = vec2u(i % params.width, i / params.width);
    let tiles_x = (params.width + TILE - 1u) / TILE;
    let top = tile_level[(pixel.y / TILE) * tiles_x + pixel.x / TILE];
    let before = select(params.coarsest, level_map[i], params.again != 0u);
    let seen_alike = min(select(small_level(pixel / 2u), top, top != 0u), params.coarsest);
    let level = min(seen_alike, before);
    let kind = g_normal[i].w;
    let lights = pixel_lights[i];
    let away = select(REASON_BEHIND_LIGHT, REASON_FACING_AWAY, (lights & AWAY) != 0u);
    let split_why = select(REASON_VISIBILITY, reason_map[i], params.again != 0u && before < seen_alike);
    let shaded_why = select(split_why, REASON_COARSEST, level == params.coarsest);
    let culled = (lights & FACED) == 0u;
    if params.last == 0u {
        level_map[i] = level;
        reason_map[i] = shaded_why;
        return;
    }
    let level_seen = select(level, LEVEL_CULLED, kind != SURFACE || culled);
    let why = select(select(REASON_EMITTER, away, kind == SURFACE), shaded_why, kind == SURFACE && !culled);
    level_map[i] = select(level_seen, LEVEL_NOTHING, kind == NOTHING);
    reason_map[i] = select(why, REASON_NOTHING, kind == NOTHING);
}
