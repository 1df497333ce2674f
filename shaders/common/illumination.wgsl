// Irradiance of fragments on its way to the pixels: own values, and an image for each level from 1 on whose fourth number
// says whether a texel has any.

import package::common::fragment::CULLED;

@group(0) @binding(10) var<storage, read> fragment_at: array<u32>;
@group(0) @binding(11) var<storage, read> fragment_irradiance: array<vec4f>;
@group(0) @binding(12) var<storage, read_write> illumination: array<vec4f>;

// Irradiance of the fragment that is this texel, and 1; zeros where it is none. What no light reaches has none, and 1.
fn own_light(number: u32) -> vec4f {
    let at = fragment_at[number];
    let fragment = at != 0u && at != CULLED;
    let found = fragment_irradiance[select(0u, at - 1u, fragment)];
    return vec4f(select(vec3f(0.0), found.xyz, fragment), select(1.0, 0.0, at == 0u));
}

// A neighbour's light counts for nothing from this distance to the plane on, over the fragment's width.
const MOST_OFF: f32 = 0.25;

struct Above {
    texel: vec2u,
    weight: f32,    // 0 outside of the image
}

// Texel k of the four of the level above whose centres surround that of `texel`, and its bilinear weight. The pixel in
// the middle of a fragment lies half a pixel beyond the middle, at every level: from level 1 to pixels that is undone.
fn above(texel: vec2u, size: vec4u, k: u32, to_pixels: bool) -> Above {
    let at = ((vec2i(texel) - 1) >> vec2u(1u)) + vec2i(i32(k & 1u), i32(k >> 1u));
    let odd = (texel & vec2u(1u)) == vec2u(1u);
    let later = select(vec2f(0.75), vec2f(0.25), odd) - select(0.0, 0.25, to_pixels);
    let weight = select(1.0 - later.x, later.x, (k & 1u) != 0u) * select(1.0 - later.y, later.y, k >= 2u);
    // A negative column is a large one as well.
    let inside = all(vec2u(at) < size.xy);
    return Above(select(vec2u(0u), vec2u(at), inside), select(0.0, weight, inside));
}
