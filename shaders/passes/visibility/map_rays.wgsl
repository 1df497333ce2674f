// Map rays: one ray for each texel of the shadow maps of a light's samples, and what came back of them
// [NPW10 Sec. 4, the maps that it is compared with; Deviation: traced through the middles of texels, not rasterised].
// In     points: those of the first pattern; main: none else; store: hits
// Out    main: rays, texels from params.first on; store: distances, whole

import package::common::grid::{Grid, item_index};
import package::common::ray::{Hit, MISS, Ray};
import package::common::shadow_map::{FAR, MapParams, map_direction};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: MapParams;
@group(0) @binding(1) var<storage, read> points: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read_write> distances: array<f32>;

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
    let resolution = params.resolution;
    let texel = params.first + item;
    let place = texel % (resolution * resolution);
    let map = texel / (resolution * resolution);
    let n = select(params.normal, -params.normal, map % params.sides != 0u);
    let d = map_direction(params, n, vec2u(place % resolution, place / resolution));
    rays[item] = Ray(points[map / params.sides].xyz + n * params.offset, 0.0, d, FAR);
}

@compute @workgroup_size(64)
fn store(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    if item < grid.end {
        distances[params.first + item] = select(hits[item].t, FAR, hits[item].instance == MISS);
    }
}
