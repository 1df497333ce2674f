// Interpolation from level to level among texels that have light of their own level or of a coarser one, so that nothing
// is taken from where the image was refined [NW09 Sec. 3.5], and only from those that lie near the plane of what is lit
// and face nearly its way: never across an edge. Where the level above has no light, the neighbour of the texel's own
// level stands in for it. A texel without such neighbours keeps the light of the fragment it is in.
//   guide   of every texel from level 1 on what its neighbours ask
//   level   level `pyramid.level` from the level above
//   pixels  the image from level 1
// In: fragments and their irradiance, pyramid, G-buffer. Out: irradiance a pixel.

import package::common::alike::{MOST_TURNED, fade};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::illumination::{
    Above, MOST_OFF, above, fragment_at, fragment_irradiance, illumination, own_light,
};
import package::common::pyramid::{level_of, pyramid, texel_number, texel_of};
import package::common::view::View;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> means: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(6) var<storage, read_write> direct_irradiance: array<vec4f>;
// Two rows a texel: xyz mean position, w inverse of the distance to its plane from which on nothing counts;
// xyz unit normal, w 1 where it sees a surface, else 0.
@group(0) @binding(7) var<storage, read_write> guides: array<vec4f>;

fn slot(number: u32) -> u32 {
    return number - pyramid.levels[1].z;
}

fn unit(v: vec3f) -> vec3f {
    return v / max(length(v), 1e-6);
}

// How far the texel in row `at` lies on the surface through p with these normals.
fn alike(at: u32, p: vec3f, normal: vec3f, across: vec3f) -> f32 {
    let middle = guides[2u * at];
    let facing = guides[2u * at + 1u];
    let off = dot(across, middle.xyz - p) * middle.w;
    let turned = (facing.xyz - normal) * (1.0 / MOST_TURNED);
    return facing.w * fade(off * off) * fade(dot(turned, turned));
}

// Number of the texel next to `texel`, of the same level `size`, on the side of `other`, of the level above.
fn beside(size: vec4u, texel: vec2u, other: vec2u) -> u32 {
    return texel_number(size, vec2u(vec2i(texel) + vec2i(other) - vec2i(texel >> vec2u(1u))));
}

// At the centre of `texel` of the level below `level`, where the surface through p has these normals.
fn interpolated(level: u32, texel: vec2u, p: vec3f, normal: vec3f, across: vec3f) -> vec4f {
    let size = pyramid.levels[level];
    var home = vec4f(0.0);
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let at = above(texel, size, k, level == 1u);
        var row = slot(texel_number(size, at.texel));
        var light = illumination[row];
        home = select(home, light, all(at.texel == texel >> vec2u(1u)) && at.weight > 0.0);
        if light.w == 0.0 && level > 1u {
            let number = beside(pyramid.levels[level - 1u], texel, at.texel);
            row = slot(number);
            light = own_light(number);
        }
        sum += light.w * at.weight * alike(row, p, normal, across) * vec4f(light.xyz, 1.0);
    }
    let found = select(home.xyz, sum.xyz / max(sum.w, 1e-30), sum.w > 1e-12);
    return vec4f(select(vec3f(0.0), found, home.w > 0.0), home.w);
}

@compute @workgroup_size(64)
fn guide(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let row = means[3u * i];
    let middle = floats(row);
    let number = pyramid.levels[1].z + i;
    let width = f32(1u << level_of(number)) * pyramid.pixel_width * max(dot(view.eye - middle, view.backward), 1e-30);
    guides[2u * i] = vec4f(middle, 1.0 / (MOST_OFF * width));
    guides[2u * i + 1u] = vec4f(unit(floats(means[3u * i + 1u])), select(0.0, 1.0, row.w != 0u));
}

@compute @workgroup_size(64)
fn level(
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
    var light = own_light(size.z + i);
    let facing = guides[2u * at + 1u];
    if light.w == 0.0 && pyramid.level < pyramid.coarsest && facing.w != 0.0 {
        let across = unit(floats(means[3u * at + 2u]));
        light = interpolated(pyramid.level + 1u, texel_of(size, i), guides[2u * at].xyz, facing.xyz, across);
    }
    illumination[at] = light;
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
    let surface = g_normal[i].w == SURFACE;
    var light = own_light(i);
    if surface && light.w == 0.0 && pyramid.coarsest > 0u {
        let texel = texel_of(pyramid.levels[0], i);
        light = interpolated(1u, texel, floats(g_position[i]), floats(g_normal[i]), floats(g_geometric[i]));
    }
    direct_irradiance[i] = vec4f(select(vec3f(0.0), light.xyz, surface), 0.0);
}
