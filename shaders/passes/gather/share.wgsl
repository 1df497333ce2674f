// Share: the visible part of a light at each pixel of the zone, weighed by what each part of the light adds there:
//   share = sum_q w_q L_q v_q / sum_q w_q L_q,   w_q = cos_s cos_l / d^2 at the middle of quarter q of a block [HHM18]
// v_q is the part of the quarter's samples that is seen, or what the cell's neighbourhood agrees on; where all strata of a
// picture's quarter were asked, each of them counts with its own radiance. A channel each.
// Beside it stands how far from the truth it may be: the standard error of stratified samples, from the blocks of which
// a part is seen.
// In     pixels: receivers and visible, as zone_rays listed them. cells: the cells' own answers.
// Out    share: rgb, standard error

import package::common::cells::{PLAN_SUBS_SHIFT, cell_corner, cell_place};
import package::common::gbuffer::{SURFACE, floats};
import package::common::grid::{Grid, item_index};
import package::common::light::{Light, light_at, lights};
import package::common::list_params::ListParams;
import package::common::ray::Receiver;
import package::common::receiver::INACTIVE;
import package::common::strata::{BLOCKS, WORDS, asked_by_plan};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: ListParams;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> visible: array<u32>;
@group(0) @binding(3) var<storage, read> listed_cells: array<u32>;
@group(0) @binding(4) var<storage, read> cell_agreed: array<u32>;
@group(0) @binding(5) var<storage, read> cell_plan: array<u32>;
@group(0) @binding(6) var<storage, read> light_radiance: array<vec4f>;  // 256: mean radiance times area, block by block
@group(0) @binding(7) var<storage, read_write> share: array<vec4f>;
@group(0) @binding(8) var<storage, read> cell_bits: array<u32>;
@group(0) @binding(9) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(10) var<storage, read> g_normal: array<vec4u>;

// 1: the light shows a picture; else all of its strata are alike.
override PICTURE: u32 = 1u;

// Strata of a quarter of a block, before the shift to it.
const QUARTER: u32 = 0x33u;

// What a pixel sees the light with: d(a, b) = corner + a u + b v, heights over its plane, scaled so that no power of d
// leaves float32's range.
struct Sight {
    corner: vec3f,
    u: vec3f,
    v: vec3f,
    heights: vec3f,
}

fn sight(light: Light, origin: vec3f, normal: vec3f) -> Sight {
    let corner = light.corner - origin;
    let reach = max(abs(corner), max(abs(light.edge_u), abs(light.edge_v)));
    let scale = 1.0 / max(max(reach.x, max(reach.y, reach.z)), 1e-35);
    let heights = vec3f(dot(normal, corner), dot(normal, light.edge_u), dot(normal, light.edge_v));
    return Sight(corner * scale, light.edge_u * scale, light.edge_v * scale, heights * scale);
}

// How much a quarter counts that the horizon crosses: its samples may lie on either side, so it only decides where there
// is nothing else.
const CROSSED: f32 = 1e-3;

// cos_s / d^4: the cosine at the light times d is the same for all of its places; `half`: half the size of the place.
fn weight(s: Sight, ab: vec2f, half: vec2f) -> f32 {
    let d = s.corner + ab.x * s.u + ab.y * s.v;
    let d2 = dot(d, d);
    let height = s.heights.x + ab.x * s.heights.y + ab.y * s.heights.z;
    let lowest = height - abs(half.x * s.heights.y) - abs(half.y * s.heights.z);
    return select(CROSSED, 1.0, lowest >= 0.0) * max(0.0, height) / max(d2 * d2, 1e-35);
}

struct Sums {
    seen: vec3f,        // w L v
    all: vec3f,         // w L
    variance: vec3f,    // of w L v
}

// Variance of one yes-or-no answer, when there is but one and a shadow's edge is near.
const ONE_ANSWER: f32 = 0.17;

// Radiance times area of a quarter, and of those of its strata that are set in `seen`.
struct Quarter {
    all: vec3f,
    seen: vec3f,
}

fn quarter_of(light: Light, block: u32, q: u32, seen: u32) -> Quarter {
    var quarter = Quarter(light.radiance * (light.area / 64.0), vec3f(0.0));
    if PICTURE != 0u {
        quarter.all = vec3f(0.0);
        for (var i = 0u; i < 4u; i++) {
            let k = 2u * (q & 1u) + (i & 1u) + 4u * (2u * (q >> 1u) + (i >> 1u));
            let radiance = light_radiance[16u * block + k].xyz;
            quarter.all += radiance;
            quarter.seen += select(vec3f(0.0), radiance, ((seen >> k) & 1u) != 0u);
        }
    }
    return quarter;
}

// Adds the quarters of a block; `seen` and `asked`: its 16 strata.
fn add_block(sums: Sums, light: Light, s: Sight, block: u32, seen: u32, asked: u32) -> Sums {
    let across = params.blocks_u;
    let place = vec2u(block % across, block / across);
    let cells = 2.0 * vec2f(f32(across), f32(BLOCKS / across));
    var all = sums;
    var block_light = vec3f(0.0);
    for (var q = 0u; q < 4u; q++) {
        let at = 2u * place + vec2u(q & 1u, q >> 1u);
        let own = QUARTER << (2u * (q & 1u) + 8u * (q >> 1u));
        // With one sample a block, it speaks for all of its quarters.
        let part = select(own, 0xffffu, (asked & own) == 0u);
        let v = f32(countOneBits(seen & asked & part)) / max(f32(countOneBits(asked & part)), 1.0);
        // What nobody asked does not count.
        let w = select(0.0, weight(s, (vec2f(at) + 0.5) / cells, 0.5 / cells), asked != 0u);
        let quarter = quarter_of(light, block, q, seen);
        all.seen += w * select(v * quarter.all, quarter.seen, PICTURE != 0u && (asked & own) == own);
        block_light += w * quarter.all;
    }
    let n = f32(countOneBits(asked));
    let v = f32(countOneBits(seen & asked)) / max(n, 1.0);
    all.all += block_light;
    all.variance += block_light * block_light * select(v * (1.0 - v) / max(n - 1.0, 1.0), ONE_ANSWER, n == 1.0);
    return all;
}

// 1 where nothing could be seen of a channel.
fn share_of(sums: Sums) -> vec4f {
    let all = max(sums.all, vec3f(1e-35));
    let seen = select(vec3f(1.0), sums.seen / all, sums.all > vec3f(0.0));
    let error = select(vec3f(0.0), sqrt(sums.variance) / all, sums.all > vec3f(0.0));
    return vec4f(seen, max(error.x, max(error.y, error.z)));
}

@compute @workgroup_size(64)
fn pixels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end || receivers[i].pattern == INACTIVE {
        return;
    }
    let at = receivers[i].pixel;
    let pixel = vec2u(at % params.width, at / params.width);
    let index = listed_cells[params.first + i / 4u];
    let agreed = cell_agreed[index];
    let subs = (cell_plan[index] >> PLAN_SUBS_SHIFT) & 31u;
    let light = light_at(params.light);
    let s = sight(light, receivers[i].origin, receivers[i].normal_shade);
    var sums: Sums;
    for (var block = 0u; block < BLOCKS; block++) {
        let word = (visible[i * WORDS + block / 2u] >> (16u * (block & 1u))) & 0xffffu;
        let same = ((agreed >> block) & 1u) != 0u;
        let all = select(0u, 0xffffu, ((agreed >> (16u + block)) & 1u) != 0u);
        sums = add_block(sums, light, s, block, select(word, all, same), select(asked_by_plan(agreed, subs, params.boosts, pixel, block), 0xffffu, same));
    }
    share[at] = share_of(sums);
}

@compute @workgroup_size(64)
fn cells(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let index = listed_cells[params.first + i / 4u];
    let pixel = cell_corner(cell_place(index, params.width), i % 4u);
    let at = min(pixel.y, params.height - 1u) * params.width + min(pixel.x, params.width - 1u);
    let normal = g_normal[at];
    if pixel.x >= params.width || pixel.y >= params.height || normal.w != SURFACE {
        return;
    }
    let agreed = cell_agreed[index];
    // Blocks that no pixel of the cell could ask count as the neighbours say.
    let bits = cell_bits[index];
    let own = bits >> 16u;
    let asked = own | (agreed & 0xffffu);
    let seen = (bits & own) | ((agreed >> 16u) & agreed & ~own);
    let light = light_at(params.light);
    let s = sight(light, floats(g_position[at]), floats(normal));
    var sums: Sums;
    for (var block = 0u; block < BLOCKS; block++) {
        let all = select(0u, 0xffffu, ((seen >> block) & 1u) != 0u);
        let same = ((agreed >> block) & 1u) != 0u;
        sums = add_block(sums, light, s, block, all, select(select(0u, 1u, ((asked >> block) & 1u) != 0u), 0xffffu, same));
    }
    share[at] = share_of(sums);
}
