// Map shadow: which samples of one light each receiver sees by their shadow maps.
// In     receivers; points, patterns x strata samples on the light; distances
// Out    visibility: as `shadow` writes it
//        asked: as the entry of that name in `shadow`
// Rule   the map of a stratum stands at its point of the first pattern; the other points of the stratum share it.

import package::common::grid::{Grid, item_index};
import package::common::ray::Receiver;
import package::common::shadow_map::{MapParams, map_direction, map_texel, texel_angle};
import package::common::shadow_query::{ShadowParams, faces};

const SIZE: u32 = 64u;
// Bias, as a share of what a texel covers at that distance: for surfaces that bend within a texel.
const BIAS: f32 = 0.5;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> map: MapParams;
@group(0) @binding(1) var<uniform> params: ShadowParams;
@group(0) @binding(2) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(3) var<storage, read> points: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> visibility: array<u32>;
@group(0) @binding(5) var<storage, read> distances: array<f32>;

// Something is nearer to the sample than the receiver's own plane is where the texel's ray meets it: a bias that follows
// the slope.
fn hidden(receiver: Receiver, stratum: u32) -> bool {
    let d = receiver.origin - points[stratum].xyz;
    let back = map.sides > 1u && dot(map.normal, d) < 0.0;
    let n = select(map.normal, -map.normal, back);
    let texel = map_texel(map, n, d);
    let index = (stratum * map.sides + select(0u, 1u, back)) * map.resolution + texel.y;
    let ray = map_direction(map, n, texel);
    let distance = length(d);
    let slope = dot(receiver.normal_geo, ray);
    var plane = 2.0 * distance;
    if slope < 0.0 {
        plane = clamp(dot(receiver.normal_geo, d) / slope, 0.5 * distance, 2.0 * distance);
    }
    let bias = BIAS * texel_angle(map) * distance;
    return distances[map.first + index * map.resolution + texel.x] < plane - bias;
}

// Bits of the strata from `first` on, at most 32: of all, or of those in `asked`.
fn bits_of(receiver: Receiver, first: u32, asked: u32, some: bool) -> u32 {
    let row = receiver.pattern * params.strata;
    let count = min(params.strata - first, 32u);
    let all = 0xffffffffu >> (32u - count);
    var todo = select(all, all & asked, some);
    var bits = todo;
    while todo != 0u {
        let k = firstTrailingBit(todo);
        todo &= todo - 1u;
        let point = points[row + first + k];
        let facing = faces(params, receiver, point.xyz - receiver.origin);
        // What does not face stays when it was asked for, and is not seen when all are.
        var gone = !facing && !some;
        if facing {
            gone = !(point.w > 0.0) || hidden(receiver, (row + first + k) % map.samples);
        }
        if gone {
            bits &= ~(1u << k);
        }
    }
    return bits;
}

fn answer(item: u32, some: bool) {
    let index = item % params.receivers;
    let word = item / params.receivers;
    let at = index * params.words + word;
    let receiver = receivers[index];
    var bits = 0u;
    if receiver.pattern < params.patterns {
        bits = bits_of(receiver, 32u * word, visibility[at], some);
    }
    visibility[at] = bits;
}

@compute @workgroup_size(SIZE)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        answer(item, false);
    }
}

@compute @workgroup_size(SIZE)
fn asked(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = item_index(grid, group, groups, SIZE, lane);
    if item < grid.end {
        answer(item, true);
    }
}
