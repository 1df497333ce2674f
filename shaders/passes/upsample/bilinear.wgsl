// Plain bilinear interpolation from level to level, whatever surface the four texels lie on: light leaks across edges in
// halos [NW09 Fig. 3]. Deviation: a refined texel is the mean of its children, so that every texel has a value and a
// constant stays one.
//   pull    level `pyramid.level` from the level below it
//   push    the texels that coarser fragments cover, from the level above
//   pixels  the image from level 1
// In: fragments and their irradiance. Out: irradiance a pixel.

import package::common::fragment::LEVEL_CULLED;
import package::common::grid::{Grid, item_index};
import package::common::illumination::{Above, above, fragment_at, fragment_irradiance, illumination, own_light};
import package::common::pyramid::{pyramid, texel_number, texel_of};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> level_map: array<u32>;
@group(0) @binding(2) var<storage, read_write> direct_irradiance: array<vec4f>;

fn slot(number: u32) -> u32 {
    return number - pyramid.levels[1].z;
}

// Between the texels of `level` that have a value, at the centre of a texel of the level below.
fn interpolated(level: u32, texel: vec2u) -> vec4f {
    let size = pyramid.levels[level];
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let at = above(texel, size, k, level == 1u);
        let light = illumination[slot(texel_number(size, at.texel))];
        sum += light.w * at.weight * vec4f(light.xyz, 1.0);
    }
    return vec4f(sum.xyz / max(sum.w, 1e-30), select(0.0, 1.0, sum.w > 0.0));
}

@compute @workgroup_size(64)
fn pull(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let size = pyramid.levels[pyramid.level];
    let below = pyramid.levels[pyramid.level - 1u];
    let texel = texel_of(size, i);
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let child = 2u * texel + vec2u(k & 1u, k >> 1u);
        let inside = all(child < below.xy);
        let number = select(below.z, texel_number(below, child), inside);
        var light = own_light(number);
        if pyramid.level > 1u {
            light = illumination[slot(number)];
        }
        sum += select(0.0, light.w, inside) * vec4f(light.xyz, 1.0);
    }
    let mean = vec4f(sum.xyz / max(sum.w, 1.0), select(0.0, 1.0, sum.w > 0.0));
    let number = size.z + i;
    let own = own_light(number);
    illumination[slot(number)] = select(mean, own, own.w > 0.0);
}

@compute @workgroup_size(64)
fn push(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let size = pyramid.levels[pyramid.level];
    let at = slot(size.z + i);
    if illumination[at].w == 0.0 {
        illumination[at] = interpolated(pyramid.level + 1u, texel_of(size, i));
    }
}

@compute @workgroup_size(64)
fn pixels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    var light = own_light(i);
    if light.w == 0.0 && pyramid.coarsest > 0u {
        light = interpolated(1u, texel_of(pyramid.levels[0], i));
    }
    direct_irradiance[i] = vec4f(select(vec3f(0.0), light.xyz, level_map[i] < LEVEL_CULLED), 0.0);
}
