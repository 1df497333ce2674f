// The sum over virtual lights at a lit point. What is near is kept for the end, and counts as the quadrilateral of its
// texels: a device without branches would else find a quadrilateral for every virtual light.

import package::common::form_factor::{
    DISC, Lit, QUAD, disc_irradiance, is_near, limited_irradiance, mean_of, patch_of, quad_irradiance,
};
import package::common::rsm::RsmMap;

override FORM: u32 = 0u;
// Quadrilaterals of a point at most; what is near beyond that is taken for points.
const MOST_NEAR: u32 = 64u;

@group(0) @binding(11) var<storage, read> virtual_lights: array<vec4f>;
@group(0) @binding(13) var<storage, read> maps: array<RsmMap>;

struct Gathered {
    light: vec3f,
    nears: u32,
    near: array<u32, MOST_NEAR>,
}

// Adds the virtual light with this number, a unit of whose flux gives `most` at most.
fn gather_light(sum: ptr<function, Gathered>, at: Lit, number: u32, reach: f32, most: f32) {
    let place = virtual_lights[4u * number];
    let facing = virtual_lights[4u * number + 1u];
    let flux = virtual_lights[4u * number + 2u].xyz;
    var light = limited_irradiance(at, place, facing, flux, FORM == DISC, reach, most);
    if FORM == QUAD {
        if is_near(at, place, facing) && (*sum).nears < MOST_NEAR && any(flux > vec3f(0.0)) {
            (*sum).near[(*sum).nears] = number;
            (*sum).nears++;
            light = vec3f(0.0);
        }
    }
    (*sum).light += light;
}

// Irradiance of all that were added; w: its mean over the channels with discs for quadrilaterals.
fn gathered_irradiance(sum: ptr<function, Gathered>, at: Lit, reach: f32) -> vec4f {
    var light = vec4f((*sum).light, mean_of((*sum).light));
    for (var k = 0u; k < (*sum).nears; k++) {
        light += near_irradiance(at, 4u * (*sum).near[k], reach);
    }
    return light;
}

// From the virtual light whose record begins at `row`: a disc's where it has no quadrilateral; w: the disc's mean.
fn near_irradiance(at: Lit, row: u32, reach: f32) -> vec4f {
    let shape = bitcast<vec4u>(virtual_lights[row + 3u]);
    let place = virtual_lights[row];
    let facing = virtual_lights[row + 1u];
    let flux = virtual_lights[row + 2u].xyz;
    let polygon = patch_of(at, place.xyz, facing, maps[shape.w >> 16u], shape.z, shape.w);
    let disc = disc_irradiance(at, place, facing, flux, true, reach);
    let exact = select(disc, quad_irradiance(at, place, facing, flux, polygon), polygon.count > 0u);
    return vec4f(exact, mean_of(disc));
}
