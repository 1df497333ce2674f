// How much of each of the places in a fragment's lobe is seen.
//   bits       all or nothing, by the rays [NPW10 Sec. 3.3.3]
//   distances  to the nearest occluder along each ray, over that to the light, less 1: 0 where nothing is hit
//   variance   by mean and variance of the neighbours' distances: a place is seen with the probability s2 / (s2 + m^2),
//              m < 0 [DL06]. Deviations: relative distances, which float32 keeps apart; what is not hidden has the
//              light's own; neighbours are those of one surface and level; the last is that beside it
// In: occluded bits or hits; receivers, list of fragments. Out: lobe_seen, lobe_distances.

import package::common::alike::alike;
import package::common::fragment::CULLED;
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number};
import package::common::ray::{Hit, MISS, Receiver};
import package::common::tiles::pixel_in_tile_order;

struct LobeVisibleParams {
    first: u32,         // fragment of the first item's
    places: u32,        // in a lobe
    side: u32,          // along each axis
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: LobeVisibleParams;
@group(0) @binding(1) var<storage, read> occluded: array<u32>;
@group(0) @binding(2) var<storage, read> hits: array<Hit>;
@group(0) @binding(3) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(4) var<storage, read> fragment_list: array<u32>;
@group(0) @binding(5) var<storage, read> fragment_flags: array<u32>;
@group(0) @binding(6) var<storage, read> fragment_at: array<u32>;
@group(0) @binding(7) var<storage, read_write> lobe_seen: array<f32>;
@group(0) @binding(8) var<storage, read_write> lobe_distances: array<f32>;

// No variance is less, relative to the light's distance.
const LEAST: f32 = 1e-5;
// Probabilities up to this are light that bleeds through.
const BLEEDING: f32 = 0.2;

@compute @workgroup_size(64)
fn bits(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        lobe_seen[i] = select(1.0, 0.0, ((occluded[i / 32u] >> (i % 32u)) & 1u) != 0u);
    }
}

@compute @workgroup_size(64)
fn distances(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let met = hits[i].instance != MISS;
        lobe_distances[params.first * params.places + i] = select(0.0, min(hits[i].t - 1.0, 0.0), met);
    }
}

@compute @workgroup_size(64)
fn variance(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let asked = i % params.places;
    // The last corner is not asked; the place beside it stands for it.
    let k = select(asked, asked - params.side - 1u, asked == params.places - 1u && params.side > 1u);
    let fragment = params.first + i / params.places;
    let place = fragment_list[fragment];
    let level = (fragment_flags[place] & 255u) - 1u;
    let size = pyramid.levels[level];
    let texel = pixel_in_tile_order(place, pyramid.levels[0].x) >> vec2u(level);
    let own = lobe_distances[fragment * params.places + k];
    // Two passes over the neighbours: the mean first, so that nothing cancels.
    var sum = vec3f(own, 0.0, 1.0);
    for (var turn = 0u; turn < 2u; turn++) {
        let mean = sum.x / sum.z;
        sum = select(vec3f(mean, (own - mean) * (own - mean), 1.0), vec3f(own, 0.0, 1.0), turn == 0u);
        for (var n = 0u; n < 9u; n++) {
            let at = vec2i(texel) + vec2i(i32(n % 3u), i32(n / 3u)) - 1;
            // A negative column is a large one as well.
            if n == 4u || !all(vec2u(at) < size.xy) {
                continue;
            }
            let other = fragment_at[texel_number(size, vec2u(at))];
            if other == 0u || other == CULLED || !alike(receivers[fragment], receivers[max(other, 1u) - 1u]) {
                continue;
            }
            let there = lobe_distances[(other - 1u) * params.places + k];
            sum += select(vec3f(0.0, (there - mean) * (there - mean), 1.0), vec3f(there, 0.0, 1.0), turn == 0u);
        }
        if turn == 1u {
            let s2 = max(sum.y / sum.z, LEAST);
            let bound = s2 / (s2 + mean * mean);
            lobe_seen[i] = select(max(bound - BLEEDING, 0.0) / (1.0 - BLEEDING), 1.0, mean > -1e-4);
        }
    }
}
