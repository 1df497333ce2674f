// Incremental visibility [NPW10 Sec. 3.3.2]: a bit of a light sample on which the 3 x 3 nodes of the level above agree is
// taken from them, the others are asked. Deviations: on one surface the four nodes around are enough, because what lies
// behind an edge says little; below a coarsest node across an edge all is asked, because what is smaller than such nodes may
// throw its shadow between them; nodes that are turned away from a sample know nothing of it, and some must have asked it;
// and as long as nodes are far apart, a sample beside one in doubt, on the light, is asked as well: the shadow of a thin
// occluder moves over the light from node to node (N20).
//   ask     bits that are known from the level above, and those to ask
//   answer  adds what the trace found
// In: nodes, sample points. Out: asked. In and out: node_bits: `words` words a node of samples that face it,
// and as many of those that it sees.

import package::common::alike::alike;
import package::common::fragment::ROUGH;
import package::common::grid::{Grid, item_index};
import package::common::nodes::{neighbour_node, node_at, node_rows};
import package::common::pyramid::{pyramid, texel_of};
import package::common::ray::Receiver;

struct ReuseParams {
    light_normal: vec3f,
    two_sided: u32,
    cone_axis: vec3f,
    cos_cutoff: f32,    // -1 and below: no cone
    first: u32,         // node of the first receiver
    strata: u32,        // samples that a node asks
    words: u32,         // at most 32
    row: u32,           // samples along a row of the light, for neighbours on it
    reuse: u32,         // 0: every sample is asked
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ReuseParams;
@group(0) @binding(1) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> points: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> node_bits: array<u32>;
@group(0) @binding(4) var<storage, read_write> asked: array<u32>;

// Nodes from this level on ask beside what is in doubt.
const FAR_APART: u32 = 2u;

// True when the surface faces the sample and the light emits towards the surface, as in `shadow`.
fn faces(receiver: Receiver, point: vec4f) -> bool {
    let d = point.xyz - receiver.origin;
    let emits = params.two_sided != 0u || dot(params.light_normal, d) < 0.0;
    let cone = params.cos_cutoff <= -1.0 || params.cos_cutoff * length(d) <= -dot(params.cone_axis, d);
    return emits && cone && dot(receiver.normal_geo, d) > 0.0 && dot(receiver.normal_shade, d) > 0.0;
}

fn facing_bits(receiver: Receiver, word: u32) -> u32 {
    var bits = 0u;
    let row = receiver.pattern * params.strata + 32u * word;
    let count = min(params.strata - 32u * word, 32u);
    for (var k = 0u; k < count; k++) {
        if faces(receiver, points[row + k]) {
            bits |= 1u << k;
        }
    }
    return bits;
}

// Of one word: samples on which the nodes agree that they are seen, and that they are hidden. Three must have asked one;
// for pixels two are enough.
fn agreed(nodes: array<u32, 9>, word: u32) -> vec2u {
    var lit = 0xffffffffu;
    var dark = 0xffffffffu;
    var once = 0u;
    var twice = 0u;
    var thrice = 0u;
    for (var k = 0u; k < 9u; k++) {
        if nodes[k] != 0u {
            let at = (nodes[k] - 1u) * 2u * params.words + word;
            let known = node_bits[at];
            let seen = node_bits[at + params.words];
            lit &= seen | ~known;
            dark &= ~(seen & known);
            thrice |= twice & known;
            twice |= once & known;
            once |= known;
        }
    }
    return vec2u(lit, dark) & vec2u(select(twice, thrice, pyramid.level > 0u));
}

// Whether neighbour k of the parent is one of the four nodes whose middles surround that of `texel`.
fn lies_around(texel: vec2u, k: u32) -> bool {
    let side = select(vec2u(0u), vec2u(2u), (texel & vec2u(1u)) == vec2u(1u));
    let place = vec2u(k % 3u, k / 3u);
    return all((place == vec2u(1u)) | (place == side));
}

// Bits of a row of words moved towards higher numbers by `by` (or lower ones), as seen at one word.
fn moved(bits: ptr<function, array<u32, 32>>, word: u32, by: u32) -> u32 {
    let whole = by / 32u;
    let part = by % 32u;
    var up = 0u;
    var down = 0u;
    if word >= whole {
        up = (*bits)[word - whole] << part;
        if part != 0u && word >= whole + 1u {
            up |= (*bits)[word - whole - 1u] >> (32u - part);
        }
    }
    if word + whole < params.words {
        down = (*bits)[word + whole] >> part;
        if part != 0u && word + whole + 1u < params.words {
            down |= (*bits)[word + whole + 1u] << (32u - part);
        }
    }
    return up | down;
}

@compute @workgroup_size(64)
fn ask(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let node = params.first + i;
    let receiver = node_receivers[node];
    let row = node_rows[node];
    var trusts = params.reuse != 0u && pyramid.level < pyramid.coarsest;
    if trusts && pyramid.level + 1u == pyramid.coarsest {
        trusts = (node_rows[row.w].z & ROUGH) == 0u;
    }
    var nodes: array<u32, 9>;
    var around: array<u32, 9>;
    if trusts {
        let texel = texel_of(pyramid.levels[pyramid.level], row.x - pyramid.levels[pyramid.level].z);
        for (var k = 0u; k < 9u; k++) {
            let other = neighbour_node(pyramid.level + 1u, texel / 2u, k);
            let same = other != 0u && alike(receiver, node_receivers[max(other, 1u) - 1u]);
            nodes[k] = other;
            around[k] = select(0u, other, same && lies_around(texel, k));
        }
    }
    var doubt: array<u32, 32>;
    var lit: array<u32, 32>;
    for (var word = 0u; word < params.words; word++) {
        let facing = facing_bits(receiver, word);
        let known = agreed(nodes, word) | agreed(around, word);
        node_bits[node * 2u * params.words + word] = facing;
        lit[word] = facing & known.x;
        doubt[word] = facing & ~(known.x | known.y);
    }
    var wide: array<u32, 32>;
    for (var word = 0u; word < params.words; word++) {
        let beside = moved(&doubt, word, 1u);
        wide[word] = doubt[word] | select(0u, beside, pyramid.level >= FAR_APART);
    }
    for (var word = 0u; word < params.words; word++) {
        let facing = node_bits[node * 2u * params.words + word];
        let beside = moved(&wide, word, params.row);
        let ask = facing & (wide[word] | select(0u, beside, pyramid.level >= FAR_APART));
        asked[node * params.words + word] = ask;
        node_bits[(node * 2u + 1u) * params.words + word] = lit[word] & ~ask;
    }
}

@compute @workgroup_size(64)
fn answer(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let node = params.first + i;
    for (var word = 0u; word < params.words; word++) {
        node_bits[(node * 2u + 1u) * params.words + word] |= asked[node * params.words + word];
    }
}
