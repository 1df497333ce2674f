// Where the extra samples of large fragments lie, three for each texel from level 3 on, thrice:
//   0  the middle of the upper side, the upper left corner, the middle of the left side
//   1  of a texel of the last column, on the image's last column: the upper corner, the middle, the image's last pixel
//   2  of a texel of the last row, on the image's last row: the left corner, the middle, none
// The rows of all texels' first three come first, then those of the second, then of the third.

import package::common::border_samples::LARGE;
import package::common::pyramid::{pyramid, texel_number};

const NO_ROW: u32 = 0xffffffffu;

// Texels from level 3 on.
fn large_texels() -> u32 {
    let last = pyramid.levels[pyramid.coarsest];
    return last.z + last.w - pyramid.levels[LARGE].z;
}

// Whether a texel of a level of this size has samples of a set, but for those that others have.
fn has_set(kind: u32, texel: vec2u, size: vec4u) -> bool {
    let last = texel + 1u == size.xy;
    return kind == 0u || (kind == 1u && last.x) || (kind == 2u && last.y);
}

// Pixel of a sample of a fragment; it may lie outside of the image, or be another sample.
fn extra_pixel(kind: u32, which: u32, first: vec2u, level: u32) -> vec2u {
    let half = (1u << level) / 2u;
    let last = pyramid.levels[0].xy - 1u;
    let along = select(0u, half, which == 1u);
    let own = first + select(vec2u(0u), select(vec2u(0u, half), vec2u(half, 0u), which == 0u), which != 1u);
    let right = vec2u(last.x, select(first.y + along, last.y, which == 2u));
    let lower = vec2u(first.x + along, last.y);
    return select(select(own, right, kind == 1u), select(lower, last + 1u, which == 2u), kind == 2u);
}

// Row of the extra sample at this very pixel of a fragment of this level, or NO_ROW.
fn extra_row(pixel: vec2u, level: u32) -> u32 {
    let texel = pixel >> vec2u(level);
    let within = pixel - (texel << vec2u(level));
    let half = (1u << level) / 2u;
    let at = vec2<bool>(within.x == 0u || within.x == half, within.y == 0u || within.y == half);
    let last = pixel == pyramid.levels[0].xy - 1u;
    // In this order, so that a pixel is one sample alone.
    let own = all(at) && any(within == vec2u(0u));
    let corner = !own && all(last);
    let right = !own && !corner && last.x && at.y;
    let lower = !own && !corner && !right && last.y && at.x;
    var which = select(select(0u, 2u, within.y != 0u), 1u, all(within == vec2u(0u)));
    which = select(which, select(0u, 1u, within.y != 0u), right);
    which = select(which, select(0u, 1u, within.x != 0u), lower);
    which = select(which, 2u, corner);
    let kind = select(select(0u, 1u, right || corner), 2u, lower);
    let row = 3u * (kind * large_texels() + texel_number(pyramid.levels[level], texel) - pyramid.levels[LARGE].z) + which;
    return select(NO_ROW, row, own || corner || right || lower);
}
