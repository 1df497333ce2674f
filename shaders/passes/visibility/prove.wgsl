// Prove: which tiles see a whole light, and which none of it, without a ray.
// In     tile_bounds, the G-buffer, the trees (common/bvh). Out: LIT or DARK in tile_flags
// Rule   a workgroup has a tile: its threads share the nodes of one level of the trees after the other, then each has a
//        pixel. No order shows. LIT: no triangle that reaches the hull of the tile's ray origins and the light can lie
//        between the light and any of its pixels. DARK: one triangle hides the light from the whole tile; it is looked
//        for along the line of their middles.
// Limits NODES and TRIANGLES a tile, then nothing is proven. Deviation from the native form: shading normals do not
//        count, and what the pixels of a flat tile have in common is not used; both prove a little more there.

import package::common::bvh::{Node, instances, mesh_nodes, top_level, top_nodes, triangles};
import package::common::gbuffer::floats;
import package::common::grid::{Grid, item_index};
import package::common::light_frame::{BACK, DARK, FACING, LIT, LightFrame, MIXED_SIDES, TileBounds};
import package::common::ray::MISS;
import package::common::separation::{Box, Corners, beside_pyramid, box_heights, hides, hull_meets, one_side, plane_of, under_horizon};
import package::common::to_light::{ToLight, box_in_light, corners_in_light, dual, to_light};
import package::common::tiles::{TILE_PIXELS, pixel_in_tile_order};

struct ProveParams {
    width: u32,
    height: u32,
    pad0: u32,
    pad1: u32,
}

const SIZE: u32 = 64u;
const NODES: u32 = 512u;        // of binary trees
const TRIANGLES: u32 = 32u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ProveParams;
@group(0) @binding(1) var<uniform> frame: LightFrame;
@group(0) @binding(2) var<storage, read> tile_bounds: array<TileBounds>;
@group(0) @binding(3) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> tile_flags: array<u32>;

struct Tile {
    origin: Box,
    light: Box,
    scene: ToLight,
    edges: mat3x3f, // takes a normal to the light's coordinates
    far: f32,
}

// Nodes to visit, of this level and of the next: an instance's slot and 1, or 0 for the top level; the node in its tree.
var<workgroup> open: array<vec2u, 2 * NODES>;
var<workgroup> opened: atomic<u32>;
// What may hide some of the light, or what hides all of it.
var<workgroup> suspects: array<Corners, TRIANGLES>;
var<workgroup> suspected: atomic<u32>;
var<workgroup> harmed: atomic<u32>;
// For all threads to see the same.
var<workgroup> shared_size: u32;
var<workgroup> shared_count: u32;

// True when the pixel may face the light and a suspect may hide some of the light from it.
fn harms_pixel(tile: Tile, count: u32, pixel: vec2u) -> bool {
    let at = pixel.y * params.width + pixel.x;
    if pixel.x >= params.width || pixel.y >= params.height || g_geometric[at].w == MISS {
        return false;
    }
    let position = g_position[at];
    let normal_geo = floats(g_geometric[at]);
    let origin = (floats(position) + normal_geo * bitcast<f32>(position.w) - frame.corner) * tile.scene.rows;
    let normal = normal_geo * tile.edges;
    let slack = tile.scene.slack;
    // Facing pixels lie inside the bounds, which were found by the same sums; the highest corner must be in sight.
    let highest = dot(max(-origin * normal, (tile.light.hi - origin) * normal), vec3f(1.0));
    let outside = any(origin < tile.origin.lo - slack) || any(origin > tile.origin.hi + slack);
    if outside || highest <= -dot(abs(normal), slack) {
        return false;
    }
    for (var i = 0u; i < count; i++) {
        let t = suspects[i];
        let plane = plane_of(t);
        let apart = one_side(plane, box_heights(plane, Box(origin, origin)), box_heights(plane, tile.light));
        if !apart && !under_horizon(t, origin, normal) && !beside_pyramid(t, origin, tile.light.hi.xy) {
            return true;
        }
    }
    return false;
}

fn test_leaf(tile: Tile, map: ToLight, node: Node, base: u32, dark: bool) {
    for (var i = 0u; i < node.count; i++) {
        let t = corners_in_light(map, triangles[base + node.first + i]);
        if dark {
            if hides(t, tile.origin, tile.light) {
                atomicAdd(&suspected, 1u);
            }
            continue;
        }
        let reached = Box(min(min(t.a, t.b), t.c), max(max(t.a, t.b), t.c));
        let plane = plane_of(t);
        let apart = one_side(plane, box_heights(plane, tile.origin), box_heights(plane, tile.light));
        if !apart && hull_meets(tile.origin, tile.light, 2.0 * map.slack, reached) {
            let at = atomicAdd(&suspected, 1u);
            if at < TRIANGLES {
                suspects[at] = t;
            }
        }
    }
}

fn visit(tile: Tile, start: Box, end: Box, at: vec2u, next: u32, dark: bool) {
    var map = tile.scene;
    var node: Node;
    var base = 0u;
    if at.x == 0u {
        node = top_nodes[at.y];
    } else {
        let placed = instances[at.x - 1u];
        let linear = dual(mat3x3f(placed.row_x, placed.row_y, placed.row_z));
        // The dual has the inverse's columns: a row of the map is a row of the frame times the inverse.
        map = to_light(tile.scene.rows, linear, placed.center - frame.corner, abs(placed.reach), tile.far);
        node = mesh_nodes[placed.node + at.y];
        base = placed.triangle;
    }
    if !hull_meets(start, end, 2.0 * map.slack, box_in_light(map, node)) {
        return;
    }
    // More than NODES are one level's end, so that none need be kept.
    if node.count == 0u {
        let k = atomicAdd(&opened, 2u);
        if k + 1u < NODES {
            open[next + k] = vec2u(at.x, node.first);
            open[next + k + 1u] = vec2u(at.x, node.first + 1u);
        }
    } else if at.x == 0u {
        let k = atomicAdd(&opened, 1u);
        if k < NODES {
            open[next + k] = vec2u(node.first + 1u, 0u);
        }
    } else {
        test_leaf(tile, map, node, base, dark);
    }
}

// Visits all that segments between two boxes reach. How many suspects there are; more than TRIANGLES when there are too
// many of them, or of nodes; with `dark` what hides all, and 0 when there are too many nodes. Called by all threads.
fn search(tile: Tile, start: Box, end: Box, dark: bool, lane: u32) -> u32 {
    if lane == 0u {
        open[0] = vec2u(0u);
        atomicStore(&opened, 0u);
        atomicStore(&suspected, 0u);
        shared_size = select(0u, 1u, top_level.nodes > 0u);
    }
    var size = workgroupUniformLoad(&shared_size);
    var count = 0u;
    var visited = size;
    var here = 0u;
    while size > 0u && visited <= NODES && count <= select(TRIANGLES, 0u, dark) {
        for (var i = lane; i < size; i += SIZE) {
            visit(tile, start, end, open[here + i], NODES - here, dark);
        }
        workgroupBarrier();
        if lane == 0u {
            shared_size = atomicExchange(&opened, 0u);
            shared_count = atomicLoad(&suspected);
        }
        size = workgroupUniformLoad(&shared_size);
        count = workgroupUniformLoad(&shared_count);
        visited += size;
        here = NODES - here;
    }
    return select(count, select(TRIANGLES + 1u, count, dark), visited > NODES);
}

fn tile_at(index: u32, known: u32) -> Tile {
    let bounds = tile_bounds[index];
    let normal = select(frame.normal, -frame.normal, (known & BACK) != 0u);
    let rows = mat3x3f(frame.dual_u, frame.dual_v, normal);
    let reach = max(abs(top_nodes[0].lo), abs(top_nodes[0].hi));
    let out = max(reach, abs(frame.corner));
    let far = max(max(out.x, out.y), out.z);
    let identity = mat3x3f(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let scene = to_light(rows, identity, -frame.corner, far, far);
    let light = Box(vec3f(0.0), vec3f(frame.extent_a, frame.extent_b, 0.0));
    return Tile(Box(bounds.lo, bounds.hi), light, scene, dual(rows), far);
}

// Whether any pixel of the tile is harmed by any suspect; called by all threads.
fn harms(tile: Tile, count: u32, pixel: vec2u, lane: u32) -> bool {
    if lane == 0u {
        atomicStore(&harmed, 0u);
    }
    workgroupBarrier();
    if harms_pixel(tile, count, pixel) {
        atomicStore(&harmed, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        shared_count = atomicLoad(&harmed);
    }
    return workgroupUniformLoad(&shared_count) != 0u;
}

// What is proven; called by all threads.
fn prove(tile: Tile, pixel: vec2u, lane: u32) -> u32 {
    let count = search(tile, tile.origin, tile.light, false, lane);
    if count <= TRIANGLES {
        if !harms(tile, count, pixel, lane) {
            return LIT;
        }
    }
    let here = 0.5 * (tile.origin.lo + tile.origin.hi);
    let there = 0.5 * tile.light.hi;
    return select(0u, DARK, search(tile, Box(here, here), Box(there, there), true, lane) > 0u);
}

// An item is a pixel of a tile.
@compute @workgroup_size(SIZE)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = item_index(grid, group, groups, SIZE, 0u);
    let index = select(0u, first / SIZE, first < grid.end);
    let known = tile_flags[index];
    let tile = tile_at(index, known);
    // On the light's own plane nothing can be told apart.
    let asked = (known & (FACING | MIXED_SIDES | LIT | DARK)) == FACING && tile.origin.lo.z > tile.scene.slack.z;
    if lane == 0u {
        shared_count = select(0u, 1u, asked && first < grid.end);
    }
    if workgroupUniformLoad(&shared_count) == 0u {
        return;
    }
    let proven = prove(tile, pixel_in_tile_order(index * TILE_PIXELS + lane, params.width), lane);
    if lane == 0u {
        tile_flags[index] = known | proven;
    }
}
