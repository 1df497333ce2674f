// What the lobe of each fragment asks of one area light [NPW10 Sec. 3.2.1 and 3.3.3]. Where at least nine of its samples
// lie in the lobe, those are asked; else 5 x 5 places (or more, `lobe_samples`) about the mirror direction, spaced by the lobe's width, each with the
// light's mean radiance over its part [Deviation: means over the parts themselves, by sums, in place of mipmaps; each
// weighs what the lobe makes of it, and the part outside of the light nothing].
// In: receivers, sample points, light. Out: asked, bits of the samples; rays and lobe_weights, so many a fragment.

import package::common::grid::{Grid, item_index};
import package::common::light_sums::{light_sums, rectangle_mean};
import package::common::lobe::{cos_power, mirrored};
import package::common::lobe_patch::{Glossy, along, axis_of, integrand, patch_of, source};
import package::common::ray::{Ray, Receiver, inactive_ray};
import package::common::view::View;

struct LobeAskParams {
    first: u32,         // fragment of item 0
    strata: u32,        // samples of the light
    words: u32,
    pad: u32,
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<uniform> params: LobeAskParams;
@group(0) @binding(3) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(4) var<storage, read> points: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> asked: array<u32>;
@group(0) @binding(6) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(7) var<storage, read_write> lobe_weights: array<vec4f>;

// A sample lies in the lobe from this share of its height on,
const IN_LOBE: f32 = 0.1;
// and is asked from this.
const WORTH: f32 = 1e-3;
const ENOUGH: u32 = 9u;
const OF: u32 = 25u;
const T_MAX: f32 = 0.9999;

// Without colour: fragments are lit, pixels are coloured.
fn glossy_of(at: Receiver) -> Glossy {
    let mirror = mirrored(normalize(at.origin - view.eye), at.normal_shade);
    return Glossy(at.origin, bitcast<f32>(at.flags), mirror, vec3f(1.0), at.normal_shade, at.normal_geo);
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
    let at = receivers[params.first + i];
    let point = glossy_of(at);
    var count = 0u;
    for (var word = 0u; word < params.words; word++) {
        var bits = 0u;
        for (var k = 0u; k < min(params.strata - 32u * word, 32u); k++) {
            let d = points[at.pattern * params.strata + 32u * word + k].xyz - at.origin;
            let height = cos_power(dot(point.mirror, normalize(d)), point.n);
            count += select(0u, 1u, height >= IN_LOBE);
            bits |= select(0u, 1u << k, height >= WORTH);
        }
        asked[i * params.words + word] = bits;
    }
    let side = source.side;
    let few = count * OF < ENOUGH * side * side;
    if few {
        for (var word = 0u; word < params.words; word++) {
            asked[i * params.words + word] = 0u;
        }
    }
    let found = patch_of(point);
    let across = axis_of(found, 0u);
    let up = axis_of(found, 1u);
    for (var k = 0u; k < side * side; k++) {
        var ray = inactive_ray();
        var weight = vec3f(0.0);
        if few && all(found.lo < found.hi) {
            let cell = vec2f(f32(k % side), f32(k / side)) / f32(side);
            let x = along(across, cell.x + 0.5 / f32(side));
            let y = along(up, cell.y + 0.5 / f32(side));
            let lo = vec2f(along(across, cell.x).x, along(up, cell.y).x);
            let hi = vec2f(along(across, cell.x + 1.0 / f32(side)).x, along(up, cell.y + 1.0 / f32(side)).x);
            let share = x.y * y.y / f32(side * side) * integrand(point, vec2f(x.x, y.x));
            weight = share * source.radiance;
            if source.columns > 0u {
                weight = share * rectangle_mean(vec2u(source.columns, source.rows), source.radiance, lo, hi);
            }
            let chosen = source.corner + x.x * source.edge_u + y.x * source.edge_v;
            if share > 0.0 {
                ray = Ray(at.origin, 0.0, chosen - at.origin, T_MAX);
            }
        }
        rays[i * side * side + k] = ray;
        lobe_weights[i * side * side + k] = vec4f(weight, select(0.0, 1.0, few));
    }
}
