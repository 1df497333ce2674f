// Visibility bits of sub-fragments and of pixels: what to ask, and what is known then. A pixel asks all sets of samples; of the
// set that its node above asked right there the answers are taken from it [KJ16 Sec. 3.1.2: bits are used again].
//   ask_all     samples that face each sub-fragment, or any other point: all of them are asked
//   ask_own     where a node is left whole and in doubt, each of its sub-fragments but one asks another set, so that the node
//               is lit by all samples [Deviation: the text has 16 samples and each four times]
//   ask_pixels  samples that face each pixel: those are asked that the node above did not ask
//   take        adds what the trace found
// In: sub_receivers or nodes, sample points. Out: asked. In and out: bits: `words` words of samples that face it,
// and as many of those that it sees.

import package::common::facing_bits::{facing_bits, params, whole};
import package::common::fragment::ROUGH;
import package::common::grid::{Grid, item_index, not_uniform};
import package::common::nodes::{OPEN, SKIPS, SPLIT, class_of, node_rows};
import package::common::pyramid::{pyramid, texel_of};
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read_write> bits: array<u32>;
@group(0) @binding(4) var<storage, read_write> asked: array<u32>;
@group(0) @binding(5) var<storage, read> sub_bits: array<u32>;
@group(0) @binding(6) var<storage, read_write> own_receivers: array<Receiver>;

@compute @workgroup_size(64)
fn ask_all(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    var receiver = receivers[i];
    let asks = receiver.pixel != INACTIVE;
    receiver.pattern = select(0u, receiver.pattern, asks);
    let light = whole(receiver);
    for (var word = 0u; word < not_uniform(params.words, i); word++) {
        let facing = select(0u, facing_bits(receiver, word, light), asks);
        bits[2u * i * params.words + word] = facing;
        bits[(2u * i + 1u) * params.words + word] = 0u;
        asked[i * params.words + word] = facing;
    }
}

// How many samples the four sub-fragments of an item face, and how many they see.
fn faced_and_seen(item: u32) -> vec2u {
    var both = vec2u(0u);
    for (var k = 0u; k < 4u; k++) {
        for (var word = 0u; word < not_uniform(params.words, item); word++) {
            let at = 2u * (4u * item + k) * params.words + word;
            both += countOneBits(vec2u(bits[at], bits[at + params.words]));
        }
    }
    return both;
}

// A thread for each node. What is split asks nothing more, nor what sees all or nothing, unless it is open.
@compute @workgroup_size(64)
fn ask_own(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let row = node_rows[params.first + i];
    let both = faced_and_seen(i);
    let mixed = both.y > 0u && both.y < both.x;
    let doubtful = (row.z & SPLIT) == 0u && (mixed || (row.z & OPEN) != 0u);
    let texel = texel_of(pyramid.levels[pyramid.level], row.x - pyramid.levels[pyramid.level].z);
    for (var k = 0u; k < 4u; k++) {
        let unit = 4u * i + k;
        var receiver = receivers[unit];
        let asks = doubtful && receiver.pixel != INACTIVE && class_of(texel, 4u) != k;
        receiver.pattern = select(receiver.pattern, receiver.pattern / 4u * 4u + k, receiver.pixel != INACTIVE);
        own_receivers[unit] = receiver;
        receiver.pattern = select(0u, receiver.pattern, asks);
        let light = whole(receiver);
        for (var word = 0u; word < not_uniform(params.words, unit); word++) {
            let facing = select(0u, facing_bits(receiver, word, light), asks);
            let at = 2u * unit * params.words + word;
            bits[at] = select(bits[at], facing, asks);
            bits[at + params.words] = select(bits[at + params.words], 0u, asks);
            asked[unit * params.words + word] = facing;
        }
    }
}

// Adds the bits of a set to those of a pixel: `first` is that of the set's first sample.
fn put(pixel: u32, first: u32, word: u32, value: u32) {
    let at = first + 32u * word;
    let to = (2u * pixel + 1u) * params.words + at / 32u;
    let shift = at & 31u;
    bits[to] |= value << shift;
    if (shift != 0u) & (at / 32u + 1u < params.words) {
        bits[to + 1u] |= value >> (32u - shift);
    }
}

// Bits of word `word` that lie from `first` to before `end`.
fn between(first: u32, end: u32, word: u32) -> u32 {
    let lo = clamp(first, 32u * word, 32u * word + 32u) - 32u * word;
    let hi = clamp(end, 32u * word, 32u * word + 32u) - 32u * word;
    let below = select(0xffffffffu, (1u << (hi & 31u)) - 1u, hi < 32u);
    return below & select(0u, ~((1u << (lo & 31u)) - 1u), lo < 32u);
}

@compute @workgroup_size(64)
fn ask_pixels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let row = node_rows[params.first + i];
    let receiver = receivers[params.first + i];
    let root = pyramid.coarsest == 0u;
    let above = select(row.w, params.first + i, root);
    let known = (params.reuse != 0u) & !root & ((node_rows[above].z & (ROUGH | SKIPS)) == 0u);
    let texel = texel_of(pyramid.levels[0], row.x);
    let part = class_of(texel, 4u);
    let own = select(select(0u, part, params.classes == 4u), class_of(texel / 2u, params.classes), params.together != 0u);
    let of_a_set = params.strata / params.classes;
    let first = own * of_a_set;
    let end = select(first, first + of_a_set, known);
    let light = whole(receiver);
    for (var word = 0u; word < not_uniform(params.words, i); word++) {
        let facing = facing_bits(receiver, word, light);
        bits[2u * i * params.words + word] = facing;
        bits[(2u * i + 1u) * params.words + word] = 0u;
        asked[(params.first + i) * params.words + word] = facing & ~between(first, end, word);
    }
    let words = (of_a_set + 31u) / 32u;
    for (var word = 0u; word < select(0u, words, known); word++) {
        let unit = 4u * (above - params.above) + part;
        put(i, first, word, sub_bits[(2u * unit + 1u) * words + word]);
    }
}

@compute @workgroup_size(64)
fn take(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    for (var word = 0u; word < not_uniform(params.words, i); word++) {
        bits[(2u * i + 1u) * params.words + word] |= asked[(params.first + i) * params.words + word];
    }
}
