// Fragments of the lobes, apart from those of the diffuse light [NPW10 Sec. 3.2.1]: what geometry said of every texel, and
//   begin  keeps how rough it is
//   mark   which pixels' lobes may meet a light, and which texels are wider than the lobe. A pixel is culled where the
//          mirror direction misses every light and cos^n to all of it is next to nothing; a texel where all its pixels are
//          [Deviation: by pixels, not by one point of a fragment]. Lobe metric: over a texel the mirror direction and that
//          to the light may turn by a share of the lobe's half-width at half maximum; one material only.
// In: texel_state, G-buffer, instance_lobes, lights. Out: lobe_state.

import package::common::fragment::{LIT, ON_SURFACE, OUTSIDE_LOBE, ROUGH, ROUGH_LOBE};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::light::{Light, SPOT, light_at, lights};
import package::common::lobe::{cos_power, instance_lobes, mirrored};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::view::View;

struct LobeLevelsParams {
    lights: u32,
    texels: u32,
    threshold: f32,     // share of the half-width; negative: no lobe metric
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: LobeLevelsParams;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(5) var<storage, read> texel_state: array<u32>;
@group(0) @binding(6) var<storage, read_write> marks: array<atomic<u32>>;   // lobe_state
@group(0) @binding(7) var<storage, read_write> lobe_state: array<u32>;

// Less than this of the lobe's height is next to nothing.
const LEAST: f32 = 1e-3;

@compute @workgroup_size(64)
fn begin(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        lobe_state[i] = texel_state[i] & ROUGH;
    }
}

fn mirror_at(at: u32) -> vec3f {
    return mirrored(normalize(floats(g_position[at]) - view.eye), floats(g_normal[at]));
}

// Largest cosine between the mirror direction and what is seen of a light: at the place where it meets the light's plane,
// moved into the light, and at the corners. 1 where it meets the light.
fn nearest(light: Light, p: vec3f, mirror: vec3f) -> f32 {
    if light.kind == SPOT {
        return dot(mirror, normalize(light.corner - p));
    }
    let c = light.corner - p;
    let slope = dot(light.normal, mirror);
    let far = dot(light.normal, c) / select(1e-20, slope, abs(slope) > 1e-20);
    let across_v = cross(light.edge_v, light.normal);
    let across_u = cross(light.normal, light.edge_u);
    var best = -1.0;
    if far > 0.0 {
        let meets = far * mirror - c;
        let a = clamp(dot(meets, across_v) / dot(light.edge_u, across_v), 0.0, 1.0);
        let b = clamp(dot(meets, across_u) / dot(light.edge_v, across_u), 0.0, 1.0);
        best = dot(mirror, normalize(c + a * light.edge_u + b * light.edge_v));
    }
    for (var k = 0u; k < 4u; k++) {
        let corner = c + f32(k & 1u) * light.edge_u + f32(k >> 1u) * light.edge_v;
        best = max(best, dot(mirror, normalize(corner)));
    }
    return best;
}

// Whether the lobe of a pixel may show any light.
fn meets_a_light(p: vec3f, mirror: vec3f, n: f32) -> bool {
    var met = false;
    for (var k = 0u; k < params.lights && !met; k++) {
        met = cos_power(nearest(light_at(k), p, mirror), n) > LEAST;
    }
    return met;
}

// Largest turn of the direction to a light's middle between two points, over all lights.
fn parallax(p: vec3f, q: vec3f) -> f32 {
    var most = 0.0;
    for (var k = 0u; k < params.lights; k++) {
        let light = light_at(k);
        let middle = light.corner + select(0.5 * (light.edge_u + light.edge_v), vec3f(0.0), light.kind == SPOT);
        most = max(most, length(normalize(middle - p) - normalize(middle - q)));
    }
    return most;
}

// Whether the texel whose middle pixel is `middle` is too wide for the lobe at pixel `at`.
fn too_wide(at: u32, middle: u32, surface: vec4f) -> bool {
    if params.threshold < 0.0 || at == middle || g_normal[middle].w != SURFACE {
        return false;
    }
    let half_width = acos(exp2(-1.0 / max(surface.w, 0.05)));
    let turn = length(mirror_at(at) - mirror_at(middle)) + parallax(floats(g_position[at]), floats(g_position[middle]));
    let other = any(instance_lobes[g_albedo[middle].w] != surface);
    return other || turn > params.threshold * half_width;
}

// A thread for each pixel.
@compute @workgroup_size(64)
fn mark(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || g_normal[i].w != SURFACE {
        return;
    }
    let surface = instance_lobes[g_albedo[i].w];
    let pixel = texel_of(pyramid.levels[0], i);
    var state = texel_state[i] & ON_SURFACE;
    let matt = all(surface.xyz == vec3f(0.0));
    if matt || ((state & LIT) != 0u && !meets_a_light(floats(g_position[i]), mirror_at(i), surface.w)) {
        state = OUTSIDE_LOBE;
    }
    for (var level = 0u; level <= pyramid.coarsest; level++) {
        let texel = pixel >> vec2u(level);
        var bits = state;
        if level > 0u && !matt {
            let first = texel << vec2u(level);
            let last = min(first + (1u << level), pyramid.levels[0].xy) - 1u;
            let middle = (first + last + 1u) / 2u;
            if too_wide(i, middle.y * pyramid.levels[0].x + middle.x, surface) {
                bits |= ROUGH_LOBE;
            }
        }
        atomicOr(&marks[texel_number(pyramid.levels[level], texel)], bits);
    }
}
