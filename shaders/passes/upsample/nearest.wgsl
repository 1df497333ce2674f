// Every pixel takes its fragment's irradiance: blocks, as [NW09 Fig. 3] shows them. In: fragments and their irradiance.
// Out: irradiance a pixel.

import package::common::fragment::LEVEL_CULLED;
import package::common::grid::{Grid, item_index};
import package::common::illumination::{fragment_at, fragment_irradiance, own_light};
import package::common::pyramid::{pyramid, texel_number, texel_of};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> level_map: array<u32>;
@group(0) @binding(2) var<storage, read_write> direct_irradiance: array<vec4f>;

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
    let level = level_map[i];
    let shaded = level < LEVEL_CULLED;
    let l = select(0u, level, shaded);
    let light = own_light(texel_number(pyramid.levels[l], texel_of(pyramid.levels[0], i) >> vec2u(l)));
    direct_irradiance[i] = vec4f(select(vec3f(0.0), light.xyz, shaded), 0.0);
}
