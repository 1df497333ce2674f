// Irradiance of one light at each node, from the samples that it and its neighbours see:
//   E += sum_k v_k L_k A/N cos_s cos_l / d^2   [NPW10 Eq. 2; Deviation: N samples, radiance L, A(y_k) = A/N]
// Interleaved sampling [KH01; NPW10 Sec. 3.3.2]: a node asked one of four sets of samples; v_k of the others is what the
// neighbours found that asked them, weighted 1 2 1 along both axes so that all sets count alike. Deviation: geometry and
// radiance of every sample are those of the node itself, so that only visibility is shared, and on one surface.
// In: nodes and their bits, sample points and their radiance times area. In and out: node_irradiance, w: 1 where
// it may be shown, 0 where it only guides.

import package::common::alike::alike;
import package::common::fragment::ROUGH;
import package::common::grid::{Grid, item_index};
import package::common::nodes::{class_of, neighbour_node, node_at, node_rows};
import package::common::pyramid::{level_of, pyramid, texel_of};
import package::common::ray::Receiver;

struct InterleavedParams {
    first: u32,         // node of item 0
    strata: u32,        // samples that a node asks
    words: u32,         // 0: everything is seen
    classes: u32,       // sets of samples: 1 or 4
    normal: vec3f,      // of the lit side, or a spot's axis
    cos_cutoff: f32,    // of a spot; -2 for an area light
    two_sided: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: InterleavedParams;
@group(0) @binding(2) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> node_bits: array<u32>;
@group(0) @binding(4) var<storage, read> light_points: array<vec4f>;
@group(0) @binding(5) var<storage, read> light_radiance: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> node_irradiance: array<vec4f>;

// The nodes whose bits count, by neighbour: 1 + number, or 0; and the set that each asked.
struct Near {
    node: array<u32, 9>,
    class_: array<u32, 9>,
}

fn near(row: vec4u, receiver: Receiver, level: u32) -> Near {
    var found: Near;
    let size = pyramid.levels[level];
    let texel = texel_of(size, row.x - size.z);
    for (var k = 0u; k < 9u; k++) {
        var node = 0u;
        if k == 4u || params.classes > 1u {
            node = neighbour_node(level, texel, k);
        }
        if node != 0u {
            let other = node_rows[node - 1u];
            let own = level_of(other.x);
            found.class_[k] = class_of(texel_of(pyramid.levels[own], other.x - pyramid.levels[own].z), params.classes);
            let same = k == 4u || alike(receiver, node_receivers[node - 1u]);
            node = select(0u, node, same);
        }
        found.node[k] = node;
    }
    return found;
}

// Share of sample `bit` of each set that is seen; of a set that nobody asked, the mean of the others.
fn seen_shares(known: array<u32, 9>, seen: array<u32, 9>, class_: array<u32, 9>, bit: u32) -> vec4f {
    var count = vec4f(0.0);
    var sum = vec4f(0.0);
    for (var k = 0u; k < 9u; k++) {
        let weight = f32((2u - (k % 3u + 1u) % 2u) * (2u - (k / 3u + 1u) % 2u) * ((known[k] >> bit) & 1u));
        let at = vec4<bool>(class_[k] == 0u, class_[k] == 1u, class_[k] == 2u, class_[k] == 3u);
        count += select(vec4f(0.0), vec4f(weight), at);
        sum += select(vec4f(0.0), vec4f(weight * f32((seen[k] >> bit) & 1u)), at);
    }
    let all_count = dot(count, vec4f(1.0));
    let mean = select(0.0, dot(sum, vec4f(1.0)) / max(all_count, 1.0), all_count > 0.0);
    return select(vec4f(mean), sum / max(count, vec4f(1.0)), count > vec4f(0.0));
}

// What a sample adds when it is seen.
fn term(at: Receiver, sample: u32) -> f32 {
    let d = light_points[sample].xyz - at.origin;
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
    let guide = (row.z & ROUGH) != 0u;
    if guide && pyramid.level < pyramid.coarsest {
        return;
    }
    let receiver = node_receivers[node];
    let neighbours = near(row, receiver, pyramid.level);
    let first = receiver.pattern / params.classes * params.classes * params.strata;
    var sum = vec3f(0.0);
    var known: array<u32, 9>;
    var seen: array<u32, 9>;
    for (var j = 0u; j < params.strata; j++) {
        if params.words != 0u && j % 32u == 0u {
            for (var k = 0u; k < 9u; k++) {
                let at = (max(neighbours.node[k], 1u) - 1u) * 2u * params.words + j / 32u;
                known[k] = select(0u, node_bits[at], neighbours.node[k] != 0u);
                seen[k] = node_bits[at + params.words];
            }
        }
        var shares = vec4f(1.0);
        if params.words != 0u {
            shares = seen_shares(known, seen, neighbours.class_, j % 32u);
        }
        for (var c = 0u; c < params.classes; c++) {
            let sample = c * params.strata + j;
            sum += shares[c] * term(receiver, first + sample) * light_radiance[sample].xyz;
        }
    }
    node_irradiance[node] += vec4f(sum, 0.0);
    node_irradiance[node].w = select(1.0, 0.0, guide);
}
