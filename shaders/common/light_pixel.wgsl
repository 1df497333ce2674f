// A pixel as one light sees it: its place and normals in the light's own axes, and what is known of its share.

import package::common::cells::{STATE_LIT, STATE_ZONE, cell_in_image};
import package::common::gbuffer::{SURFACE, floats};
import package::common::light_frame::{DARK, LIT};
import package::common::tiles::{TILE_PIXELS, pixel_in_tile_order};

struct IrradianceParams {
    corner: vec3f,      // scene space; of a spot its position
    width: u32,         // of the image
    axis_x: vec3f,      // unit: along edge u, across it in the plane, the lit side's normal or a spot's axis
    height: u32,
    axis_y: vec3f,
    two_sided: u32,
    axis_z: vec3f,
    tiles: u32,
    radiance: vec3f,    // mean radiance, or a spot's intensity
    textured: u32,      // 1: `share` holds a factor wherever the light is seen
    edge: vec4f,        // in sizes: u = (x, 0), v = (y, z), |v| = w
    along_v: vec2f,     // direction of edge v
    size: f32,          // length of the longer edge, scene units; 1 for a spot
    cos_cutoff: f32,    // of a spot; -2 for an area light
    kind: u32,          // which list of tiles
    first_node: u32,    // of a textured light's table
    nodes: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: IrradianceParams;
@group(0) @binding(1) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(2) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read> tile_flags: array<u32>;
@group(0) @binding(5) var<storage, read> cell_state: array<u32>;
@group(0) @binding(6) var<storage, read> tile_list: array<u32>;

// Fills the last row of a folded dispatch.
const NO_TILE: u32 = 0xffffffffu;
// A list may need that many of them.
const MOST_ROWS: u32 = 64u;

// What is known of a pixel's share of the light.
const UNSEEN: u32 = 0u;
const WHOLE: u32 = 1u;
const PART: u32 = 2u;

struct LightPixel {
    at: u32,            // in image order
    live: bool,         // a surface on a side that the light shines to
    seen: u32,
    n: vec3f,           // unit normals in the light's axes
    g: vec3f,
    corner: vec3f,      // of the light from here, in sizes
}

fn in_light_axes(v: vec3f) -> vec3f {
    return vec3f(dot(v, params.axis_x), dot(v, params.axis_y), dot(v, params.axis_z));
}

// Pixel `lane` of the tile at place `index` of the list. A cell of no class has nothing to light.
fn light_pixel(index: u32, lane: u32) -> LightPixel {
    let tile = tile_list[params.kind * (params.tiles + MOST_ROWS) + index];
    let pixel = pixel_in_tile_order(min(tile, params.tiles - 1u) * TILE_PIXELS + lane, params.width);
    let inside = tile != NO_TILE && pixel.x < params.width && pixel.y < params.height;
    let held = min(pixel, vec2u(params.width - 1u, params.height - 1u));
    let at = held.y * params.width + held.x;
    let corner = in_light_axes(params.corner - floats(g_position[at])) / params.size;
    let emits = corner.z < 0.0 || params.two_sided != 0u;
    let flags = tile_flags[min(tile, params.tiles - 1u)];
    let state = cell_state[cell_in_image(held / 2u, params.width)] & 3u;
    var seen = select(UNSEEN, WHOLE, state == STATE_LIT);
    seen = select(seen, PART, state == STATE_ZONE);
    seen = select(seen, UNSEEN, (flags & DARK) != 0u);
    seen = select(seen, WHOLE, (flags & LIT) != 0u);
    let normal = g_normal[at];
    return LightPixel(
        at, inside && emits && normal.w == SURFACE, seen, in_light_axes(floats(normal)),
        in_light_axes(floats(g_geometric[at])), corner);
}
