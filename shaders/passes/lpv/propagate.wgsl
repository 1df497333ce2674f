// One step of light from each cell to the six beside it [KD10 Sec. 3.5]. `leave`: what flies out through each face of a
// cell, and the sum of it over all steps. `arrive`: what comes to a cell through its open faces.
// Deviation: [KD10] projects two bands onto the solid angles of faces. Two bands are negative against strong light, so that
// whatever shines brightly is black in its own sum, and that which is sent on as a clamped cosine towards each face forgets
// within two cells where it was going (`lpv_transport="faces"`). Here the two bands stand for a lobe about the net flow
// that is nowhere negative, a mixture of powers of (1 + cos) / 2 with that mean; it leaves in 24 directions, through the
// faces ahead of each in the shares in which a beam crosses them. All that leaves arrives: flux and net flow are kept.

import package::common::grid::{Grid, item_index};
import package::common::lpv_volume::{FAINTEST, LOBE, ROOT3, Volume, limited, net_flow};

// 1: as the literature, clamped cosines from faces.
override FACES: u32 = 0u;
// Of one of six flows, the way that the surfaces face which its light left: it flies in no direction behind it. 0: any.
override SIDE_X: i32 = 0;
override SIDE_Y: i32 = 0;
override SIDE_Z: i32 = 0;

struct PropagateParams {
    mean_of_mean: f32,  // of faces
    mean_of_along: f32,
    along_of_mean: f32,
    along_of_along: f32,
    across: f32,
    most: f32,          // largest net flow, as a share
    reflected: f32,     // share of what closed faces get that they send back
    first: u32,         // of the channels at work, cells before them
}

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> volume: Volume;
@group(0) @binding(1) var<uniform> params: PropagateParams;
@group(0) @binding(2) var<storage, read_write> flow: array<vec4f>;
@group(0) @binding(3) var<storage, read> open: array<u32>;
// What leaves along each axis, two a cell: through its lower face, through its upper one.
@group(0) @binding(4) var<storage, read_write> along_x: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> along_y: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> along_z: array<vec4f>;
// Means that left through the three lower faces, and through the upper ones, in all steps.
@group(0) @binding(7) var<storage, read_write> passed_lower: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> passed_upper: array<vec4f>;

// The 24 directions are the permutations of +-(AHEAD, BESIDE, BESIDE): middles of a cube's faces cut in four by angle.
const AHEAD: f32 = 0.86285621;
const BESIDE: f32 = 0.35740675;
// Shares of a beam's flux through the face ahead, and through each of two beside: |direction| over its sum.
const THROUGH: f32 = 0.54691816;
const ASIDE: f32 = 0.22654092;

// What leaves through the faces of a cell.
struct Leaving {
    lower: mat3x4f,
    upper: mat3x4f,
}

// Parts of a lobe, of powers 0, 1, 4 and 16 of (1 + cos) / 2, whose means are 0, 1/3, 2/3 and 8/9.
fn parts_of(net: f32) -> vec4f {
    let t = clamp(vec3f(3.0 * net, 3.0 * net - 1.0, 4.5 * net - 3.0), vec3f(0.0), vec3f(1.0));
    return vec4f(1.0 - t.x, t.x - t.y, t.y - t.z, t.z);
}

fn lobe(parts: vec4f, cos: vec4f) -> vec4f {
    let one = 0.5 + 0.5 * cos;
    let two = one * one;
    let four = two * two;
    let eight = four * four;
    return parts.x + parts.y * 2.0 * one + parts.z * 5.0 * four + parts.w * 17.0 * eight * eight;
}

// What leaves in the eight directions mostly along one axis: xyzw of `net` the mean and that axis first, then the two
// others. Columns: through the lower and the upper face of that axis, of the second, of the third, alike.
fn along_axis(parts: vec4f, towards: vec3f, side: vec3f) -> array<vec4f, 6> {
    let second = vec4f(-1.0, 1.0, -1.0, 1.0);
    let third = vec4f(-1.0, -1.0, 1.0, 1.0);
    let aside = BESIDE * (towards.y * second + towards.z * third);
    let faced = side.y * second + side.z * third;
    let lower = select(vec4f(0.0), lobe(parts, aside - AHEAD * towards.x), faced >= vec4f(side.x));
    let upper = select(vec4f(0.0), lobe(parts, aside + AHEAD * towards.x), faced >= vec4f(-side.x));
    let both = lower + upper;
    let apart = AHEAD * (upper - lower);
    let one = vec4f(1.0);
    let out_lower = vec4f(dot(lower, one), -AHEAD * dot(lower, one), BESIDE * dot(lower, second), BESIDE * dot(lower, third));
    let out_upper = vec4f(dot(upper, one), AHEAD * dot(upper, one), BESIDE * dot(upper, second), BESIDE * dot(upper, third));
    let b0 = both.xz;
    let b1 = both.yw;
    let left = vec4f(b0.x + b0.y, apart.x + apart.z, -BESIDE * (b0.x + b0.y), BESIDE * (b0.y - b0.x));
    let right = vec4f(b1.x + b1.y, apart.y + apart.w, BESIDE * (b1.x + b1.y), BESIDE * (b1.y - b1.x));
    let near = vec4f(both.x + both.y, apart.x + apart.y, BESIDE * (both.y - both.x), -BESIDE * (both.x + both.y));
    let far = vec4f(both.z + both.w, apart.z + apart.w, BESIDE * (both.w - both.z), BESIDE * (both.z + both.w));
    return array(THROUGH * out_lower, THROUGH * out_upper, ASIDE * left, ASIDE * right, ASIDE * near, ASIDE * far);
}

fn lobes_leaving(own: vec4f) -> Leaving {
    let net = net_flow(own);
    let towards = own.yzw / (max(own.x, FAINTEST) * ROOT3 * max(net, 1e-6));
    let parts = parts_of(net);
    let side = vec3f(f32(SIDE_X), f32(SIDE_Y), f32(SIDE_Z));
    let x = along_axis(parts, towards, side);
    let y = along_axis(parts, towards.yzx, side.yzx);
    let z = along_axis(parts, towards.zxy, side.zxy);
    var out = Leaving(
        mat3x4f(x[0] + y[4].xwyz + z[2].xzwy, x[2] + y[0].xwyz + z[4].xzwy, x[4] + y[2].xwyz + z[0].xzwy),
        mat3x4f(x[1] + y[5].xwyz + z[3].xzwy, x[3] + y[1].xwyz + z[5].xzwy, x[5] + y[3].xwyz + z[1].xzwy),
    );
    let sum = out.lower[0] + out.lower[1] + out.lower[2] + out.upper[0] + out.upper[1] + out.upper[2];
    // As much light as there is, and its net flow: what 24 directions lack of it goes with each face's share.
    let scale = own.x / sum.x;
    let lack = (own.yzw - ROOT3 * scale * sum.yzw) / max(own.x, FAINTEST);
    for (var axis = 0u; axis < 3u; axis++) {
        let lower = scale * out.lower[axis];
        let upper = scale * out.upper[axis];
        out.lower[axis] = vec4f(lower.x, ROOT3 * lower.yzw + lower.x * lack);
        out.upper[axis] = vec4f(upper.x, ROOT3 * upper.yzw + upper.x * lack);
    }
    return out;
}

fn faces_leaving(own: vec4f) -> Leaving {
    var out = Leaving(mat3x4f(), mat3x4f());
    for (var axis = 0u; axis < 3u; axis++) {
        let unit = vec3f(vec3u(axis) == vec3u(0u, 1u, 2u));
        let along = dot(own.yzw, unit);
        let still = vec4f(params.mean_of_mean * own.x, params.across * own.yzw);
        let turned = vec4f(params.mean_of_along * along, params.along_of_mean * own.x * unit);
        let kept = vec4f(0.0, (params.along_of_along - params.across) * along * unit);
        out.lower[axis] = still - turned + kept;
        out.upper[axis] = still + turned + kept;
    }
    return out;
}

@compute @workgroup_size(64)
fn leave(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let own = flow[params.first + i];
    var out: Leaving;
    if FACES == 1u {
        out = faces_leaving(own);
    } else {
        out = lobes_leaving(own);
    }
    along_x[2u * i] = out.lower[0];
    along_x[2u * i + 1u] = out.upper[0];
    along_y[2u * i] = out.lower[1];
    along_y[2u * i + 1u] = out.upper[1];
    along_z[2u * i] = out.lower[2];
    along_z[2u * i + 1u] = out.upper[2];
    passed_lower[params.first + i] += vec4f(out.lower[0].x, out.lower[1].x, out.lower[2].x, 0.0);
    passed_upper[params.first + i] += vec4f(out.upper[0].x, out.upper[1].x, out.upper[2].x, 0.0);
}

// What comes along an axis: from the cells below and above where the face is open, else sent back by it, diffusely.
fn arriving(below: vec4f, above: vec4f, own: vec2f, is_open: vec2<bool>, unit: vec3f) -> vec4f {
    let back = params.reflected * own;
    return select(back.x * vec4f(1.0, LOBE * unit), below, is_open.x)
        + select(back.y * vec4f(1.0, -LOBE * unit), above, is_open.y);
}

@compute @workgroup_size(64)
fn arrive(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let mask = open[i % volume.cells];
    let low = (vec3u(mask) & vec3u(1u, 4u, 16u)) != vec3u(0u);
    let high = (vec3u(mask) & vec3u(2u, 8u, 32u)) != vec3u(0u);
    let strides = vec3u(1u, volume.size.x, volume.size.x * volume.size.y);
    let below = 2u * (i - select(vec3u(0u), strides, low)) + 1u;
    let above = 2u * (i + select(vec3u(0u), strides, high));
    let own = 2u * i;
    var sum = arriving(along_x[below.x], along_x[above.x], vec2f(along_x[own].x, along_x[own + 1u].x),
        vec2<bool>(low.x, high.x), vec3f(1.0, 0.0, 0.0));
    sum += arriving(along_y[below.y], along_y[above.y], vec2f(along_y[own].x, along_y[own + 1u].x),
        vec2<bool>(low.y, high.y), vec3f(0.0, 1.0, 0.0));
    sum += arriving(along_z[below.z], along_z[above.z], vec2f(along_z[own].x, along_z[own + 1u].x),
        vec2<bool>(low.z, high.z), vec3f(0.0, 0.0, 1.0));
    flow[params.first + i] = limited(sum, params.most);
}
