// Incremental visibility [NPW10 Sec. 3.3.2]: a bit of a light sample on which the 3 x 3 nodes of the level above agree is
// taken from them, the others are asked. Deviations:
//   - On one surface the four nodes around are enough, because what lies behind an edge says little.
//   - Nodes that are turned away from a sample know nothing of it; some must have asked it, more where nodes are far apart.
//   - Below a coarsest node across an edge all is asked: what is smaller than such a node may throw its shadow beside it.
//   - Where samples are in doubt and hardly any is agreed to be hidden, all are asked: a shadow begins there, or it is that
//     of a thin occluder, which moves over the light from node to node, so that nodes agree on lit samples by chance (N20).
//   ask     bits that are known from the level above, and those to ask
//   answer  adds what the trace found
// In: nodes, sample points. Out: asked. In and out: node_bits: `words` words a node of samples that face it,
// and as many of those that it sees.

import package::common::alike::alike;
import package::common::facing_bits::{facing_bits, params, whole};
import package::common::fragment::ROUGH;
import package::common::grid::{Grid, item_index, not_uniform};
import package::common::nodes::{neighbour_node, node_at, node_rows};
import package::common::pyramid::{pyramid, texel_of};
import package::common::ray::Receiver;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read_write> node_bits: array<u32>;
@group(0) @binding(4) var<storage, read_write> asked: array<u32>;

// Samples in doubt for each that is agreed to be hidden, from which on a shadow begins or is thin,
const MOST_IN_DOUBT: u32 = 8u;
// where one of so many is in doubt, or, from this level on, any.
const THIN: u32 = 5u;
const FAR_APART: u32 = 2u;

// What nodes agree on: samples that they see, those that they do not, and which of them one, two or three have asked.
struct Agreed {
    lit: u32,
    dark: u32,
    asked: vec3u,
}

fn with_node(a: Agreed, counts: bool, known: u32, seen: u32) -> Agreed {
    let k = select(0u, known, counts);
    return Agreed(a.lit & (seen | ~k), a.dark & ~(seen & k), a.asked | vec3u(k, a.asked.xy & vec2u(k)));
}

// Three must have asked one; for fragments of level 1 two are enough, for pixels one.
fn enough(a: Agreed) -> vec2u {
    let asked = select(select(a.asked.x, a.asked.y, pyramid.level == 1u), a.asked.z, pyramid.level >= FAR_APART);
    return vec2u(a.lit, a.dark) & vec2u(asked);
}

// Of one word: samples on which the nodes agree that they are seen, and that they are hidden: all of them, or those around.
fn agreed(nodes: array<u32, 9>, around: u32, word: u32) -> vec2u {
    var all = Agreed(0xffffffffu, 0xffffffffu, vec3u(0u));
    var near = all;
    for (var k = 0u; k < 9u; k++) {
        let at = (max(nodes[k], 1u) - 1u) * 2u * params.words + word;
        let known = node_bits[at];
        let seen = node_bits[at + params.words];
        all = with_node(all, nodes[k] != 0u, known, seen);
        near = with_node(near, (around & (1u << k)) != 0u, known, seen);
    }
    return enough(all) | enough(near);
}

// Whether neighbour k of the parent is one of the four nodes whose middles surround that of `texel`.
fn lies_around(texel: vec2u, k: u32) -> bool {
    let side = select(vec2u(0u), vec2u(2u), (texel & vec2u(1u)) == vec2u(1u));
    let place = vec2u(k % 3u, k / 3u);
    return all((place == vec2u(1u)) | (place == side));
}

// Whether what nodes agree on cannot be trusted, by how many samples face, are in doubt, and are agreed to be hidden.
fn is_thin(facing: u32, doubt: u32, hidden: u32) -> bool {
    return (doubt > MOST_IN_DOUBT * hidden) & ((pyramid.level >= FAR_APART) | (THIN * doubt > facing));
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
    let words = not_uniform(params.words, i);
    let receiver = node_receivers[node];
    let row = node_rows[node];
    let level = not_uniform(pyramid.level, i);
    var trusts = (params.reuse != 0u) & (level < pyramid.coarsest);
    if trusts && level + 1u == pyramid.coarsest {
        trusts = (node_rows[row.w].z & ROUGH) == 0u;
    }
    var nodes: array<u32, 9>;
    var around = 0u;
    if trusts {
        let texel = texel_of(pyramid.levels[pyramid.level], row.x - pyramid.levels[pyramid.level].z);
        for (var k = 0u; k < 9u; k++) {
            let other = neighbour_node(pyramid.level + 1u, texel / 2u, k);
            let same = other != 0u && alike(receiver, node_receivers[max(other, 1u) - 1u]);
            nodes[k] = other;
            around |= select(0u, 1u << k, same && lies_around(texel, k));
        }
    }
    var lit: array<u32, 32>;
    var dark: array<u32, 32>;
    var counts = vec3u(0u);
    let light = whole(receiver);
    for (var word = 0u; word < words; word++) {
        let facing = facing_bits(receiver, word, light);
        let known = agreed(nodes, around, word);
        node_bits[node * 2u * params.words + word] = facing;
        lit[word] = facing & known.x;
        dark[word] = facing & known.y;
        counts += countOneBits(vec3u(facing, facing & ~(known.x | known.y), facing & known.y));
    }
    let all = is_thin(counts.x, counts.y, counts.z);
    for (var word = 0u; word < words; word++) {
        let facing = node_bits[node * 2u * params.words + word];
        let ask = facing & select(~(lit[word] | dark[word]), 0xffffffffu, all);
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
    let words = not_uniform(params.words, i);
    for (var word = 0u; word < words; word++) {
        node_bits[(node * 2u + 1u) * params.words + word] |= asked[node * params.words + word];
    }
}
