// What the lobe of each pixel's surface reflects of one area light, unshadowed: the integral of lobe, cosines and radiance
// over the patch that it reaches, by Gauss-Legendre nodes on both sides of the mirror direction along both axes. A picture
// counts with its mean over the part that a node stands for, so that no sample of it is ever seen as such.
//   surfaces  the lobe of each pixel, once for all lights
//   main      one light
// In: G-buffer, instance_lobes, light. Out: lobe_surface; lobe_light rgb, w 1 where there is any.

import package::common::gbuffer::SURFACE;
import package::common::grid::{Grid, item_index};
import package::common::light_strip::{Strip, strip_of, strip_to};
import package::common::light_sums::light_sums;
import package::common::lobe::instance_lobes;
import package::common::lobe_patch::{Glossy, Half, Patch, glossy_at, half_of, integrand, patch_of, place, source};
import package::common::view::View;

// Whether some light has a picture: if not, nothing of one is loaded.
override PICTURE: bool = true;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read> g_albedo: array<vec4u>;
@group(0) @binding(7) var<storage, read_write> lobe_surface: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> lobe_light: array<vec4f>;

// Nodes along a half: few, and more where a picture is averaged between them. Abscissas in [0, 1], weights that add up
// to 1, and of the many where the part of a node begins: the weights so far.
const FEW: u32 = 6u;
const MANY: u32 = 10u;
const NODE: array<f32, 16> = array<f32, 16>(
    0.033765243, 0.169395307, 0.380690407, 0.619309593, 0.830604693, 0.966234757, 0.013046736, 0.067468317,
    0.160295216, 0.283302303, 0.425562831, 0.574437169, 0.716697697, 0.839704784, 0.932531683, 0.986953264);
const WEIGHT: array<f32, 16> = array<f32, 16>(
    0.085662246, 0.180380787, 0.233956967, 0.233956967, 0.180380787, 0.085662246, 0.033335672, 0.074725675,
    0.109543181, 0.134633360, 0.147762112, 0.147762112, 0.134633360, 0.109543181, 0.074725675, 0.033335672);
const BORDER: array<f32, 11> = array<f32, 11>(
    0.000000000, 0.033335672, 0.108061347, 0.217604528, 0.352237888, 0.500000000, 0.647762112,
    0.782395472, 0.891938653, 0.966664328, 1.000000000);

// A quarter of the patch without a picture: one half of each axis.
fn plain_quarter(at: Glossy, u: Half, v: Half) -> f32 {
    var sum = 0.0;
    for (var j = 0u; j < FEW; j++) {
        let y = place(v, NODE[j]);
        for (var i = 0u; i < FEW; i++) {
            let x = place(u, NODE[i]);
            sum += WEIGHT[i] * WEIGHT[j] * x.y * y.y * integrand(at, vec2f(x.x, y.x));
        }
    }
    return sum;
}

// With one: nodes of a row take the picture's means from a strip of it.
fn picture_quarter(at: Glossy, u: Half, v: Half) -> vec3f {
    let size = vec2u(source.columns, source.rows);
    let way = sign(u.scale);
    var row = clamp(place(v, 0.0).x, 0.0, 1.0);
    var sum = vec3f(0.0);
    for (var j = 0u; j < MANY; j++) {
        let y = place(v, NODE[FEW + j]);
        let next = clamp(place(v, BORDER[j + 1u]).x, 0.0, 1.0);
        var mean = strip_of(size, vec2f(min(row, next), max(row, next)), u.from_, way);
        for (var i = 0u; i < MANY; i++) {
            let x = place(u, NODE[FEW + i]);
            let weight = WEIGHT[FEW + i] * WEIGHT[FEW + j] * x.y * y.y * integrand(at, vec2f(x.x, y.x));
            mean = strip_to(mean, size, place(u, BORDER[i + 1u]).x);
            sum += weight * max(source.radiance + mean.whole, vec3f(0.0));
        }
        row = next;
    }
    return sum;
}

fn quarter(at: Glossy, u: Half, v: Half) -> vec3f {
    if PICTURE {
        return picture_quarter(at, u, v);
    }
    return plain_quarter(at, u, v) * source.radiance;
}

fn whole(at: Glossy, found: Patch) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let ends = vec2f(select(found.lo.x, found.hi.x, (k & 1u) != 0u), select(found.lo.y, found.hi.y, k >= 2u));
        let u = half_of(found.peak.x, ends.x, found.scale.x);
        let v = half_of(found.peak.y, ends.y, found.scale.y);
        if u.turn > 0.0 && v.turn > 0.0 {
            sum += quarter(at, u, v);
        }
    }
    return sum;
}

@compute @workgroup_size(64)
fn surfaces(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < grid.end {
        let surface = instance_lobes[select(0u, g_albedo[i].w, g_normal[i].w == SURFACE)];
        lobe_surface[i] = select(vec4f(0.0), surface, g_normal[i].w == SURFACE);
    }
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
    var sum = vec3f(0.0);
    if g_normal[i].w == SURFACE {
        let at = glossy_at(g_position[i], g_normal[i], g_geometric[i], lobe_surface[i], view.eye);
        let found = patch_of(at);
        if all(found.lo < found.hi) {
            sum = at.color * whole(at, found);
        }
    }
    lobe_light[i] = vec4f(sum, select(0.0, 1.0, any(sum > vec3f(0.0))));
}
