// Irradiance of one light at each node, from the samples that it and its neighbours see:
//   E += sum_k v_k L_k A/N cos_s cos_l / d^2   [NPW10 Eq. 2; Deviation: N samples, radiance L, A(y_k) = A/N]
// Interleaved sampling [KH01; NPW10 Sec. 3.3.2]: a node asked one of four sets of samples; v_k of the others is what the
// neighbours found that asked them, so that all sets count alike. Deviations: geometry and radiance of every sample are those
// of the node itself, so that only visibility is shared, and on one surface; and above pixels a node that sees all or nothing
// of its own set shares nothing, because its neighbours would light an umbra.
// In: nodes and their bits, sample points and their radiance times area. In and out: node_irradiance.
// Nodes that lie across an edge are lit, too: as guides for their neighbours, never shown.

import package::common::alike::alike;
import package::common::grid::{Grid, item_index};
import package::common::light_terms::{CONSTANT, GRID, after, light_from, light_radiance, params, samples_of};
import package::common::nodes::{node_at, node_rows};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::ray::Receiver;
import package::common::seen_shares::{Counts, by_set, counted, counts_at, seen_shares};

// Neighbours that see more or less than this of the light lie across the edge of a shadow.
const MOST_APART: f32 = 0.2;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> node_bits: array<u32>;
@group(0) @binding(6) var<storage, read_write> node_irradiance: array<vec4f>;

// Word `word` of what a neighbour knows of the light, or, `seen`, sees of it; zero where there is none of this level on this
// surface.
fn word_of(node: u32, word: u32, seen: bool) -> u32 {
    let at = ((max(node, 1u) - 1u) * 2u + select(0u, 1u, seen)) * params.words + word;
    return select(0u, node_bits[at], node != 0u);
}

// How many samples face a node, and how many of them it sees.
fn faced_and_seen(node: u32) -> vec2f {
    var both = vec2u(0u);
    for (var word = 0u; word < params.words; word++) {
        both += countOneBits(vec2u(word_of(node, word, false), word_of(node, word, true)));
    }
    return vec2f(both);
}

fn seen_of(both: vec2f) -> f32 {
    return both.y / max(both.x, 1.0);
}

fn neighbour(texel: vec2u, receiver: Receiver, k: u32) -> u32 {
    let at = vec2i(texel) + vec2i(i32(k % 3u), i32(k / 3u)) - 1;
    let size = pyramid.levels[pyramid.level];
    if !all(vec2u(at) < size.xy) {
        return 0u;
    }
    let node = node_at[texel_number(size, vec2u(at))];
    let counts = node != 0u && alike(receiver, node_receivers[max(node, 1u) - 1u]);
    return select(0u, node, counts);
}

fn counts_of(nodes: array<u32, 9>, word: u32, seen: bool) -> Counts {
    var words: array<u32, 9>;
    for (var k = 0u; k < 9u; k++) {
        words[k] = word_of(nodes[k], word, seen);
    }
    return counted(words);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let node = params.first + i;
    let row = node_rows[node];
    let receiver = node_receivers[node];
    let size = pyramid.levels[pyramid.level];
    let texel = texel_of(size, row.x - size.z);
    let mine = faced_and_seen(node + 1u);
    var all = vec2f(f32(params.strata), mine.y);
    let doubtful = pyramid.level == 0u || (mine.y > 0.0 && mine.y < mine.x);
    var nodes: array<u32, 9>;
    for (var k = 0u; k < 9u; k++) {
        if k != 4u && params.classes > 1u {
            let other = neighbour(texel, receiver, k);
            let both = faced_and_seen(other);
            let counts = doubtful && other != 0u && abs(seen_of(both) - seen_of(mine)) < MOST_APART;
            nodes[k] = select(0u, other, counts);
            all += select(vec2f(0.0), vec2f(f32(params.strata), both.y), counts);
        }
    }
    nodes[4] = node + 1u;
    let light = light_from(receiver);
    let first = receiver.pattern / params.classes * params.classes * params.strata;
    let own = receiver.pattern % params.classes;
    // Where all is seen no bit is looked at, and where nothing is, nothing at all: either loop is run by few.
    let lit = params.words == 0u || all.x == all.y;
    let samples = select(params.strata, 0u, params.words != 0u && all.y == 0.0);
    var sum = vec3f(0.0);
    var place = vec2f(0.0);
    for (var j = 0u; j < select(0u, samples, lit); j++) {
        sum += samples_of(receiver, light, first, j, place, vec4f(1.0));
        place = after(place);
    }
    // A loop in a loop, because what stands in a branch is run by all where any thread takes it.
    for (var word = 0u; 32u * word < select(samples, 0u, lit); word++) {
        let known = counts_of(nodes, word, false);
        let seen = counts_of(nodes, word, true);
        for (var bit = 0u; bit < min(params.strata - 32u * word, 32u); bit++) {
            let shares = by_set(seen_shares(counts_at(known, bit), counts_at(seen, bit)), own);
            sum += samples_of(receiver, light, first, 32u * word + bit, place, shares);
            place = after(place);
        }
    }
    if CONSTANT {
        sum *= light_radiance[0].xyz;
    }
    if GRID {
        sum *= light.scale * light.scale;
    }
    node_irradiance[node] += vec4f(sum, 0.0);
}
