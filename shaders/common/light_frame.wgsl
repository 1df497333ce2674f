// A light's own affine coordinates, and what a tile of pixels looks like in them. With q = p - corner a point has
// a = q . dual_u, b = q . dual_v, h = q . normal: the light is a in [0, extent_a], b in [0, extent_b], h = 0.

struct LightFrame {
    corner: vec3f,
    extent_a: f32,      // 1 for an area light, 0 for a spot
    dual_u: vec3f,
    extent_b: f32,
    dual_v: vec3f,
    two_sided: u32,
    normal: vec3f,
    cos_cutoff: f32,    // of a spot; -2 for an area light
}

struct TileBounds {
    lo: vec3f,          // a, b, h of the facing pixels' ray origins
    facing: u32,        // how many
    hi: vec3f,
    pad: u32,
}

// Bits of tile_flags.
const FACING: u32 = 1u;         // some pixel faces the light
const ON_SURFACE: u32 = 2u;     // some pixel sees a surface
const BACK: u32 = 4u;           // all facing pixels lie behind a two-sided light; h is negated
const MIXED_SIDES: u32 = 8u;    // facing pixels on both sides of it
const CLIPPED: u32 = 16u;       // some facing pixel's horizon crosses the light
const NEAR: u32 = 32u;          // some facing pixel is nearer than five light sizes
const FAR: u32 = 64u;           // some facing pixel is farther
const PARTLY: u32 = 128u;       // not all of its pixels face the light, but some
const LIT: u32 = 256u;          // proven: nothing lies between a facing pixel and the light
const DARK: u32 = 512u;         // proven: no facing pixel sees any of the light

fn in_light_frame(frame: LightFrame, p: vec3f) -> vec3f {
    let q = p - frame.corner;
    return vec3f(dot(q, frame.dual_u), dot(q, frame.dual_v), dot(q, frame.normal));
}
