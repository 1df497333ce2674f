// Zone: which cells are lit, which are dark, and which lie in or beside a penumbra. A block of strata on which a cell and
// its eight neighbours agree is not asked again [NPW10: incremental visibility]; where they agree on all of them to the
// same answer there is no shadow's edge.
// In     tile_flags, cell_bits, cell_surface. Out: cell_state (image order), cell_agreed (low half: blocks agreed on, high
//        half: to what, or of the others: those that lie beside, of which one answer is enough), cell_plan (PLAN_ZONE
//        where the cell lies in the zone)

import package::common::cells::{FLAT, LEAST_COSINE, PLAN_CALM, PLAN_ZONE, STATE_DARK, STATE_LIT, STATE_NONE, STATE_ZONE, TILE_CELLS, cell_in_image, cell_index, cell_place};
import package::common::grid::{Grid, item_index};
import package::common::light_frame::{DARK, FACING, LIT};
import package::common::list_params::ListParams;
import package::common::strata::BLOCKS;
import package::common::tiles::TILE;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(1) var<storage, read> tile_flags: array<u32>;
@group(0) @binding(2) var<storage, read> cell_bits: array<u32>;
@group(0) @binding(3) var<storage, read_write> cell_state: array<u32>;
@group(0) @binding(4) var<storage, read_write> cell_agreed: array<u32>;
@group(0) @binding(5) var<storage, read_write> cell_plan: array<u32>;
@group(0) @binding(6) var<storage, read_write> share: array<vec4f>;
@group(0) @binding(7) var<storage, read> cell_surface: array<vec4f>;

const ALL: u32 = 0xffffu;

// As in cell_bits; what a proof says counts as asked.
fn bits_of(index: u32) -> u32 {
    let flags = tile_flags[index / TILE_CELLS];
    let proven = select(select(cell_bits[index], 0xffff0000u, (flags & DARK) != 0u), 0xffffffffu, (flags & LIT) != 0u);
    return select(0u, proven, (flags & FACING) != 0u);
}

// Cells on the same surface, of nine, whose agreement counts.
const ENOUGH: u32 = 6u;
// With no more blocks than these in doubt, all on one surface, a cell needs no answers of its pixels.
const CALM_BLOCKS: u32 = 3u;
// Value of `reuse` for lights that are not alone: of blocks beside those in doubt one answer is enough.
const THRIFTY: u32 = 2u;

struct Votes {
    seen: u32,      // blocks that some cell sees
    hidden: u32,    // blocks that some cell does not see
    away: u32,      // blocks that some cell is turned away from
    alike: u32,     // cells on the same surface
}

// Whether two cells of open tiles lie on one surface: others have none.
fn same_surface(a: u32, b: u32) -> bool {
    let here = cell_surface[2u * a];
    let there = cell_surface[2u * b];
    let normal = cell_surface[2u * a + 1u].xyz;
    let to = there.xyz - here.xyz;
    let height = dot(to, normal);
    let flat = height * height <= FLAT * FLAT * dot(to, to);
    return here.w * there.w > 0.0 && flat && dot(normal, cell_surface[2u * b + 1u].xyz) >= LEAST_COSINE;
}

fn neighbours(place: vec2u, own: u32) -> Votes {
    let cells = (vec2u(params.width, params.height) + 1u) / 2u;
    let lo = vec2u(max(vec2i(place) - 1, vec2i(0)));
    let hi = min(place + 1u, cells - 1u);
    var votes = Votes(0u, 0u, 0u, 0u);
    for (var y = lo.y; y <= hi.y; y++) {
        for (var x = lo.x; x <= hi.x; x++) {
            let index = cell_index(vec2u(x, y), params.width);
            let bits = bits_of(index);
            votes.seen |= bits & (bits >> 16u);
            votes.away |= bits & ~(bits >> 16u) & ALL;
            votes.hidden |= (bits >> 16u) & ~bits & ALL;
            let known = tile_flags[index / TILE_CELLS] & (FACING | LIT | DARK);
            let alike = known > FACING || (known == FACING && same_surface(own, index));
            votes.alike += select(0u, 1u, alike);
        }
    }
    return votes;
}

// Blocks and those beside them on the light.
fn with_beside(blocks: u32) -> u32 {
    let across = params.blocks_u;
    var first_column = 0u;
    for (var b = 0u; b < BLOCKS; b += across) {
        first_column |= 1u << b;
    }
    let to_right = (blocks << 1u) & ~first_column;
    let to_left = (blocks & ~first_column) >> 1u;
    return (blocks | to_right | to_left | (blocks << across) | (blocks >> across)) & ALL;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    let place = cell_place(i, params.width);
    let cells = (vec2u(params.width, params.height) + 1u) / 2u;
    if i >= grid.end {
        return;
    }
    let flags = tile_flags[i / TILE_CELLS];
    let proven = (flags & (LIT | DARK)) != 0u;
    let own = bits_of(i);
    let votes = neighbours(min(place, cells - 1u), i);
    let agreed = (votes.seen ^ votes.hidden) & ALL;
    // What all are turned away from is in nobody's way.
    let nowhere = votes.away & ~(votes.seen | votes.hidden);
    let all_agree = (agreed | nowhere) == ALL && (votes.seen == 0u || votes.hidden == 0u);
    var state = select(STATE_ZONE, select(STATE_DARK, STATE_LIT, votes.hidden == 0u), all_agree);
    state = select(state, select(STATE_DARK, STATE_LIT, (flags & LIT) != 0u), proven);
    state = select(state, STATE_NONE, own == 0u);
    if all(place < cells) {
        cell_state[cell_in_image(place, params.width)] = state;
    }
    let voted = select(0u, agreed, votes.alike >= ENOUGH && params.reuse != 0u);
    let sure = voted & ~with_beside(ALL & ~(voted | nowhere));
    let once = select(0u, voted & ~sure, params.reuse == THRIFTY);
    cell_agreed[i] = sure | (((votes.seen & sure) | once) << 16u);
    let calm = params.reuse != 0u && votes.alike == 9u && countOneBits(ALL & ~(agreed | nowhere)) <= CALM_BLOCKS;
    cell_plan[i] = select(0u, PLAN_ZONE | select(0u, PLAN_CALM, calm), state == STATE_ZONE && all(place < cells));
}

// Of a spot each pixel has its own answer, and nothing is left to ask.
@compute @workgroup_size(64)
fn spot(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    let place = cell_place(i, params.width);
    let cells = (vec2u(params.width, params.height) + 1u) / 2u;
    if i >= grid.end || any(place >= cells) {
        return;
    }
    let bits = bits_of(i);
    let seen = bits & ALL;
    let was_asked = bits >> 16u;
    var state = select(select(STATE_ZONE, STATE_DARK, seen == 0u), STATE_LIT, seen == was_asked);
    state = select(state, STATE_NONE, was_asked == 0u);
    cell_state[cell_in_image(place, params.width)] = state;
    for (var k = 0u; k < 4u; k++) {
        let pixel = place * 2u + vec2u(k & 1u, k >> 1u);
        if state == STATE_ZONE && all(pixel < vec2u(params.width, params.height)) {
            share[pixel.y * params.width + pixel.x] = vec4f(f32((seen >> k) & 1u));
        }
    }
}
