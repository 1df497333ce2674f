// Irradiance of one light at each node from what its sub-fragments see, or at each pixel from what it sees:
//   E += sum_k v_k L_k A/N cos_s cos_l / d^2   [NPW10 Eq. 2; KJ16 Sec. 3.1.2: the bits of the test are used again]
// Geometry and radiance of all samples are those of the node's own point. v_k is what the sub-fragment sees that asked sample k,
// or, where all four asked it, the share that sees it; of a sample that does not face who asked it, the share of its stratum.
//   subs    from sub-fragments; what is split is left out
//   pixels  from pixels
// In: nodes, bits, sample points and their radiance times area. In and out: node_irradiance.

import package::common::grid::{Grid, item_index, not_uniform};
import package::common::light_terms::{
    CONSTANT, GRID, after, light_from, light_radiance, params, sample_of, samples_of,
};
import package::common::nodes::{SPLIT, node_rows};
import package::common::ray::Receiver;
import package::common::seen_shares::seen_shares;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> bits: array<u32>;
@group(0) @binding(6) var<storage, read_write> node_irradiance: array<vec4f>;

fn add(node: u32, sum: vec3f, scale: f32) {
    var all = sum;
    if CONSTANT {
        all *= light_radiance[0].xyz;
    }
    if GRID {
        all *= scale * scale;
    }
    node_irradiance[node] += vec4f(all, 0.0);
}

// Word `word` of what sub-fragment k of an item faces, or sees.
fn word_of(item: u32, k: u32, word: u32, seen: u32) -> u32 {
    return bits[((4u * item + k) * 2u + seen) * params.words + word];
}

// How many samples the four face, and how many they see.
fn faced_and_seen(item: u32) -> vec2u {
    var both = vec2u(0u);
    for (var k = 0u; k < 4u; k++) {
        for (var word = 0u; word < not_uniform(params.words, item); word++) {
            both += countOneBits(vec2u(word_of(item, k, word, 0u), word_of(item, k, word, 1u)));
        }
    }
    return both;
}

fn four(item: u32, word: u32, seen: u32) -> vec4u {
    return vec4u(
        word_of(item, 0u, word, seen), word_of(item, 1u, word, seen), word_of(item, 2u, word, seen),
        word_of(item, 3u, word, seen));
}

@compute @workgroup_size(64)
fn subs(
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
    let both = faced_and_seen(i);
    // Without bits all is seen.
    let lit = (params.words == 0u) | (both.x == both.y);
    let dark = ((node_rows[node].z & SPLIT) != 0u) | ((params.words != 0u) & (both.y == 0u));
    let samples = select(params.strata, 0u, dark);
    let light = light_from(receiver);
    let first = receiver.pattern * params.classes * params.strata;
    var sum = vec3f(0.0);
    var place = vec2f(0.0);
    for (var j = 0u; j < select(0u, samples, lit); j++) {
        sum += samples_of(receiver, light, first, j, place, vec4f(1.0));
        place = after(place);
    }
    // A loop in a loop, because what stands in a branch is run by all where any thread takes it.
    for (var word = 0u; 32u * word < select(samples, 0u, lit); word++) {
        let known = four(i, word, 0u);
        let seen = four(i, word, 1u);
        for (var bit = 0u; bit < min(params.strata - 32u * word, 32u); bit++) {
            let faced = vec4f((known >> vec4u(bit)) & vec4u(1u));
            let found = vec4f((seen >> vec4u(bit)) & vec4u(1u));
            let mean = dot(found, vec4f(1.0)) / max(dot(faced, vec4f(1.0)), 1.0);
            let shares = select(vec4f(mean), seen_shares(faced, found), params.classes == 4u);
            sum += samples_of(receiver, light, first, 32u * word + bit, place, shares);
            place = after(place);
        }
    }
    add(node, sum, light.scale);
}

@compute @workgroup_size(64)
fn pixels(
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
    let light = light_from(receiver);
    let all = not_uniform(params.strata * params.classes, i);
    let first = receiver.pattern * all;
    var sum = vec3f(0.0);
    var place = vec2f(0.0);
    var j = 0u;
    var set_ = 0u;
    for (var word = 0u; 32u * word < all; word++) {
        var seen = 0xffffffffu;
        if not_uniform(params.words, i) != 0u {
            seen = bits[(2u * i + 1u) * params.words + word];
        }
        for (var bit = 0u; bit < min(all - 32u * word, 32u); bit++) {
            sum += f32((seen >> bit) & 1u) * sample_of(receiver, light, first, j, place, set_);
            j++;
            place = after(place);
            if j == params.strata {
                j = 0u;
                set_++;
                place = vec2f(0.0);
            }
        }
    }
    add(node, sum, light.scale);
}
