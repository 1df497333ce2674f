// Light bounds: where the pixels of each tile lie as one light sees them, and what kind of tile that makes.
// In     the G-buffer, the light. Out: tile_bounds and tile_flags a tile; pixel_lights: bits of what any light does at
//        each pixel, added to from light to light; facing_count: pixels that face the light
// Rule   a workgroup holds eight tiles, a thread one row of eight pixels; the first thread of a tile joins its rows.
//        Culling is exact at a pixel [NPW10], and a tile is culled when all of its pixels are [Deviation: not by
//        the light's corners at one point of a fragment].

import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::light::{light_at, lights};
import package::common::light_facing::{Facing, facing_of};
import package::common::light_frame::{
    BACK, CLIPPED, FACING, FAR, LIT, LightFrame, MIXED_SIDES, NEAR, ON_SURFACE, PARTLY, TileBounds,
};
import package::common::surface::offset_origin;
import package::common::tiles::TILE;

struct LightBoundsParams {
    width: u32,
    height: u32,
    light: u32,
    unshadowed: u32,    // nothing can lie between
}

// Bits of pixel_lights.
const FACED: u32 = 1u;
const FACING_AWAY: u32 = 2u;
const BEHIND_LIGHT: u32 = 4u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: LightBoundsParams;
@group(0) @binding(1) var<uniform> frame: LightFrame;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> tile_bounds: array<TileBounds>;
@group(0) @binding(6) var<storage, read_write> tile_flags: array<u32>;
@group(0) @binding(7) var<storage, read_write> pixel_lights: array<u32>;
@group(0) @binding(8) var<storage, read_write> facing_count: array<atomic<u32>>;

const FRONT_SIDE: u32 = 0x10000u;
const BACK_SIDE: u32 = 0x20000u;
const NOWHERE: f32 = 3.0e38;

struct Row {
    lo: vec3f,
    facing: u32,
    hi: vec3f,
    flags: u32,
}

var<workgroup> rows: array<Row, 64>;

fn row_of(index: u32) -> Row {
    let tiles_x = (params.width + TILE - 1u) / TILE;
    let tile = index / TILE;
    let y = (tile / tiles_x) * TILE + index % TILE;
    let light = light_at(params.light);
    var row = Row(vec3f(NOWHERE), 0u, vec3f(-NOWHERE), 0u);
    for (var column = 0u; column < TILE; column++) {
        let x = (tile % tiles_x) * TILE + column;
        let inside = x < params.width && y < params.height;
        let at = select(0u, y * params.width + x, inside);
        let normal = g_normal[at];
        if !inside || normal.w != SURFACE {
            continue;
        }
        let position = g_position[at];
        let normal_geo = floats(g_geometric[at]);
        let origin = offset_origin(floats(position), normal_geo, bitcast<f32>(position.w));
        let f = facing_of(light, frame, origin, normal_geo, floats(normal));
        row.flags |= ON_SURFACE;
        pixel_lights[at] |= select(select(FACING_AWAY, BEHIND_LIGHT, f.behind), FACED, f.facing);
        if f.facing {
            row.lo = min(row.lo, f.place);
            row.hi = max(row.hi, f.place);
            row.facing++;
            row.flags |= FACING | select(0u, CLIPPED, f.clipped) | select(FAR, NEAR, f.near);
            row.flags |= select(BACK_SIDE, FRONT_SIDE, f.place.z > 0.0);
        }
    }
    return row;
}

fn join(first: u32) -> Row {
    var all = rows[first];
    for (var i = 1u; i < TILE; i++) {
        all.lo = min(all.lo, rows[first + i].lo);
        all.hi = max(all.hi, rows[first + i].hi);
        all.facing += rows[first + i].facing;
        all.flags |= rows[first + i].flags;
    }
    return all;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        rows[lane] = row_of(i);
    }
    workgroupBarrier();
    if lane % TILE == 0u && i < grid.end {
        var tile = join(lane);
        let back = (tile.flags & BACK_SIDE) != 0u;
        let mixed = back && (tile.flags & FRONT_SIDE) != 0u;
        let turned = vec2f(-tile.hi.z, -tile.lo.z);
        let h = select(vec2f(tile.lo.z, tile.hi.z), turned, back && !mixed);
        tile_bounds[i / TILE] = TileBounds(vec3f(tile.lo.xy, h.x), tile.facing, vec3f(tile.hi.xy, h.y), 0u);
        let lit = select(0u, LIT, params.unshadowed != 0u && tile.facing > 0u);
        let partly = select(0u, PARTLY, tile.facing > 0u && tile.facing < TILE * TILE);
        let sides = select(select(0u, BACK, back), MIXED_SIDES, mixed);
        tile_flags[i / TILE] = (tile.flags & 0xffffu) | sides | partly | lit;
        if tile.facing > 0u {
            atomicAdd(&facing_count[0], tile.facing);
        }
    }
}
