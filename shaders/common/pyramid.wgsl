// The levels of an image: level l has ceil(width / 2^l) x ceil(height / 2^l) texels, each of up to 2^l x 2^l pixels.
// One flat numbering for all of them: the pixels first, row by row, then level 1, ...

struct Pyramid {
    levels: array<vec4u, 17>,   // columns, rows, flat number of the first texel, texels
    coarsest: u32,
    finest: u32,
    level: u32,                 // that this dispatch works on
    pixel_width: f32,           // scene units a pixel covers at depth 1
}

// Bound here, because functions that took it as an argument would copy it.
@group(0) @binding(24) var<uniform> pyramid: Pyramid;

// Flat number of a texel of the level with these columns and rows.
fn texel_number(size: vec4u, texel: vec2u) -> u32 {
    return size.z + texel.y * size.x + texel.x;
}

// Column and row; divided as floats, which is faster where integers are divided one by one, and put right.
fn texel_of(size: vec4u, index: u32) -> vec2u {
    let guess = u32(f32(index) / f32(size.x));
    let off = i32(index - guess * size.x);
    let row = guess - select(0u, 1u, off < 0) + select(0u, 1u, off >= i32(size.x));
    return vec2u(index - row * size.x, row);
}

// Level of a flat number, at most `coarsest`.
fn level_of(number: u32) -> u32 {
    var level = 0u;
    for (var l = 1u; l <= pyramid.coarsest; l++) {
        level = select(level, l, number >= pyramid.levels[l].z);
    }
    return level;
}

// Pixels of a texel, as far as they lie in the image: first column and row, columns and rows.
fn footprint(level: u32, texel: vec2u) -> vec4u {
    let first = texel << vec2u(level);
    return vec4u(first, min(vec2u(1u << level), pyramid.levels[0].xy - first));
}

// The pixel in the middle of these.
fn middle_of(level: u32, texel: vec2u) -> vec2u {
    let pixels = footprint(level, texel);
    return pixels.xy + pixels.zw / 2u;
}
