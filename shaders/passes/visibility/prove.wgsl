// Prove: which tiles see a whole light, and which none of it, without a ray.
// In     tile_bounds, the G-buffer, the trees (common/bvh). Out: LIT or DARK in tile_flags
// Rule   a thread has a tile. LIT: no triangle that reaches the hull of the tile's ray origins and the light can lie
//        between the light and any of its pixels. DARK: one triangle hides the light from the whole tile; it is looked
//        for along the line of their middles.
// Limits NODES and TRIANGLES a tile, then nothing is proven. Deviation from the native form: shading normals do not
//        count, and what the pixels of a flat tile have in common is not used; both prove a little more there.

import package::common::bvh::{Node, STACK, Triangle, instances, mesh_nodes, top_level, top_nodes, triangles};
import package::common::gbuffer::floats;
import package::common::grid::{Grid, item_index};
import package::common::light_frame::{BACK, DARK, FACING, LIT, LightFrame, MIXED_SIDES, TileBounds};
import package::common::ray::MISS;
import package::common::separation::{Box, Corners, beside_pyramid, box_heights, hides, hull_meets, one_side, plane_of, under_horizon};
import package::common::tiles::{TILE_PIXELS, pixel_in_tile_order};

struct ProveParams {
    width: u32,
    height: u32,
    pad0: u32,
    pad1: u32,
}

const NODES: u32 = 512u;        // of binary trees
const TRIANGLES: u32 = 32u;
// Rounding of a coordinate as a share of the largest term in it: 16 units in the last place.
const ROUNDING: f32 = 9.5367431640625e-7;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ProveParams;
@group(0) @binding(1) var<uniform> frame: LightFrame;
@group(0) @binding(2) var<storage, read> tile_bounds: array<TileBounds>;
@group(0) @binding(3) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> tile_flags: array<u32>;

// An affine map into the light's coordinates: rows, offset, and a bound of what rounding does.
struct ToLight {
    rows: mat3x3f,  // a column is a row of the map
    at: vec3f,
    slack: vec3f,
}

struct Tile {
    index: u32,
    origin: Box,
    light: Box,
    scene: ToLight,
    edges: mat3x3f, // takes a normal to the light's coordinates
    far: f32,
    nodes: u32,     // left to visit
    triangles: u32, // left to test
}

fn size(v: vec3f) -> f32 {
    return dot(abs(v), vec3f(1.0));
}

// The transposed inverse: of rows the columns of the inverse.
fn dual(m: mat3x3f) -> mat3x3f {
    let x = cross(m[1], m[2]);
    let y = cross(m[2], m[0]);
    let z = cross(m[0], m[1]);
    return mat3x3f(x, y, z) * (1.0 / dot(m[0], x));
}

// From a space with origin `center` (seen from the light's corner) and these columns, reaching `reach`.
fn to_light(rows: mat3x3f, columns: mat3x3f, center: vec3f, reach: f32, far: f32) -> ToLight {
    let turned = mat3x3f(rows[0] * columns, rows[1] * columns, rows[2] * columns);
    let own = vec3f(size(turned[0]), size(turned[1]), size(turned[2]));
    let whole = vec3f(size(rows[0]), size(rows[1]), size(rows[2]));
    return ToLight(turned, center * rows, ROUNDING * (own * reach + whole * far));
}

fn place(map: ToLight, p: vec3f) -> vec3f {
    return p * map.rows + map.at;
}

fn box_in_light(map: ToLight, node: Node) -> Box {
    let half = 0.5 * (node.hi - node.lo);
    let middle = place(map, node.lo + half);
    let reach = half * mat3x3f(abs(map.rows[0]), abs(map.rows[1]), abs(map.rows[2]));
    return Box(middle - reach, middle + reach);
}

fn corners_in_light(map: ToLight, t: Triangle) -> Corners {
    return Corners(place(map, t.a), place(map, t.b), place(map, t.c), map.slack);
}

// True when the pixel may face the light and the triangle may hide some of the light from it.
fn harms_pixel(tile: ptr<function, Tile>, t: Corners, pixel: vec2u) -> bool {
    let at = pixel.y * params.width + pixel.x;
    if pixel.x >= params.width || pixel.y >= params.height || g_geometric[at].w == MISS {
        return false;
    }
    let position = g_position[at];
    let normal_geo = floats(g_geometric[at]);
    let origin = (floats(position) + normal_geo * bitcast<f32>(position.w) - frame.corner) * (*tile).scene.rows;
    let normal = normal_geo * (*tile).edges;
    let slack = (*tile).scene.slack;
    // Facing pixels lie inside the bounds, which were found by the same sums; the highest corner must be in sight.
    let highest = dot(max(-origin * normal, ((*tile).light.hi - origin) * normal), vec3f(1.0));
    let outside = any(origin < (*tile).origin.lo - slack) || any(origin > (*tile).origin.hi + slack);
    if outside || highest <= -dot(abs(normal), slack) {
        return false;
    }
    let here = box_heights(plane_of(t), Box(origin, origin));
    let light = box_heights(plane_of(t), (*tile).light);
    return !one_side(plane_of(t), here, light) && !under_horizon(t, origin, normal)
        && !beside_pyramid(t, origin, (*tile).light.hi.xy);
}

fn harms(tile: ptr<function, Tile>, t: Corners) -> bool {
    for (var i = 0u; i < TILE_PIXELS; i++) {
        if harms_pixel(tile, t, pixel_in_tile_order((*tile).index * TILE_PIXELS + i, params.width)) {
            return true;
        }
    }
    return false;
}

// True when the search is over: with `dark` a triangle of the leaf hides all, else one may hide some.
fn test_leaf(tile: ptr<function, Tile>, map: ToLight, node: Node, base: u32, dark: bool) -> bool {
    for (var i = 0u; i < node.count; i++) {
        let t = corners_in_light(map, triangles[base + node.first + i]);
        if dark {
            if hides(t, (*tile).origin, (*tile).light) {
                return true;
            }
            continue;
        }
        let reached = Box(min(min(t.a, t.b), t.c), max(max(t.a, t.b), t.c));
        let plane = plane_of(t);
        let apart = one_side(plane, box_heights(plane, (*tile).origin), box_heights(plane, (*tile).light));
        if apart || !hull_meets((*tile).origin, (*tile).light, 2.0 * map.slack, reached) {
            continue;
        }
        if (*tile).triangles == 0u || harms(tile, t) {
            return true;
        }
        (*tile).triangles--;
    }
    return false;
}

// Walks through all that segments between two boxes reach; true as for test_leaf.
fn walk(tile: ptr<function, Tile>, start: Box, end: Box, dark: bool) -> bool {
    var stack: array<u32, STACK>;
    var depth = select(0u, 1u, top_level.nodes > 0u);
    var bottom = 0u;    // entries above it are of the mesh that the walk is in
    var map = (*tile).scene;
    var first_node = 0u;
    var first_triangle = 0u;
    var inside = false;
    while depth > 0u {
        if inside && depth == bottom {
            inside = false;
            map = (*tile).scene;
        }
        depth--;
        var node: Node;
        if inside {
            node = mesh_nodes[first_node + stack[depth]];
        } else {
            node = top_nodes[stack[depth]];
        }
        if (*tile).nodes == 0u {
            return !dark;
        }
        (*tile).nodes--;
        if !hull_meets(start, end, 2.0 * map.slack, box_in_light(map, node)) {
            continue;
        }
        if node.count == 0u {
            stack[depth] = node.first;
            stack[depth + 1u] = node.first + 1u;
            depth += 2u;
        } else if !inside {
            let placed = instances[node.first];
            let linear = dual(mat3x3f(placed.row_x, placed.row_y, placed.row_z));
            // The dual has the inverse's columns: a row of the map is a row of the frame times the inverse.
            map = to_light((*tile).scene.rows, linear, placed.center - frame.corner, abs(placed.reach), (*tile).far);
            first_node = placed.node;
            first_triangle = placed.triangle;
            inside = true;
            bottom = depth;
            stack[depth] = 0u;
            depth++;
        } else if test_leaf(tile, map, node, first_triangle, dark) {
            return true;
        }
    }
    return false;
}

fn prove(index: u32, known: u32) -> u32 {
    let bounds = tile_bounds[index];
    let normal = select(frame.normal, -frame.normal, (known & BACK) != 0u);
    let rows = mat3x3f(frame.dual_u, frame.dual_v, normal);
    let reach = max(abs(top_nodes[0].lo), abs(top_nodes[0].hi));
    let out = max(reach, abs(frame.corner));
    let far = max(max(out.x, out.y), out.z);
    let identity = mat3x3f(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let scene = to_light(rows, identity, -frame.corner, far, far);
    let light = Box(vec3f(0.0), vec3f(frame.extent_a, frame.extent_b, 0.0));
    let origin = Box(bounds.lo, bounds.hi);
    var tile = Tile(index, origin, light, scene, dual(rows), far, NODES, TRIANGLES);
    // On the light's own plane nothing can be told apart.
    if !(origin.lo.z > scene.slack.z) {
        return 0u;
    }
    if !walk(&tile, origin, light, false) {
        return LIT;
    }
    tile.nodes = NODES;
    let here = 0.5 * (origin.lo + origin.hi);
    let there = 0.5 * light.hi;
    return select(0u, DARK, walk(&tile, Box(here, here), Box(there, there), true));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let known = tile_flags[i];
        if (known & (FACING | MIXED_SIDES | LIT | DARK)) == FACING {
            tile_flags[i] = known | prove(i, known);
        }
    }
}
