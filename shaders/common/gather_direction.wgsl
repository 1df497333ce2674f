// The direction of a gather ray: stratified over the hemisphere by the cosine [WRC88].

import package::common::basis::cosine_direction;
import package::common::gather_path::GatherWave;
import package::common::random::random4;

fn gather_direction(wave: GatherWave, normal: vec3f, at: u32, stratum: u32) -> vec3f {
    let cells = vec2f(f32(wave.strata_u), f32(wave.strata_v));
    let cell = vec2f(f32(stratum % wave.strata_u), f32(stratum / wave.strata_u));
    let jitter = random4(vec4u(at, stratum, 0u, wave.seed)).xy;
    return cosine_direction(normal, (cell + jitter) / cells);
}
