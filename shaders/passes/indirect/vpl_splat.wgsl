// Splats of virtual lights [NW09 Sec. 3.4]: for each virtual light a point at each receiver, drawn and added up by blending.
// Deviation: the multiresolution buffer is packed to the list of its fragments, so that no texel of the target is empty.
//   vertex    where the point of a receiver lies in the target
//   fragment  irradiance from one virtual light
//   spread    from the target's pixels to the receivers' numbers
// In: receivers, virtual lights. Out: the target; irradiance, w: its mean over the channels.

import package::common::form_factor::{DISC, Lit, disc_irradiance, mean_of};
import package::common::grid::{Grid, item_index};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

struct VplSplatParams {
    width: u32,     // of the target
    height: u32,
    first: u32,     // receiver of the target's first pixel
    reach: f32,     // of a virtual light
}

override FORM: u32 = 0u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: VplSplatParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> virtual_lights: array<vec4f>;
@group(0) @binding(3) var<storage, read> sums: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> irradiance: array<vec4f>;

struct Splat {
    @builtin(position) place: vec4f,
    @location(0) @interpolate(flat, either) receiver: u32,
    @location(1) @interpolate(flat, either) light: u32,
}

@vertex
fn vertex(@builtin(vertex_index) number: u32, @builtin(instance_index) light: u32) -> Splat {
    let at = params.first + number;
    let size = vec2f(f32(params.width), f32(params.height));
    let pixel = vec2f(f32(number % params.width), f32(number / params.width)) + 0.5;
    let apart = virtual_lights[4u * light].xyz - receivers[at].origin;
    let out_of_reach = dot(apart, apart) >= params.reach * params.reach;
    let dropped = (receivers[at].pixel == INACTIVE) | out_of_reach;
    let place = vec2f(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y);
    return Splat(vec4f(select(place, vec2f(2.0), dropped), 0.5, 1.0), at, light);
}

@fragment
fn fragment(splat: Splat) -> @location(0) vec4f {
    let r = receivers[splat.receiver];
    let row = 4u * splat.light;
    let light = disc_irradiance(
        Lit(r.origin, r.normal_shade, r.normal_geo),
        virtual_lights[row], virtual_lights[row + 1u], virtual_lights[row + 2u].xyz, FORM == DISC, params.reach);
    return vec4f(light, mean_of(light));
}

@compute @workgroup_size(64)
fn spread(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end && receivers[params.first + i].pixel != INACTIVE {
        irradiance[receivers[params.first + i].pixel] = sums[i];
    }
}
