// Irradiance of one light at each node, from the samples that it and its neighbours see:
//   E += sum_k v_k L_k A/N cos_s cos_l / d^2   [NPW10 Eq. 2; Deviation: N samples, radiance L, A(y_k) = A/N]
// Interleaved sampling [KH01; NPW10 Sec. 3.3.2]: a node asked one of four sets of samples; v_k of the others is what the
// neighbours found that asked them, so that all sets count alike. Deviation: geometry and radiance of every sample are those of
// the node itself, so that only visibility is shared, and on one surface.
// In: nodes and their bits, sample points and their radiance times area. In and out: node_irradiance.
// Nodes that lie across an edge are lit, too: as guides for their neighbours, never shown.

import package::common::alike::alike;
import package::common::grid::{Grid, item_index};
import package::common::nodes::{node_at, node_rows};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::ray::Receiver;

// Neighbours that see more or less than this of the light lie across the edge of a shadow.
const MOST_APART: f32 = 0.2;
// Interleaved samples in the middle of their strata: where they are follows from the loop, the same for all threads; else
// they are looked up.
override GRID: bool = false;
// One radiance for all samples.
override CONSTANT: bool = false;

struct InterleavedParams {
    first: u32,         // node of item 0
    strata: u32,        // samples that a node asks
    words: u32,         // 0: everything is seen
    classes: u32,       // sets of samples: 1 or 4
    normal: vec3f,      // of the lit side, or a spot's axis
    cos_cutoff: f32,    // of a spot; -2 for an area light
    corner: vec3f,      // of the light; of a spot its position
    two_sided: u32,
    step_u: vec3f,      // from stratum to stratum
    row: u32,           // samples of a set along a row of the light
    step_v: vec3f,
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: InterleavedParams;
@group(0) @binding(2) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> node_bits: array<u32>;
@group(0) @binding(4) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(5) var<storage, read> light_radiance: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> node_irradiance: array<vec4f>;

// Word `word` of what a neighbour knows and sees of the light; zeros where there is none of this level on this surface.
fn word_of(node: u32, word: u32) -> vec2u {
    let at = (max(node, 1u) - 1u) * 2u * params.words + word;
    return select(vec2u(0u), vec2u(node_bits[at], node_bits[at + params.words]), node != 0u);
}

// How much of the samples that face a node it sees.
fn seen_of(node: u32) -> f32 {
    var known = 0u;
    var seen = 0u;
    for (var word = 0u; word < params.words; word++) {
        let words = word_of(node, word);
        known += countOneBits(words.x);
        seen += countOneBits(words.y);
    }
    return f32(seen) / f32(max(known, 1u));
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

// How many of the neighbours whose words these are have bit `bit`: the node itself, those left and right of it, above and
// below, and in the corners, each of which asked another set.
fn counts(words: array<u32, 9>, bit: u32) -> vec4f {
    let beside = ((words[3] >> bit) & 1u) + ((words[5] >> bit) & 1u);
    let above = ((words[1] >> bit) & 1u) + ((words[7] >> bit) & 1u);
    let left = ((words[0] >> bit) & 1u) + ((words[6] >> bit) & 1u);
    let right = ((words[2] >> bit) & 1u) + ((words[8] >> bit) & 1u);
    return vec4f(vec4u((words[4] >> bit) & 1u, beside, above, left + right));
}

// Share of a sample of each set that is seen; of a set that nobody asked, the mean of the others.
fn seen_shares(known: vec4f, seen: vec4f) -> vec4f {
    let mean = dot(seen, vec4f(1.0)) / max(dot(known, vec4f(1.0)), 1.0);
    return select(vec4f(mean), seen / max(known, vec4f(1.0)), known > vec4f(0.0));
}

// Sample j of a set, of all samples number `sample`.
fn point_of(first: u32, sample: u32, j: u32, set_: u32) -> vec3f {
    if !GRID {
        return light_points[first + sample].xyz;
    }
    let cell = 2u * vec2u(j % params.row, j / params.row) + vec2u(set_ & 1u, set_ >> 1u);
    let middle = vec2f(cell) + 0.5;
    return params.corner + middle.x * params.step_u + middle.y * params.step_v;
}

// What a sample at `point` adds when it is seen.
fn term(at: Receiver, point: vec3f) -> f32 {
    let d = point - at.origin;
    let d2 = dot(d, d);
    // The unit vector first: powers of d overflow and underflow sooner than its cosines.
    let w = d * inverseSqrt(d2);
    let cos_geo = dot(at.normal_geo, w);
    let cos_s = dot(at.normal_shade, w);
    var cos_l = -dot(params.normal, w);
    if params.cos_cutoff >= -1.0 {
        cos_l = select(0.0, 1.0, cos_l >= params.cos_cutoff);
    } else if params.two_sided != 0u {
        cos_l = abs(cos_l);
    }
    let counts = cos_geo > 0.0 && cos_s > 0.0 && cos_l > 0.0 && d2 > 0.0;
    return select(0.0, cos_s * cos_l / d2, counts);
}

// Sample j of set `set_`: what it adds, without a radiance that all share.
fn sample_of(at: Receiver, first: u32, j: u32, set_: u32) -> vec3f {
    let sample = set_ * params.strata + j;
    let weight = vec3f(term(at, point_of(first, sample, j, set_)));
    if CONSTANT {
        return weight;
    }
    return weight * light_radiance[sample].xyz;
}

// From the own set and those of the neighbours beside, above and in the corners to sets 0, 1, 2, 3.
fn by_set(shares: vec4f, own: u32) -> vec4f {
    let columns = select(shares, shares.yxwz, (own & 1u) != 0u);
    return select(columns, columns.zwxy, (own & 2u) != 0u);
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
    let share = seen_of(node + 1u);
    var nodes: array<u32, 9>;
    for (var k = 0u; k < 9u; k++) {
        if k == 4u || params.classes > 1u {
            let other = neighbour(texel, receiver, k);
            nodes[k] = select(0u, other, abs(seen_of(other) - share) < MOST_APART);
        }
    }
    let first = receiver.pattern / params.classes * params.classes * params.strata;
    let own = receiver.pattern % params.classes;
    var sum = vec3f(0.0);
    var known: array<u32, 9>;
    var seen: array<u32, 9>;
    for (var j = 0u; j < params.strata; j++) {
        var shares = vec4f(1.0);
        if params.words != 0u {
            if j % 32u == 0u {
                for (var k = 0u; k < 9u; k++) {
                    let words = word_of(nodes[k], j / 32u);
                    known[k] = words.x;
                    seen[k] = words.y;
                }
            }
            shares = by_set(seen_shares(counts(known, j % 32u), counts(seen, j % 32u)), own);
        }
        sum += shares.x * sample_of(receiver, first, j, 0u);
        if params.classes == 4u {
            sum += shares.y * sample_of(receiver, first, j, 1u);
            sum += shares.z * sample_of(receiver, first, j, 2u);
            sum += shares.w * sample_of(receiver, first, j, 3u);
        }
    }
    if CONSTANT {
        sum *= light_radiance[0].xyz;
    }
    node_irradiance[node] += vec4f(sum, 0.0);
}
