// Virtual lights near a lit point, as the quadrilaterals of their texels.

import package::common::form_factor::{Lit, disc_irradiance, patch_of, quad_irradiance};
import package::common::rsm::RsmMap;

// Quadrilaterals of a point at most; what is near beyond that is taken for points.
const MOST_NEAR: u32 = 64u;

@group(0) @binding(11) var<storage, read> virtual_lights: array<vec4f>;
@group(0) @binding(13) var<storage, read> maps: array<RsmMap>;

// Irradiance from the virtual light whose record begins at `row`: a disc's where it has no quadrilateral; w: the disc's mean
// over the channels.
fn near_irradiance(at: Lit, row: u32, reach: f32) -> vec4f {
    let shape = bitcast<vec4u>(virtual_lights[row + 3u]);
    let place = virtual_lights[row];
    let facing = virtual_lights[row + 1u];
    let flux = virtual_lights[row + 2u].xyz;
    let polygon = patch_of(at, place.xyz, facing.xyz, maps[shape.w >> 16u], shape.z, shape.w);
    let disc = disc_irradiance(at, place, facing, flux, true, reach);
    let exact = select(disc, quad_irradiance(at, place, facing, flux, polygon), polygon.count > 0u);
    return vec4f(exact, (disc.x + disc.y + disc.z) / 3.0);
}
