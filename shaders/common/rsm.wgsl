// Reflective shadow maps [DS05]: how their texels look out of a light, and what they hold. A spot has one map, a frustum
// that encloses its cone; an area light a map for each lit side, of tiles x tiles hemispheres side by side, each about
// the middle of one of as many equal parts of the light, its texels of equal projected solid angle [SC97].

import package::common::basis::{PI, cosine_direction, tangents};

const RSM_SPOT: u32 = 0u;
const RSM_AREA: u32 = 1u;
// Depth of a texel that sees no surface.
const RSM_FAR: f32 = 3.0e38;
// No surface is taken to be seen more obliquely than this: its area would be without bound.
const LEAST_COSINE: f32 = 0.05;

struct RsmMap {
    origin: vec3f,      // a spot's position; an area light's corner
    kind: u32,          // RSM_SPOT, RSM_AREA
    axis: vec3f,        // unit: what the map looks along
    tan_half: f32,      // spot: half of the frustum's width at distance 1
    edge_u: vec3f,      // area light
    cos_cutoff: f32,    // spot: cosine of the cone's half-angle
    edge_v: vec3f,
    offset: f32,        // how far off the light rays start
    tiles: u32,         // along an edge; spot: 1
    resolution: u32,    // texels along an edge of the map, a power of two
    equal: f32,         // spot: the solid angle that every texel is given [NSW09 Eq. 4]; 0: each its own
    map: u32,           // its number
}

// Three rows a texel, map by map and row by row: xyz position, w distance from the light (RSM_FAR: no surface) | xyz
// normal towards the light, w solid angle (area light: projected solid angle over its tiles) inside of the cone |
// rgb flux that is reflected, w area of the surface that the texel sees.
const RSM_ROWS: u32 = 3u;

// Which tile a place in the unit square of the map lies in.
fn rsm_tile(map: RsmMap, place: vec2f) -> vec2u {
    return min(vec2u(place * f32(map.tiles)), vec2u(map.tiles - 1u));
}

// Where the rays of a place start.
fn rsm_origin(map: RsmMap, tile: vec2u) -> vec3f {
    let ab = (vec2f(tile) + 0.5) / f32(map.tiles);
    let on_light = map.origin + ab.x * map.edge_u + ab.y * map.edge_v + map.offset * map.axis;
    return select(on_light, map.origin, map.kind == RSM_SPOT);
}

// Where a place of a tile looks; unit. The place may lie on the tile's border.
fn rsm_direction(map: RsmMap, tile: vec2u, place: vec2f) -> vec3f {
    if map.kind == RSM_SPOT {
        return normalize(map.axis + map.tan_half * (tangents(map.axis) * (2.0 * place - 1.0)));
    }
    return cosine_direction(map.axis, place * f32(map.tiles) - vec2f(tile));
}
