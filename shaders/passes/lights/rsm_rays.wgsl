// Rays of the texels of a reflective shadow map, and what they meet [DS05].
//   main   a ray through the middle of each texel
//   store  position, normal, reflected flux [DS05; NSW09 Eqs. 2, 3]
// Flux is intensity times solid angle; Deviation: the text's I / 4 pi takes I for the power of a light that shines
// everywhere. Solid angles are exact, and those of texels at the edge of the cone only what lies in it (N18).
// In: the map, radiance times area of the light's parts; store: hits. Out: rays; texels of the map.

import package::common::basis::PI;
import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS, Ray};
import package::common::rsm::{
    LEAST_COSINE, RSM_FAR, RSM_ROWS, RSM_SPOT, RsmMap, rsm_direction, rsm_origin, rsm_tile,
};
import package::common::surface::{NO_LIGHT, geometry, instances, surface_with, texels};

// Of the instances: SMOOTH, COLORS, TEXTURE.
override FEATURES: u32 = 7u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> map: RsmMap;
@group(0) @binding(1) var<uniform> first: vec4u;    // x: first texel of the piece
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> rsm_texels: array<vec4f>;

const FAR: f32 = 3e38;
// Parts of a texel along an edge that are in the cone or not.
const PARTS: u32 = 4u;

fn place_of(texel: u32) -> vec2f {
    return (vec2f(vec2u(texel % map.resolution, texel / map.resolution)) + 0.5) / f32(map.resolution);
}

// Number of a tile's part of the light: row by row, or of light_samples' blocks of 4 x 4.
fn part_of(tile: vec2u) -> u32 {
    let block = tile / 4u;
    let within = tile % 4u;
    let by_block = 16u * (block.y * (map.tiles / 4u) + block.x) + 4u * within.y + within.x;
    return select(tile.y * map.tiles + tile.x, by_block, map.tiles % 4u == 0u);
}

// Solid angle of what a texel of a spot's frustum sees of the cone.
fn solid_angle_in_cone(texel: u32) -> f32 {
    let corner = vec2f(vec2u(texel % map.resolution, texel / map.resolution));
    let width = 2.0 * map.tan_half / f32(PARTS * map.resolution);
    let at_border = 1.0 / (map.cos_cutoff * map.cos_cutoff) - 1.0;
    var sum = 0.0;
    var inside = 0.0;
    for (var k = 0u; k < PARTS * PARTS; k++) {
        let part = (vec2f(vec2u(k % PARTS, k / PARTS)) + 0.5) / f32(PARTS);
        let p = map.tan_half * (2.0 * (corner + part) / f32(map.resolution) - 1.0);
        let r2 = dot(p, p);
        let counts = select(0.0, 1.0, map.cos_cutoff <= 0.0 || r2 <= at_border);
        inside += counts;
        sum += counts * width * width / ((1.0 + r2) * sqrt(1.0 + r2));
    }
    let t2 = map.tan_half * map.tan_half;
    let frustum = 4.0 * asin(t2 / (1.0 + t2));
    let even = frustum / f32(map.resolution * map.resolution) * inside / f32(PARTS * PARTS);
    return select(sum, even, map.equal != 0u);
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
    let place = place_of(first.x + i);
    let tile = rsm_tile(map, place);
    rays[i] = Ray(rsm_origin(map, tile), 0.0, rsm_direction(map, tile, place), FAR);
}

@compute @workgroup_size(64)
fn store(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let texel = first.x + i;
    let place = place_of(texel);
    let tile = rsm_tile(map, place);
    let direction = rsm_direction(map, tile, place);
    let spot = map.kind == RSM_SPOT;
    let count = f32(map.resolution * map.resolution);
    let tiles = f32(map.tiles * map.tiles);
    let projected = PI / count;
    let solid_angle = select(projected, solid_angle_in_cone(texel), spot);
    let seen_by_tile = select(tiles * projected / max(dot(map.axis, direction), LEAST_COSINE), solid_angle, spot);
    let hit = hits[i];
    let found = hit.instance != MISS;
    let s = surface_with(Hit(hit.t, hit.u, hit.v, select(0u, hit.instance, found), select(0u, hit.triangle, found)),
        direction, FEATURES);
    let surface = found && s.light == NO_LIGHT;
    let distance = select(RSM_FAR, hit.t, surface);
    // Radiance times area of the light's part, or intensity.
    let part = radiance[part_of(tile)].xyz;
    let arrives = part * select(tiles * projected, solid_angle, spot);
    let area = seen_by_tile * hit.t * hit.t / max(-dot(s.normal_geo, direction), LEAST_COSINE);
    let row = RSM_ROWS * (map.map * map.resolution * map.resolution + texel);
    rsm_texels[row] = vec4f(select(vec3f(0.0), s.position, surface), distance);
    rsm_texels[row + 1u] = vec4f(select(vec3f(0.0), s.normal_shade, surface), solid_angle);
    rsm_texels[row + 2u] = vec4f(select(vec3f(0.0), s.albedo * arrives, surface), select(0.0, area, surface));
}
