// What the metrics of refinement need to know of every texel of levels 1, 2, ... Only pixels that see a surface count.
//   base        level 1 from the G-buffer
//   reduce      `pyramid.level` from the level below
//   deviations  of every level: how far its pixels are from its mean tangent plane and its mean normal, at most
// means, three rows a texel (floats as their bits):
//   xyz mean position, w surface pixels | xyz mean shading normal, w largest curvature | xyz mean geometric normal,
//   w largest slope
// ranges, two rows a texel: xyz least shading normal, w least depth | xyz largest normal, w largest depth
// spreads, two words a texel, floats as their bits: distance to the plane over the texel's width, 1 - cosine
// Slopes and curvatures are zero unless STEEPNESS is set.
// Slope is the change of depth from a pixel to its neighbours, sqrt((dz/dx)^2 + (dz/dy)^2) [NPW10 Sec. 3.2], over the
// pixel's width at that depth; curvature [KJ16] the change of the normal over the distance.

import package::common::gbuffer::{SURFACE, floats, words};
import package::common::grid::{Grid, item_index};
import package::common::pyramid::{pyramid, texel_number, texel_of};
import package::common::view::View;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<storage, read> g_position: array<vec4u>;
@group(0) @binding(3) var<storage, read> g_normal: array<vec4u>;
@group(0) @binding(4) var<storage, read> g_geometric: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> means: array<vec4u>;
@group(0) @binding(6) var<storage, read_write> ranges: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> spreads: array<atomic<u32>>;

override STEEPNESS: bool = true;

const FAR: f32 = 3.0e38;
// A mean normal shorter than this has no direction: the normals cancel.
const NO_NORMAL: f32 = 1e-6;

fn depth_of(p: vec3f) -> f32 {
    return dot(view.eye - p, view.backward);
}

// Change of depth and of normal a scene unit towards a neighbour; 0 where it sees no surface.
fn change(p: vec3f, n: vec3f, neighbour: vec2u, inside: bool) -> vec2f {
    let at = select(0u, neighbour.y * view.width + neighbour.x, inside);
    let other = g_normal[at];
    let step = floats(g_position[at]) - p;
    let far = max(length(step), 1e-30);
    let both = vec2f(dot(step, view.backward), min(length(floats(other) - n) / far, FAR));
    return select(vec2f(0.0), both, inside && other.w == SURFACE);
}

// Slope and curvature at a pixel.
fn steepness(pixel: vec2u, p: vec3f, n: vec3f) -> vec2f {
    let right = change(p, n, pixel + vec2u(1u, 0u), pixel.x + 1u < view.width);
    let below = change(p, n, pixel + vec2u(0u, 1u), pixel.y + 1u < view.height);
    let width = pyramid.pixel_width * max(depth_of(p), 1e-30);
    return vec2f(length(vec2f(right.x, below.x)) / width, length(vec2f(right.y, below.y)));
}

// Row of a texel: only levels from 1 on are stored.
fn slot(number: u32) -> u32 {
    return number - pyramid.levels[1].z;
}

@compute @workgroup_size(64)
fn base(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let texel = texel_of(pyramid.levels[1], i);
    var count = 0u;
    var position = vec3f(0.0);
    var normal = vec3f(0.0);
    var geometric = vec3f(0.0);
    var steepest = vec2f(0.0);
    var lo = vec4f(FAR);
    var hi = vec4f(-FAR);
    for (var k = 0u; k < 4u; k++) {
        let pixel = 2u * texel + vec2u(k & 1u, k >> 1u);
        let inside = all(pixel < vec2u(view.width, view.height));
        let at = select(0u, pixel.y * view.width + pixel.x, inside);
        let row = g_normal[at];
        if !inside || row.w != SURFACE {
            continue;
        }
        let p = floats(g_position[at]);
        let n = floats(row);
        count++;
        position += p;
        normal += n;
        geometric += floats(g_geometric[at]);
        if STEEPNESS {
            steepest = max(steepest, steepness(pixel, p, n));
        }
        lo = min(lo, vec4f(n, depth_of(p)));
        hi = max(hi, vec4f(n, depth_of(p)));
    }
    let share = 1.0 / f32(max(count, 1u));
    means[3u * i] = words(position * share, count);
    means[3u * i + 1u] = words(normal * share, bitcast<u32>(steepest.y));
    means[3u * i + 2u] = words(geometric * share, bitcast<u32>(steepest.x));
    ranges[2u * i] = lo;
    ranges[2u * i + 1u] = hi;
}

@compute @workgroup_size(64)
fn reduce(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let below = pyramid.levels[pyramid.level - 1u];
    let texel = texel_of(pyramid.levels[pyramid.level], i);
    var count = 0u;
    var position = vec3f(0.0);
    var normal = vec3f(0.0);
    var geometric = vec3f(0.0);
    var steepest = vec2f(0.0);
    var lo = vec4f(FAR);
    var hi = vec4f(-FAR);
    for (var k = 0u; k < 4u; k++) {
        let child = 2u * texel + vec2u(k & 1u, k >> 1u);
        if any(child >= below.xy) {
            continue;
        }
        let at = slot(texel_number(below, child));
        let middle = means[3u * at];
        let shading = means[3u * at + 1u];
        let across = means[3u * at + 2u];
        let pixels = f32(middle.w);
        count += middle.w;
        position += pixels * floats(middle);
        normal += pixels * floats(shading);
        geometric += pixels * floats(across);
        steepest = max(steepest, vec2f(bitcast<f32>(across.w), bitcast<f32>(shading.w)));
        lo = min(lo, ranges[2u * at]);
        hi = max(hi, ranges[2u * at + 1u]);
    }
    let share = 1.0 / f32(max(count, 1u));
    let at = slot(texel_number(pyramid.levels[pyramid.level], texel));
    means[3u * at] = words(position * share, count);
    means[3u * at + 1u] = words(normal * share, bitcast<u32>(steepest.y));
    means[3u * at + 2u] = words(geometric * share, bitcast<u32>(steepest.x));
    ranges[2u * at] = lo;
    ranges[2u * at + 1u] = hi;
}

// A texel's mean position, its mean normals (zero where they cancel), and its width.
struct Plane {
    middle: vec3f,
    normal: vec3f,
    across: vec3f,
    width: f32,
}

fn direction(v: vec3f) -> vec3f {
    return select(vec3f(0.0), v / max(length(v), NO_NORMAL), length(v) > NO_NORMAL);
}

fn plane_of(at: u32, level: u32) -> Plane {
    let middle = floats(means[3u * at]);
    let width = f32(1u << level) * pyramid.pixel_width * max(depth_of(middle), 1e-30);
    return Plane(middle, direction(floats(means[3u * at + 1u])), direction(floats(means[3u * at + 2u])), width);
}

// Distance of a pixel to the plane over its width, and 1 - cosine to the normal; the most possible without a direction.
fn apart(plane: Plane, position: vec4u, normal: vec4u, seen: bool) -> vec2f {
    let offset = floats(position) - plane.middle;
    let distance = select(length(offset), abs(dot(plane.across, offset)), any(plane.across != vec3f(0.0)));
    let angle = select(2.0, max(1.0 - dot(plane.normal, floats(normal)), 0.0), any(plane.normal != vec3f(0.0)));
    return select(vec2f(0.0), vec2f(distance / plane.width, angle), seen);
}

@compute @workgroup_size(64)
fn deviations(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let first = texel_of(pyramid.levels[1], i);
    let x = vec4u(2u * first.x) + vec4u(0u, 1u, 0u, 1u);
    let y = vec4u(2u * first.y) + vec4u(0u, 0u, 1u, 1u);
    let inside = (x < vec4u(view.width)) & (y < vec4u(view.height));
    let pixels = select(vec4u(0u), y * view.width + x, inside);
    // Read once for all levels.
    let p0 = g_position[pixels.x];
    let p1 = g_position[pixels.y];
    let p2 = g_position[pixels.z];
    let p3 = g_position[pixels.w];
    let n0 = g_normal[pixels.x];
    let n1 = g_normal[pixels.y];
    let n2 = g_normal[pixels.z];
    let n3 = g_normal[pixels.w];
    let seen = inside & (vec4u(n0.w, n1.w, n2.w, n3.w) == vec4u(SURFACE));
    if !any(seen) {
        return;
    }
    for (var level = 1u; level <= pyramid.coarsest; level++) {
        let at = slot(texel_number(pyramid.levels[level], first >> vec2u(level - 1u)));
        let plane = plane_of(at, level);
        let most = max(
            max(apart(plane, p0, n0, seen.x), apart(plane, p1, n1, seen.y)),
            max(apart(plane, p2, n2, seen.z), apart(plane, p3, n3, seen.w)));
        // The bits of floats that are not negative are in their order.
        atomicMax(&spreads[2u * at], bitcast<u32>(most.x));
        atomicMax(&spreads[2u * at + 1u], bitcast<u32>(most.y));
    }
}
