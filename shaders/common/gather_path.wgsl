// A gather ray's state between passes, and where in a wave it lies: tile by tile, stratum by stratum, so that 64
// consecutive rays leave one tile of pixels into the same part of the hemisphere.

struct GatherPath {
    throughput: vec3f,  // what one unit of radiance at the ray's end adds to the pixel's irradiance
    pixel: u32,
    pending: vec3f,     // irradiance that its shadow ray will let through or not
    stratum: u32,
    slope: vec3f,       // change of the first hit's light, as a share of it, by way of the ray's origin
    pad: u32,
}

struct GatherWave {
    width: u32,
    height: u32,
    first_tile: u32,
    tiles: u32,
    first_stratum: u32,
    strata: u32,        // in this wave
    strata_u: u32,      // of the whole hemisphere
    strata_v: u32,
    lights: u32,
    seed: u32,
    bounce: u32,
    last: u32,          // no ray goes on from these hits
}

const NO_PIXEL: u32 = 0xffffffffu;
