// Rays from each receiver towards virtual lights that are chosen by what they contribute without occlusion: K equal
// parts of the receiver's irradiance, one ray from a place in each, so that bright lights are asked often and none is
// asked for nothing. [NW09 Sec. 6 and NSW09 Sec. 5 leave indirect visibility open; Deviation: they have none]
//   main  a thread for each receiver, and the rays into the part of the irradiance that is at hand
//   wide  LANES threads for each, as `light_cut` has them; each shoots the rays into the part of the irradiance that it has
// In: receivers, the cut or list, irradiance (w: its mean over the channels), parts, texels of the maps. Out: rays; for
// each what it stands for, rgb.

import package::common::form_factor::{DISC, Lit, limited_irradiance, mean_of};
import package::common::grid::{Grid, item_index};
import package::common::light_cut::{
    after, below, first_visit, judged, node_of, params, ranges, reference_irradiance,
};
import package::common::near_lights::{FORM, virtual_lights};
import package::common::random::random4;
import package::common::ray::{Ray, Receiver, inactive_ray};
import package::common::receiver::INACTIVE;
import package::common::rsm::RSM_ROWS;

// Whether there is a tree to descend.
override TREE: bool = true;
override LANES: u32 = 1u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> irradiance: array<vec4f>;
@group(0) @binding(3) var<storage, read> rsm_texels: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(5) var<storage, read_write> ray_weights: array<vec4f>;
@group(0) @binding(6) var<storage, read> parts: array<f32>;

var<workgroup> estimates: array<f32, 64>;

// A ray ends just short of its target, whose own rounding moves its surface (N5).
const RAY_END: f32 = 0.9995;
const EVERYTHING: f32 = 3.0e38;

// A texel of the light's block that reflects something, and faces the receiver; the light's own place where the block has
// none at two tries.
fn target_in(row: u32, receiver: vec3f, random: vec4f) -> vec3f {
    let shape = bitcast<vec4u>(virtual_lights[row + 3u]);
    let first = vec2u(shape.z & 0xffffu, shape.z >> 16u);
    let width = shape.w & 0xffffu;
    let base = (shape.w >> 16u) * params.maps_size * params.maps_size;
    var place = virtual_lights[row].xyz;
    for (var k = 0u; k < 2u; k++) {
        let chosen = select(random.zw, random.xy, k == 1u);
        let texel = first + min(vec2u(chosen * f32(width)), vec2u(max(width, 1u) - 1u));
        let at = RSM_ROWS * select(0u, base + texel.y * params.maps_size + texel.x, width != 0u);
        let faces = dot(rsm_texels[at + 1u].xyz, receiver - rsm_texels[at].xyz) > 0.0;
        let lights = (width != 0u) & faces & any(rsm_texels[at + 2u].xyz > vec3f(0.0));
        place = select(place, rsm_texels[at].xyz, lights);
    }
    return place;
}

// Where the k-th part of the irradiance is asked, in parts.
fn place_in_part(pixel: u32, k: u32) -> f32 {
    return f32(k) + random4(vec4u(pixel, k, 7u, params.seed)).x;
}

// The rays into irradiance from `low` to `high`, which every LANES-th node of the coarsest level has, from `root` on.
fn shoot(i: u32, r: Receiver, at: Lit, scale: f32, root: u32, low: f32, high: f32) {
    let first = i * params.rays;
    let step = irradiance[r.pixel].w / f32(params.rays);
    var k = 0u;
    while k < params.rays && step * place_in_part(r.pixel, k) < low {
        k++;
    }
    var next = step * place_in_part(r.pixel, k);
    var sum = low;
    var visit = first_visit(root);
    while !visit.end && k < params.rays && next < high && step > 0.0 {
        var most = EVERYTHING;
        if TREE {
            let known = judged(at, visit, scale);
            if known.split {
                visit = below(visit);
                continue;
            }
            most = known.most;
        }
        let row = 4u * node_of(visit);
        let light = limited_irradiance(
            at, virtual_lights[row], virtual_lights[row + 1u], virtual_lights[row + 2u].xyz, FORM == DISC, params.reach,
            most);
        sum += mean_of(light);
        while k < params.rays && next < min(sum, high) {
            let place = target_in(row, r.origin, random4(vec4u(r.pixel, k, 8u, params.seed)));
            rays[first + k] = Ray(r.origin, 0.0, place - r.origin, RAY_END);
            ray_weights[first + k] = vec4f(light / max(mean_of(light), 1e-37), 0.0);
            k++;
            next = step * place_in_part(r.pixel, k);
        }
        visit = after(visit, LANES);
    }
    // What rounding left over.
    while k < params.rays && (next < high || step <= 0.0) {
        rays[first + k] = inactive_ray();
        ray_weights[first + k] = vec4f(0.0);
        k++;
        next = step * place_in_part(r.pixel, k);
    }
}

// From where to where a part of the irradiance goes; the last takes what rounding adds.
fn part_of(i: u32, part: u32, count: u32) -> vec2f {
    if count == 1u {
        return vec2f(0.0, EVERYTHING);
    }
    var low = 0.0;
    for (var k = 0u; k < part; k++) {
        low += parts[i * count + k];
    }
    return vec2f(low, select(low + parts[i * count + part], EVERYTHING, part + 1u == count));
}

fn shoot_none(i: u32) {
    for (var k = 0u; k < params.rays; k++) {
        rays[i * params.rays + k] = inactive_ray();
        ray_weights[i * params.rays + k] = vec4f(0.0);
    }
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
    let r = receivers[i];
    if r.pixel == INACTIVE {
        if params.part == 0u {
            shoot_none(i);
        }
        return;
    }
    let at = Lit(r.origin, r.normal_shade, r.normal_geo);
    var scale = 0.0;
    if TREE {
        scale = reference_irradiance(at, 0u, 1u);
    }
    let part = part_of(i, params.part, params.parts);
    shoot(i, r, at, scale, params.first_root, part.x, part.y);
}

@compute @workgroup_size(64)
fn wide(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, 64u, lane);
    let i = min(item, grid.end - 1u) / LANES;
    let r = receivers[i];
    let at = Lit(r.origin, r.normal_shade, r.normal_geo);
    let part = lane % LANES;
    let works = item < grid.end && r.pixel != INACTIVE;
    if works {
        estimates[lane] = reference_irradiance(at, part, LANES);
    }
    workgroupBarrier();
    if works {
        var scale = 0.0;
        for (var k = 0u; k < LANES; k++) {
            scale += estimates[lane - part + k];
        }
        let own = part_of(i, part, LANES);
        shoot(i, r, at, scale, part, own.x, own.y);
    } else if item < grid.end && part == 0u {
        shoot_none(i);
    }
}
