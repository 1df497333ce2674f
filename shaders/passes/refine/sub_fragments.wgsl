// Sub-fragment visibility tests and gradient-aware refinement [KJ16 Secs. 3.1.2, 3.1.3]: a node asks at the middles of the
// four texels below it, and is split where they do not see the same samples of the light. Between sub-fragments that lie
// beside each other and see very different samples, the split is repeated: both are split with the node.
// Deviations: all four edges are looked at (the text compares a sub-fragment with the previous one, and leaves one open); the
// samples that change count, not the difference of counts, which a moving shadow leaves alone, unless that is asked for; what
// a sub-fragment does not face is compared with nothing, but across the edge of a spot's cone; all four ask the same samples [else nearly every penumbra is refined
// to pixels, whatever its width], and fragments beside each other others.
//   points  the shading points of the sub-fragments
//   test    marks the nodes that one light splits
// In: nodes, texel_state, G-buffer, bits of the sub-fragments. Out: sub_receivers, node_rows.

import package::common::fragment::{LIT, ON_SURFACE};
import package::common::grid::{Grid, item_index, not_uniform};
import package::common::middle_pixel::{g_normal, middle_pixel};
import package::common::nodes::{AGAIN, CHANGES, SPLIT, UNSTABLE, class_of, node_rows};
import package::common::pyramid::{footprint, pyramid, texel_number, texel_of};
import package::common::ray::Receiver;
import package::common::receiver::{INACTIVE, inactive_receiver, receiver_of};

struct SubFragmentsParams {
    first: u32,         // node of the first item
    classes: u32,       // interleaved sets of samples: 1 or 4
    together: u32,      // 1: the four ask one set, 0: each its own
    words: u32,         // of bits a sub-fragment
    least_bits: u32,    // samples on which they differ, from which on a node is split
    most_apart: u32,    // samples between two, up to which they are not split with it
    counts: u32,        // 1: the difference of how many are seen, 0: how many change
    hard: u32,          // 1: what faces nothing lies outside of a cone, and sees nothing
}

// Flag of a sub-fragment that sees a surface, but no light reaches it.
const DARK: u32 = 1u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: SubFragmentsParams;
@group(0) @binding(1) var<storage, read> texel_state: array<u32>;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(4) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(5) var<storage, read_write> sub_receivers: array<Receiver>;
@group(0) @binding(6) var<storage, read> sub_bits: array<u32>;

// Four for each node, column by column and row by row; what was split already has none, nor has what no light reaches.
@compute @workgroup_size(64)
fn points(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let node = params.first + i / 4u;
    let row = node_rows[node];
    let texel = texel_of(pyramid.levels[pyramid.level], row.x - pyramid.levels[pyramid.level].z);
    let below = pyramid.levels[pyramid.level - 1u];
    let part = i & 3u;
    let sub = 2u * texel + vec2u(part & 1u, part >> 1u);
    let inside = all(sub < below.xy) && (row.z & SPLIT) == 0u;
    let state = select(0u, texel_state[texel_number(below, select(vec2u(0u), sub, inside))], inside);
    sub_receivers[i] = inactive_receiver();
    sub_receivers[i].flags = select(0u, DARK, (state & ON_SURFACE) != 0u);
    if (state & LIT) != 0u {
        let pixel = middle_pixel(footprint(pyramid.level - 1u, sub));
        let at = pixel.y * pyramid.levels[0].x + pixel.x;
        let own = select(select(0u, part, params.classes == 4u), class_of(texel, params.classes), params.together != 0u);
        let pattern = node_receivers[node].pattern * params.classes + own;
        sub_receivers[i] = receiver_of(g_position[at], g_normal[at], g_geometric[at], pattern, at);
    }
}

// Of one word: what each of the four faces, and what it sees.
struct Words {
    known: vec4u,
    seen: vec4u,
}

// A word of ones where sub-fragment k of an item is there, be it dark.
fn there(item: u32, k: u32) -> u32 {
    let sub = sub_receivers[4u * item + k];
    return select(0u, 0xffffffffu, sub.pixel != INACTIVE || sub.flags == DARK);
}

fn words_of(item: u32, word: u32) -> Words {
    if not_uniform(params.hard, item) != 0u {
        let first = 8u * item * params.words + params.words + word;
        let at = vec4u(first) + vec4u(0u, 2u, 4u, 6u) * params.words;
        return Words(
            vec4u(there(item, 0u), there(item, 1u), there(item, 2u), there(item, 3u)),
            vec4u(sub_bits[at.x], sub_bits[at.y], sub_bits[at.z], sub_bits[at.w]));
    }
    let at = vec4u(8u * item * params.words + word) + vec4u(0u, 2u, 4u, 6u) * params.words;
    let seen = at + params.words;
    return Words(
        vec4u(sub_bits[at.x], sub_bits[at.y], sub_bits[at.z], sub_bits[at.w]),
        vec4u(sub_bits[seen.x], sub_bits[seen.y], sub_bits[seen.z], sub_bits[seen.w]));
}

// In a cycle: left above, right above, right below, left below; each beside the next.
fn cycle(v: vec4u) -> vec4u {
    return v.xywz;
}

fn any_of(v: vec4u) -> u32 {
    return v.x | v.y | v.z | v.w;
}

@compute @workgroup_size(64)
fn test(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    var differ = 0u;
    var change = vec4u(0u);
    var more = vec4i(0);
    for (var word = 0u; word < not_uniform(params.words, i); word++) {
        let w = words_of(i, word);
        differ += countOneBits(any_of(w.known & w.seen) & any_of(w.known & ~w.seen));
        let known = cycle(w.known);
        let seen = cycle(w.seen);
        let both = known & known.yzwx;
        change += countOneBits(both & (seen ^ seen.yzwx));
        more += vec4i(countOneBits(both & seen)) - vec4i(countOneBits(both & seen.yzwx));
    }
    let apart = select(change, vec4u(abs(more)), params.counts != 0u);
    let steep = apart > vec4u(params.most_apart);
    let moves = change > vec4u(0u);
    // The edge behind each, and the one before it; then back from the cycle.
    let again = (steep | steep.wxyz).xywz;
    let unstable = (moves | moves.wxyz).xywz;
    let bits = vec4u(1u, 2u, 4u, 8u);
    var marks = UNSTABLE * any_of(select(vec4u(0u), bits, unstable));
    if (differ >= params.least_bits) & (pyramid.level > pyramid.finest) {
        marks |= CHANGES | (AGAIN * any_of(select(vec4u(0u), bits, again)));
    }
    node_rows[params.first + i].z |= marks;
}
