// Nodes of incremental refinement: texels that were looked at, level by level, whether they became fragments or were
// split. A row a node: flat number of its texel, its shading pixel, what is known of it, the node that was split for it.

import package::common::pyramid::{pyramid, texel_number};

@group(0) @binding(20) var<storage, read_write> node_rows: array<vec4u>;
@group(0) @binding(21) var<storage, read_write> node_at: array<u32>;    // a texel: 1 + its node, or 0

// Bits of a node beside those of its texel, see `fragment`.
const DIFFERS: u32 = 32u;       // its irradiance differs from a neighbour's
const CHANGES: u32 = 64u;       // visibility changes around it
const SKIPS: u32 = 512u;        // it was split together with the node above
const SPLIT: u32 = 632u;        // any of these, or a rough texel
// From this bit on one for each sub-fragment that is split as well, and for each that does not see the same as those beside it.
const AGAIN: u32 = 1024u;
const UNSTABLE: u32 = 16384u;
const OPEN: u32 = 262144u;      // nothing is proven of it for some light

// The node of a texel or of the finest texel above it that has one; 1 + its number, 0 for none.
fn node_above(level: u32, texel: vec2u) -> u32 {
    var found = 0u;
    for (var l = level; l <= pyramid.coarsest && found == 0u; l++) {
        found = node_at[texel_number(pyramid.levels[l], texel >> vec2u(l - level))];
    }
    return found;
}

// The same for the neighbour k of 9 of a texel, the texel itself being number 4; 0 outside of the image.
fn neighbour_node(level: u32, texel: vec2u, k: u32) -> u32 {
    let at = vec2i(texel) + vec2i(i32(k % 3u), i32(k / 3u)) - 1;
    // A negative column is a large one as well.
    let inside = all(vec2u(at) < pyramid.levels[level].xy);
    if !inside {
        return 0u;
    }
    return node_above(level, vec2u(at));
}

// Which of the interleaved sets of samples a texel asks: 2 x 2 texels ask all four [NPW10 Sec. 3.3.2].
fn class_of(texel: vec2u, classes: u32) -> u32 {
    return select(0u, (texel.x & 1u) | ((texel.y & 1u) << 1u), classes == 4u);
}
