// Incremental refinement [NPW10 Sec. 3.4]: which nodes of a level are split, and the fragments that follow. Geometry is
// asked first [Deviation: the paper asks illumination first, and so lights fragments that lie across an edge], then:
//   mean    the mean irradiance of the coarsest level
//   bits    one light's visibility: samples of which a neighbourhood of 3 x 3 nodes does not agree
//   differ  irradiance: its difference to a neighbour's on the same surface, over the mean; and nodes with fewer than
//           two neighbours beside them that could be shown, which nothing could be interpolated with
// and at last
//   choose  level and reason of every pixel, and which texels are fragments. Deviation: top-down from split nodes, so that
//           the fragments are a partition whatever the metrics say.
// In: nodes, their bits and irradiance, texel_state. Out: node_rows, level_map, reason_map, fragment_at.

import package::common::alike::alike;
import package::common::fragment::{
    CULLED, FACES_AWAY, LEVEL_CULLED, LEVEL_NOTHING, LIT, ON_SURFACE, REASON_BEHIND_LIGHT, REASON_COARSEST,
    REASON_DEPTH, REASON_EMITTER, REASON_FACING_AWAY, REASON_ILLUMINATION, REASON_NORMAL, REASON_NOTHING,
    REASON_VISIBILITY, ROUGH, ROUGH_DEPTH, ROUGH_NORMAL,
};
import package::common::gbuffer::{NOTHING, SURFACE};
import package::common::grid::{Grid, item_index};
import package::common::nodes::{CHANGES, DIFFERS, SKIPS, SPLIT, neighbour_node, node_at, node_rows};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::ray::Receiver;
import package::common::tiles::pixel_in_tile_order;

struct IncrementalParams {
    first: u32,         // node of item 0
    count: u32,         // nodes of the level
    words: u32,         // of visibility bits a node
    least_bits: u32,    // bits in doubt from which on a node is split
    threshold: f32,     // difference of irradiance over the mean
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: IncrementalParams;
@group(0) @binding(2) var<storage, read> node_receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> node_bits: array<u32>;
@group(0) @binding(4) var<storage, read> node_irradiance: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> mean_irradiance: array<vec4f>;
@group(0) @binding(6) var<storage, read> texel_state: array<u32>;
@group(0) @binding(7) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(8) var<storage, read_write> level_map: array<u32>;
@group(0) @binding(9) var<storage, read_write> reason_map: array<u32>;
@group(0) @binding(10) var<storage, read_write> fragment_at: array<u32>;

// Neighbours beside a node that it needs for interpolation.
const LEAST_SHOWN: u32 = 2u;

var<workgroup> sums: array<vec3f, 64>;

// One workgroup.
@compute @workgroup_size(64)
fn mean(@builtin(local_invocation_index) lane: u32) {
    var sum = vec3f(0.0);
    for (var i = lane; i < params.count; i += 64u) {
        sum += node_irradiance[params.first + i].xyz;
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        mean_irradiance[0] = vec4f(sums[0] / f32(max(params.count, 1u)), 1.0);
    }
}

fn texel_of_node(row: vec4u) -> vec2u {
    let size = pyramid.levels[pyramid.level];
    return texel_of(size, row.x - size.z);
}

// Bits of one word that some of the nodes see and some do not.
fn in_doubt(nodes: array<u32, 9>, word: u32) -> u32 {
    var some = 0u;
    var not_all = 0u;
    for (var k = 0u; k < 9u; k++) {
        if nodes[k] != 0u {
            let at = (nodes[k] - 1u) * 2u * params.words + word;
            let known = node_bits[at];
            let seen = node_bits[at + params.words];
            some |= known & seen;
            not_all |= known & ~seen;
        }
    }
    return some & not_all;
}

@compute @workgroup_size(64)
fn bits(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let row = node_rows[params.first + i];
    if (row.z & ROUGH) != 0u {
        return;
    }
    let texel = texel_of_node(row);
    var nodes: array<u32, 9>;
    for (var k = 0u; k < 9u; k++) {
        nodes[k] = neighbour_node(pyramid.level, texel, k);
    }
    var count = 0u;
    for (var word = 0u; word < params.words; word++) {
        count += countOneBits(in_doubt(nodes, word));
    }
    if count >= params.least_bits {
        node_rows[params.first + i].z |= CHANGES;
    }
}

@compute @workgroup_size(64)
fn differ(
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
    if (row.z & ROUGH) != 0u {
        return;
    }
    let texel = texel_of_node(row);
    let receiver = node_receivers[node];
    let own = node_irradiance[node].xyz;
    var most = 0.0;
    var shown = 0u;
    for (var k = 0u; k < 9u; k++) {
        let other = neighbour_node(pyramid.level, texel, k);
        if other != 0u && alike(receiver, node_receivers[other - 1u]) {
            let apart = abs(node_irradiance[other - 1u].xyz - own);
            most = max(most, apart.x + apart.y + apart.z);
            let beside = k % 2u == 1u && (node_rows[other - 1u].z & ROUGH) == 0u;
            shown += select(0u, 1u, beside);
        }
    }
    let mean = mean_irradiance[0].x + mean_irradiance[0].y + mean_irradiance[0].z;
    if most > params.threshold * mean || shown < LEAST_SHOWN {
        node_rows[node].z |= DIFFERS;
    }
}

// Why a node was split.
fn reason_of(state: u32) -> u32 {
    let light = select(select(REASON_COARSEST, REASON_VISIBILITY, (state & (CHANGES | SKIPS)) != 0u), REASON_ILLUMINATION, (state & DIFFERS) != 0u);
    let normal = select(light, REASON_NORMAL, (state & ROUGH_NORMAL) != 0u);
    return select(normal, REASON_DEPTH, (state & ROUGH_DEPTH) != 0u);
}

// A thread for each place of the tile order.
@compute @workgroup_size(64)
fn choose(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = item_index(grid, group, groups, 64u, lane);
    let pixel = pixel_in_tile_order(place, pyramid.levels[0].x);
    if place >= grid.end || any(pixel >= pyramid.levels[0].xy) {
        return;
    }
    var level = pyramid.coarsest;
    var above = 0u;
    var number = texel_number(pyramid.levels[level], pixel >> vec2u(level));
    var state = texel_state[number];
    while level > pyramid.finest && (state & LIT) != 0u {
        let split = node_rows[node_at[number] - 1u].z;
        if (split & SPLIT) == 0u {
            break;
        }
        above = split;
        level--;
        number = texel_number(pyramid.levels[level], pixel >> vec2u(level));
        state = texel_state[number];
    }
    let culled = (state & LIT) == 0u;
    let dark = select(REASON_BEHIND_LIGHT, REASON_FACING_AWAY, (state & FACES_AWAY) != 0u);
    let at = pixel.y * pyramid.levels[0].x + pixel.x;
    let kind = g_normal[at].w;
    let outside = select(vec2u(LEVEL_CULLED, REASON_EMITTER), vec2u(LEVEL_NOTHING, REASON_NOTHING), kind == NOTHING);
    let inside = select(vec2u(level, reason_of(above)), vec2u(LEVEL_CULLED, dark), culled);
    let answer = select(outside, inside, kind == SURFACE);
    level_map[at] = answer.x;
    reason_map[at] = answer.y;
    let leads = (state & ON_SURFACE) != 0u && all((pixel & vec2u((1u << level) - 1u)) == vec2u(0u));
    if leads {
        fragment_at[number] = select(node_at[number], CULLED, culled);
    }
}
