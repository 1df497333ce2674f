// A regular grid of virtual lights over each map [NW09 Sec. 3.1]: one for each block of texels, at the texel in its middle,
// or at the one nearest to it that reflects anything. Deviation: its flux is that of the whole block, not that of the one
// texel times their number, so that no energy is lost or made. In: texels, maps. Out: the list.

import package::common::grid::{Grid, item_index};
import package::common::rsm::{RSM_ROWS, RsmMap};
import package::common::virtual_light::VirtualLight;

struct VplGridParams {
    map: u32,
    side: u32,          // virtual lights along an edge of the map
    first: u32,         // place of the map's first in the list
    resolution: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplGridParams;
@group(0) @binding(1) var<storage, read> rsm_texels: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> virtual_lights: array<VirtualLight>;

fn row_of(texel: vec2u) -> u32 {
    let size = params.resolution;
    return RSM_ROWS * (params.map * size * size + texel.y * size + texel.x);
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
    let cell = vec2u(i % params.side, i / params.side);
    let first = cell * params.resolution / params.side;
    let size = max((cell + 1u) * params.resolution / params.side - first, vec2u(1u));
    var light: VirtualLight;
    var nearest = 0x7fffffff;
    for (var k = 0u; k < size.x * size.y; k++) {
        let place = vec2u(k % size.x, k / size.x);
        let row = row_of(first + place);
        let flux = rsm_texels[row + 2u];
        let facing = rsm_texels[row + 1u];
        let apart = 2 * vec2i(place) - vec2i(size);
        let far = apart.x * apart.x + apart.y * apart.y;
        let lights = any(flux.xyz > vec3f(0.0));
        let nearer = lights && far < nearest;
        nearest = select(nearest, far, nearer);
        light.position = select(light.position, rsm_texels[row].xyz, nearer);
        light.normal = select(light.normal, facing.xyz, nearer);
        light.flux += flux.xyz;
        light.area += select(0.0, flux.w, lights);
        light.solid_angle += facing.w;
    }
    var radius = 0.0;
    for (var k = 0u; k < size.x * size.y; k++) {
        let row = row_of(first + vec2u(k % size.x, k / size.x));
        let flux = rsm_texels[row + 2u];
        let lights = any(flux.xyz > vec3f(0.0));
        let apart = rsm_texels[row].xyz - light.position;
        radius = max(radius, select(0.0, length(apart) + sqrt(0.5 * flux.w), lights));
        light.spread = max(light.spread, select(0.0, length(rsm_texels[row + 1u].xyz - light.normal), lights));
        light.thickness = max(light.thickness, select(0.0, abs(dot(light.normal, apart)), lights));
    }
    light.radius = radius;
    light.block = first.x | (first.y << 16u);
    light.extent = select(0u, size.x, size.x == size.y) | (params.map << 16u);
    virtual_lights[params.first + i] = light;
}
