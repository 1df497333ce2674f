// Guard of the stops of sub-fragment tests [KJ16 Sec. 3.1.3: what sees nothing is not refined]: that all sub-fragments see the
// same samples proves nothing, because something thin may lie between the samples (N20). Unless bounds prove of each of its tiles
// that it sees all or nothing of a light, a node above level 2 is split all the same, and one below asks all samples.
// In: tile_flags. In and out: node_rows.

import package::common::grid::{Grid, item_index};
import package::common::light_frame::{DARK, FACING, LIT, PARTLY};
import package::common::nodes::{CHANGES, OPEN, SPLIT, node_rows};
import package::common::pyramid::{pyramid, texel_of};
import package::common::tiles::TILE;

struct StopGuardParams {
    first: u32,         // node of the first item
    hard: u32,          // 1: of a spot, whose cone has an edge
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: StopGuardParams;
@group(0) @binding(1) var<storage, read> tile_flags: array<u32>;

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
            let unproven = (flags & FACING) != 0u && (flags & (LIT | DARK)) == 0u;
            open = open || unproven || (params.hard != 0u && (flags & PARTLY) != 0u);
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
    let size = pyramid.levels[pyramid.level];
    if (row.z & SPLIT) == 0u && is_open(texel_of(size, row.x - size.z)) {
        node_rows[params.first + i].z |= select(OPEN, CHANGES, pyramid.level >= TILE_LEVEL && pyramid.level > pyramid.finest);
    }
}
