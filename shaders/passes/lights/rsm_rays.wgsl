// Rays of the texels of reflective shadow maps, and what the surfaces that they meet reflect [DS05; Deviation: traced
// through the middles of texels, not rasterised].
// In     main, store: maps; store: emitted, hits, the scene
// Out    main: rays, texels from params.first on; store: rsm_texels, whole

import package::common::basis::PI;
import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS, Ray, inactive_ray};
import package::common::rsm::{
    LEAST_COSINE, RSM_FAR, RSM_ROWS, RSM_SPOT, RsmMap, rsm_direction, rsm_origin, rsm_tile,
};
import package::common::surface::{NO_LIGHT, geometry, instances, surface_with, texels};

// Of the instances: SMOOTH, COLORS, TEXTURE.
override FEATURES: u32 = 7u;

struct RsmParams {
    first: u32,     // texel of the list
    stride: u32,    // parts of lights that a map has room for in `emitted`
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: RsmParams;
@group(0) @binding(1) var<storage, read> maps: array<RsmMap>;
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read> emitted: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> rsm_texels: array<vec4f>;

// Along each edge of a texel, so many parts lie in a spot's cone or do not.
const PARTS: u32 = 4u;

// Solid angle of a spot's texel, as far as it lies in the cone (N18).
fn spot_solid_angle(map: RsmMap, texel: vec2u) -> f32 {
    let across = f32(PARTS * map.resolution);
    let width = 2.0 * map.tan_half / across;
    // Of the cone, so that narrow ones lose no digits.
    let c = map.cos_cutoff;
    let tan2 = select((1.0 - c) * (1.0 + c) / (c * c), RSM_FAR, c <= 0.0);
    let equal = map.equal / f32(PARTS * PARTS);
    var sum = 0.0;
    for (var k = 0u; k < PARTS * PARTS; k++) {
        let place = (vec2f(PARTS * texel + vec2u(k % PARTS, k / PARTS)) + 0.5) / across;
        let uv = map.tan_half * (2.0 * place - 1.0);
        let r2 = dot(uv, uv);
        let own = width * width / ((1.0 + r2) * sqrt(1.0 + r2));
        sum += select(0.0, select(own, equal, equal > 0.0), r2 <= tan2);
    }
    return sum;
}

// What texels are summed by: solid angle, or of an area light, whose texels are all alike, projected solid angle over its
// tiles.
fn texel_solid_angle(map: RsmMap, texel: vec2u) -> f32 {
    if map.kind == RSM_SPOT {
        return spot_solid_angle(map, texel);
    }
    return PI / (f32(map.resolution) * f32(map.resolution));
}

// Number of the stratum that a tile is: blocks of 4 x 4 where there are any, see light_samples.wgsl.
fn stratum_of(tile: vec2u, tiles: u32) -> u32 {
    let in_blocks = 16u * (tile.y / 4u * (tiles / 4u) + tile.x / 4u) + 4u * (tile.y % 4u) + tile.x % 4u;
    return select(in_blocks, tile.y * tiles + tile.x, tiles % 4u != 0u);
}

struct Texel {
    map: RsmMap,
    texel: vec2u,
    tile: vec2u,
    direction: vec3f,
}

fn texel_at(number: u32) -> Texel {
    let resolution = maps[0].resolution;
    let within = number % (resolution * resolution);
    let map = maps[number / (resolution * resolution)];
    let texel = vec2u(within % resolution, within / resolution);
    let place = (vec2f(texel) + 0.5) / f32(resolution);
    let tile = rsm_tile(map, place);
    return Texel(map, texel, tile, rsm_direction(map, tile, place));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let t = texel_at(params.first + item);
    rays[item] = inactive_ray();
    // What lies outside of a cone is never lit.
    if texel_solid_angle(t.map, t.texel) > 0.0 {
        rays[item] = Ray(rsm_origin(t.map, t.tile), 0.0, t.direction, RSM_FAR);
    }
}

@compute @workgroup_size(64)
fn store(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item >= grid.end {
        return;
    }
    let number = params.first + item;
    let t = texel_at(number);
    let solid_angle = texel_solid_angle(t.map, t.texel);
    let hit = hits[item];
    var position = vec4f(vec3f(0.0), RSM_FAR);
    var normal = vec3f(0.0);
    var flux = vec4f(0.0);
    if solid_angle > 0.0 && hit.instance != MISS && instances[hit.instance].light == NO_LIGHT {
        let s = surface_with(hit, t.direction, FEATURES);
        position = vec4f(s.position, hit.t);
        normal = s.normal_shade;
        let tiles2 = f32(t.map.tiles * t.map.tiles);
        let source = emitted[t.map.map * params.stride + stratum_of(t.tile, t.map.tiles)].xyz;
        // Each tile is a hemisphere, and its texels share its part of the light alone.
        let seen = select(solid_angle * tiles2 / max(dot(t.direction, t.map.axis), LEAST_COSINE), solid_angle,
            t.map.kind == RSM_SPOT);
        let area = seen * hit.t * hit.t / max(-dot(s.normal_geo, t.direction), LEAST_COSINE);
        flux = vec4f(s.albedo * source * (solid_angle * tiles2), area);
        if dot(s.normal_shade, t.direction) >= 0.0 {
            flux = vec4f(vec3f(0.0), area);
        }
    }
    let row = RSM_ROWS * number;
    rsm_texels[row] = position;
    rsm_texels[row + 1u] = vec4f(normal, solid_angle);
    rsm_texels[row + 2u] = flux;
}
