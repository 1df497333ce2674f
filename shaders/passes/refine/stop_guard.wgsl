// Guard of the stops of sub-fragment tests [KJ16 Sec. 3.1.3: what sees nothing is not refined]: that no sample is seen, or that
// all are, proves nothing, because something thin may lie between the samples (N20). Unless bounds prove it of each of its
// tiles, a node above level 2 that sees all or nothing of a light is split all the same, and one below asks all samples.
// In: bits of the sub-fragments, tile_flags. In and out: node_rows.

import package::common::grid::{Grid, item_index};
import package::common::light_frame::{DARK, FACING, LIT};
import package::common::nodes::{CHANGES, OPEN, SPLIT, node_rows};
import package::common::pyramid::{pyramid, texel_of};
import package::common::tiles::TILE;

struct StopGuardParams {
    first: u32,         // node of the first item
    words: u32,         // of bits a sub-fragment
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: StopGuardParams;
@group(0) @binding(1) var<storage, read> sub_bits: array<u32>;
@group(0) @binding(2) var<storage, read> tile_flags: array<u32>;

// Level of a tile.
const TILE_LEVEL: u32 = 3u;

// Whether nothing is proven of some tile that a texel lies in, or holds, and that faces the light.
fn is_open(texel: vec2u) -> bool {
    let tiles = (pyramid.levels[0].xy + TILE - 1u) / TILE;
    let above = max(pyramid.level, TILE_LEVEL) - TILE_LEVEL;
    let first = (texel << vec2u(above)) >> vec2u(TILE_LEVEL - min(pyramid.level, TILE_LEVEL));
    let last = min(first + (1u << above), tiles);
    var open = false;
    for (var y = first.y; y < last.y; y++) {
        for (var x = first.x; x < last.x; x++) {
            let flags = tile_flags[y * tiles.x + x];
            open = open || ((flags & FACING) != 0u && (flags & (LIT | DARK)) == 0u);
        }
    }
    return open;
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
    let row = node_rows[params.first + i];
    var both = vec2u(0u);
    for (var unit = 4u * i; unit < 4u * i + 4u; unit++) {
        for (var word = 0u; word < params.words; word++) {
            let at = 2u * unit * params.words + word;
            both += countOneBits(vec2u(sub_bits[at], sub_bits[at + params.words]));
        }
    }
    let stops = (row.z & SPLIT) == 0u && both.x > 0u && (both.y == 0u || both.y == both.x);
    let size = pyramid.levels[pyramid.level];
    if stops && is_open(texel_of(size, row.x - size.z)) {
        node_rows[params.first + i].z |= select(OPEN, CHANGES, pyramid.level >= TILE_LEVEL && pyramid.level > pyramid.finest);
    }
}
