// Which samples of one light are asked about, and which of them face a receiver; imported by whatever answers.

import package::common::ray::Receiver;

struct ShadowParams {
    light_normal: vec3<f32>,
    two_sided: u32,
    cone_axis: vec3<f32>,
    cos_cutoff: f32, // -1 and below: no cone
    receivers: u32,
    strata: u32,
    patterns: u32,
    words: u32,
}

// True when the surface faces the sample and the light emits towards the surface; `d` leads to the sample.
fn faces(params: ShadowParams, receiver: Receiver, d: vec3<f32>) -> bool {
    let emits = (params.two_sided != 0u) | (dot(params.light_normal, d) < 0.0);
    let cone = (params.cos_cutoff <= -1.0) | (params.cos_cutoff * length(d) <= -dot(params.cone_axis, d));
    return emits & cone & (dot(receiver.normal_geo, d) > 0.0) & (dot(receiver.normal_shade, d) > 0.0);
}
