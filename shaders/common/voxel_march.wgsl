// A segment through the voxels: where it begins and ends, and whether it meets a voxel in between.
// What lies outside of the grid hides nothing, nor do voxels near the start that the segment has not left since it began:
// they hold its own surface, or one that meets it in a corner [Deviation: the paper's bias alone leaves dark corners].

import package::common::voxel_triangle::clip;
import package::common::voxels::{Voxels, cell_at, cell_place, eye_direction, eye_space, slice_at, word_mask};

// Slices that are looked at ahead of each step: the thick ray of [NPW10 Sec. 3.3.1]. None behind, where the ray has
// just left a surface.
const THICK: f32 = 1.0;
// Voxels, along the ray, from which on it must have left what it started in.
const LEAVE: f32 = 2.0;

@group(0) @binding(8) var<uniform> voxels: Voxels;
@group(0) @binding(9) var<storage, read> voxel_bits: array<u32>;

// p = start + t along; inside of the grid for t in range.x..range.y.
struct Segment {
    start: vec3f,
    along: vec3f,
    range: vec2f,
    planes: array<vec4f, 2>,    // normal and offset of the surfaces at both ends
}

// Width of a voxel at `q` in direction `n`, both along the camera's axes: no point of a voxel that touches a plane of
// this normal is farther from it.
fn voxel_width(q: vec3f, n: vec3f) -> f32 {
    let depth = max(q.z, voxels.near);
    let slice = abs(dot(n, vec3f(q.xy / depth, 1.0))) / voxels.slices_per_depth;
    return slice + depth * (abs(n.x) / voxels.scale.x + abs(n.y) / voxels.scale.y);
}

// Both ends moved off their surfaces; `n` and `m` are the unit normals there, in scene space, `m` towards the receiver.
fn segment_of(origin: vec3f, n: vec3f, point: vec3f, m: vec3f) -> Segment {
    let foot = eye_space(voxels, origin);
    let tip = eye_space(voxels, point);
    let n_eye = eye_direction(voxels, n);
    let m_eye = eye_direction(voxels, m);
    let start = foot + n_eye * (voxels.bias * voxel_width(foot, n_eye));
    let along = tip + m_eye * (voxels.bias * voxel_width(tip, m_eye)) - start;
    // Nearer than two biases: nothing is left to march through.
    var range = select(vec2f(1.0, 0.0), vec2f(0.0, 1.0), dot(along, tip - foot) > 0.0);
    let place = voxels.scale * start.xy + voxels.center * start.z;
    let slope = voxels.scale * along.xy + voxels.center * along.z;
    let size = vec2f(f32(voxels.columns), f32(voxels.rows));
    range = clip(range, start.z - voxels.near, along.z);
    range = clip(range, voxels.far - start.z, -along.z);
    range = clip(range, place.x, slope.x);
    range = clip(range, size.x * start.z - place.x, size.x * along.z - slope.x);
    range = clip(range, place.y, slope.y);
    range = clip(range, size.y * start.z - place.y, size.y * along.z - slope.y);
    return Segment(start, along, range, array(vec4f(n_eye, dot(n_eye, foot)), vec4f(m_eye, dot(m_eye, tip))));
}

// The part of the depths x..y along the eye ray through `q` that lies above a surface, by as much as the ray's ends do.
// What is below the tangent plane of its own end hides nothing from a ray, however far a step looks.
fn above(plane: vec4f, q: vec3f, depths: vec2f) -> vec2f {
    let slope = dot(plane.xyz, q) / q.z;
    let limit = (plane.w + voxels.bias * voxel_width(q, plane.xyz)) / slope;
    let cut = select(vec2f(depths.x, min(depths.y, limit)), vec2f(max(depths.x, limit), depths.y), slope > 0.0);
    return select(cut, depths, slope == 0.0);
}

// Any voxel of a cell between two depths.
fn filled(cell: vec2u, z0: f32, z1: f32) -> bool {
    let first = slice_at(voxels, min(z0, z1));
    let last = slice_at(voxels, max(z0, z1));
    let at = (cell.y * voxels.columns + cell.x) * voxels.words;
    var found = 0u;
    for (var word = first / 32u; word <= last / 32u; word++) {
        found |= voxel_bits[at + word] & word_mask(word, first, last);
    }
    return found != 0u;
}

// Share of the segment within which it may leave what it started in.
fn leave_until(s: Segment) -> f32 {
    let far = length(s.along);
    return LEAVE * voxel_width(s.start, s.along / far) / far;
}

// In equal steps: the cell in the middle of each, all depths that the step spans.
fn meets_in_steps(s: Segment) -> bool {
    if s.range.x >= s.range.y {
        return false;
    }
    let step = (s.range.y - s.range.x) / f32(voxels.steps);
    let thick = select(-THICK, THICK, s.along.z > 0.0) / voxels.slices_per_depth;
    var leaving = true;
    let leave = leave_until(s);
    for (var k = 0u; k < voxels.steps; k++) {
        let t = s.range.x + (f32(k) + 0.5) * step;
        let q = s.start + t * s.along;
        let ends = q.z + vec2f(-0.5, 0.5) * step * s.along.z + vec2f(0.0, thick);
        var depths = vec2f(min(ends.x, ends.y), max(ends.x, ends.y));
        depths = above(s.planes[1], q, above(s.planes[0], q, depths));
        if depths.x <= depths.y && filled(cell_at(voxels, cell_place(voxels, q)), depths.x, depths.y) {
            if !leaving || t > leave {
                return true;
            }
        } else {
            leaving = false;
        }
    }
    return false;
}

// Where the segment leaves a cell on its way (1 or -1) along one axis, through the side `side` (columns or rows from the
// grid's corner); never where its direction in space does not get there before infinity.
fn leaves_at(start: f32, along: f32, start_z: f32, along_z: f32, side: f32, way: i32) -> f32 {
    let slope = along - side * along_z;
    return select(1e30, (side * start_z - start) / slope, slope * f32(way) > 0.0);
}

// Every voxel that the segment crosses: cell by cell, all depths between entering and leaving [AW87].
fn meets_by_voxels(s: Segment) -> bool {
    if s.range.x >= s.range.y {
        return false;
    }
    let place = voxels.scale * s.start.xy + voxels.center * s.start.z;
    let slope = voxels.scale * s.along.xy + voxels.center * s.along.z;
    // The sign of the derivative of place / z, the same everywhere before the eye.
    let turn = slope * s.start.z - place * s.along.z;
    let way = vec2i(sign(turn));
    let size = vec2i(i32(voxels.columns), i32(voxels.rows));
    var t = s.range.x;
    var cell = vec2i(cell_at(voxels, cell_place(voxels, s.start + t * s.along)));
    var leaving = true;
    let leave = leave_until(s);
    for (var left = size.x + size.y + 1; left > 0; left--) {
        let side = vec2f(cell + max(way, vec2i(0)));
        let exit = vec2f(
            leaves_at(place.x, slope.x, s.start.z, s.along.z, side.x, way.x),
            leaves_at(place.y, slope.y, s.start.z, s.along.z, side.y, way.y),
        );
        // What may be left is looked at apart from what follows it in the same cell.
        let whole = clamp(min(exit.x, exit.y), t, s.range.y);
        let next = select(whole, leave, t < leave && leave < whole);
        if filled(vec2u(cell), s.start.z + t * s.along.z, s.start.z + next * s.along.z) {
            if !leaving || t >= leave {
                return true;
            }
        } else {
            leaving = false;
        }
        t = next;
        if next < whole {
            continue;
        }
        cell += select(vec2i(0, way.y), vec2i(way.x, 0), exit.x < exit.y);
        if min(exit.x, exit.y) >= s.range.y || any(cell < vec2i(0)) || any(cell >= size) {
            return false;
        }
    }
    return false;
}
