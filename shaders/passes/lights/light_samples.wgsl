// Where the samples of one area light lie, and what each stands for.
//   points    one point a stratum and pattern: the middle, or a place that differs between patterns [CPC84].
//   radiance  the mean radiance of each stratum times its area [NPW10 Eq. 2; Deviation: A(y_i) = A/N, the sum runs over
//             N samples, and a texture is averaged over the stratum, which a point sample would miss].
// Consecutive strata are neighbours (4 x 4 blocks where the grid allows), so that their rays stay together.

import package::common::grid::{Grid, group_index, item_index};
import package::common::light::{Light, light_at, light_texel, lights};
import package::common::random::random4;

struct LightSamplesParams {
    light: u32,
    strata_u: u32,
    strata_v: u32,
    patterns: u32,
    seed: u32,
    jittered: u32,
    t_max: f32,
    classes: u32,       // sets that samples are dealt to: 1, or 4 of which each takes one of 2 x 2 strata [KH01]
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> params: LightSamplesParams;
@group(0) @binding(1) var<storage, read_write> light_points: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> light_radiance: array<vec4f>;

// The cell of stratum k. Set after set where there are several, each row by row.
fn stratum_cell(k: u32, nu: u32, nv: u32) -> vec2u {
    if params.classes == 4u {
        let of_a_set = nu * nv / 4u;
        let within = k % of_a_set;
        let taken = k / of_a_set;
        return 2u * vec2u(within % (nu / 2u), within / (nu / 2u)) + vec2u(taken & 1u, taken >> 1u);
    }
    if nu % 4u != 0u || nv % 4u != 0u {
        return vec2u(k % nu, k / nu);
    }
    let block = k / 16u;
    let within = k % 16u;
    return vec2u(block % (nu / 4u), block / (nu / 4u)) * 4u + vec2u(within % 4u, within / 4u);
}

@compute @workgroup_size(64)
fn points(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    let strata = params.strata_u * params.strata_v;
    if i >= grid.end {
        return;
    }
    let k = i % strata;
    let cell = stratum_cell(k, params.strata_u, params.strata_v);
    var jitter = vec2f(0.5);
    if params.jittered != 0u {
        jitter = random4(vec4u(k, i / strata, params.light, params.seed)).xy;
    }
    let ab = (vec2f(cell) + jitter) / vec2f(f32(params.strata_u), f32(params.strata_v));
    let light = light_at(params.light);
    light_points[i] = vec4f(light.corner + ab.x * light.edge_u + ab.y * light.edge_v, params.t_max);
}

// Integral from 0 to x of the hat of linear interpolation about 0, negative below it.
fn hat_integral(x: f32) -> f32 {
    let d = clamp(x, -1.0, 1.0);
    return d - 0.5 * d * abs(d);
}

// Integral up to x of texel i's weight, from any fixed place: a box, or a hat whose outermost texels go on to the edge.
fn weight_until(i: i32, count: i32, x: f32, linear: bool) -> f32 {
    if !linear {
        return clamp(x - f32(i), 0.0, 1.0);
    }
    let d = x - (f32(i) + 0.5);
    let to_the_edge = (i == 0 && d < 0.0) || (i == count - 1 && d > 0.0);
    return select(hat_integral(d), d, to_the_edge);
}

var<workgroup> sums: array<vec3f, 64>;

// One workgroup a stratum; its threads stride over the texels that the stratum covers.
@compute @workgroup_size(64)
fn radiance(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    let strata = params.strata_u * params.strata_v;
    let light = light_at(params.light);
    let share = light.area / f32(strata);
    var sum = vec3f(0.0);
    if light.texels != 0u && k < strata {
        let cell = vec2f(stratum_cell(k, params.strata_u, params.strata_v));
        let size = vec2f(f32(light.width), f32(light.height));
        let cells = vec2f(f32(params.strata_u), f32(params.strata_v));
        // Row 0 of the picture lies at b = 1.
        let lo = vec2f(cell.x, cells.y - cell.y - 1.0) / cells * size;
        let hi = vec2f(cell.x + 1.0, cells.y - cell.y) / cells * size;
        let reach = select(0.0, 1.0, light.linear);
        let first = max(vec2i(floor(lo - reach)), vec2i(0));
        let last = min(vec2i(ceil(hi + reach)), vec2i(size));
        let columns = u32(last.x - first.x);
        let count = columns * u32(last.y - first.y);
        for (var i = lane; i < count; i += 64u) {
            let c = first.x + i32(i % columns);
            let r = first.y + i32(i / columns);
            let wx = weight_until(c, i32(light.width), hi.x, light.linear) - weight_until(c, i32(light.width), lo.x, light.linear);
            let wy = weight_until(r, i32(light.height), hi.y, light.linear) - weight_until(r, i32(light.height), lo.y, light.linear);
            sum += wx * wy * light_texel(light, c, r);
        }
        sum *= 1.0 / ((hi.x - lo.x) * (hi.y - lo.y));
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u && k < strata {
        let mean = select(sums[0], light.radiance, light.texels == 0u);
        light_radiance[k] = vec4f(mean * share, 0.0);
    }
}
