// From the G-buffer's rows of a pixel to a shading point.

import package::common::gbuffer::floats;
import package::common::random::pcg4d;
import package::common::ray::Receiver;
import package::common::surface::offset_origin;

const INACTIVE: u32 = 0xffffffffu;

fn inactive_receiver() -> Receiver {
    return Receiver(vec3f(0.0), INACTIVE, vec3f(0.0), 0u, vec3f(0.0), INACTIVE);
}

// Which set of sample points a pixel uses.
fn pattern_of(pixel: vec2u, seed: u32, patterns: u32) -> u32 {
    return pcg4d(vec4u(pixel, seed, 1u)).x % patterns;
}

fn receiver_of(position: vec4u, normal: vec4u, geometric: vec4u, pattern: u32, at: u32) -> Receiver {
    let normal_geo = floats(geometric);
    let origin = offset_origin(floats(position), normal_geo, bitcast<f32>(position.w));
    return Receiver(origin, pattern, normal_geo, 0u, floats(normal), at);
}
