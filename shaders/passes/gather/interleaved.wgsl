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
import package::common::nodes::{node_at, node_rows};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::ray::Receiver;
import package::common::seen_shares::{Counts, by_set, counted, counts_at, seen_shares};

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

// A light as a node sees it: vectors from the node to its first sample and from sample to sample, and their products with
// both normals, (geometric, shading). Lengths are shares of what lies between node and light, so that none of their powers
// overflows.
struct Seen {
    first: vec3f,
    along_u: vec3f,
    along_v: vec3f,
    cos_first: vec2f,
    cos_u: vec2f,
    cos_v: vec2f,
    height: f32,        // of the node over the light's plane, on a side that emits
    scale: f32,
}

fn products(at: Receiver, v: vec3f) -> vec2f {
    return vec2f(dot(at.normal_geo, v), dot(at.normal_shade, v));
}

fn light_from(at: Receiver) -> Seen {
    let far = params.corner - at.origin;
    let scale = 1.0 / (length(far) + f32(params.row) * length(params.step_u) + length(params.step_v));
    let u = params.step_u * scale;
    let v = params.step_v * scale;
    let first = far * scale + 0.5 * (u + v);
    let height = -dot(params.normal, first);
    let emitting = select(height, abs(height), params.two_sided != 0u);
    return Seen(first, u, v, products(at, first), products(at, u), products(at, v), emitting, scale);
}

// The same as `term` for the sample in a column and a row of the light, over the square of the scale.
fn grid_term(s: Seen, cell: vec2f) -> f32 {
    let d = s.first + cell.x * s.along_u + cell.y * s.along_v;
    let cosines = s.cos_first + cell.x * s.cos_u + cell.y * s.cos_v;
    let d2 = dot(d, d);
    let near = 1.0 / d2;
    let counts = cosines.x > 0.0 && cosines.y > 0.0 && s.height > 0.0 && d2 > 0.0;
    return select(0.0, (cosines.y * near) * (s.height * near), counts);
}

// Sample of set `set_` in a column and row of that set: what it adds, without a radiance that all share.
fn sample_of(at: Receiver, s: Seen, first: u32, j: u32, place: vec2f, set_: u32) -> vec3f {
    let sample = set_ * params.strata + j;
    var weight = 0.0;
    if GRID {
        weight = grid_term(s, place + vec2f(vec2u(set_ & 1u, set_ >> 1u)));
    } else {
        weight = term(at, light_points[first + sample].xyz);
    }
    if CONSTANT {
        return vec3f(weight);
    }
    return weight * light_radiance[sample].xyz;
}

// Column and row of the next sample of a set.
fn after(place: vec2f) -> vec2f {
    return select(vec2f(place.x + 2.0, place.y), vec2f(0.0, place.y + 2.0), place.x + 2.0 == 2.0 * f32(params.row));
}

// All sets at one place, each by its share.
fn samples_of(at: Receiver, s: Seen, first: u32, j: u32, place: vec2f, shares: vec4f) -> vec3f {
    var sum = shares.x * sample_of(at, s, first, j, place, 0u);
    if params.classes == 4u {
        sum += shares.y * sample_of(at, s, first, j, place, 1u);
        sum += shares.z * sample_of(at, s, first, j, place, 2u);
        sum += shares.w * sample_of(at, s, first, j, place, 3u);
    }
    return sum;
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
