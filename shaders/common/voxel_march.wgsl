// A segment through the voxels: where it begins and ends, and its way over the image.
// What lies outside of the grid hides nothing, nor do voxels near the start that the segment has not left since it began:
// they hold its own surface, or one that meets it in a corner [Deviation: the paper's bias alone leaves dark corners].

import package::common::voxel_triangle::clip;
import package::common::voxels::{Voxels, cell_place, eye_direction, eye_space};

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

// A segment on the image, where all is straight as well: at share s of it the place is place + s step, 1 / depth is
// near + s slope. The slope of a plane of depth-free normal n, n (x/z, y/z, 1), is plane + s turn, for both ends' surfaces.
struct Path {
    place: vec2f,
    step: vec2f,
    near: f32,
    slope: f32,
    plane: vec2f,
    turn: vec2f,
    leave: f32,         // share within which it may leave what it started in
}

fn path_of(s: Segment) -> Path {
    let a = s.start + s.range.x * s.along;
    let b = s.start + s.range.y * s.along;
    let place = cell_place(voxels, a);
    let near = 1.0 / a.z;
    let plane = vec2f(dot(s.planes[0].xyz, a), dot(s.planes[1].xyz, a)) * near;
    let end = vec2f(dot(s.planes[0].xyz, b), dot(s.planes[1].xyz, b)) / b.z;
    let far = length(s.along);
    // Lengths along the ray to shares of its image: that of z is the inverse.
    let leave = LEAVE * voxel_width(s.start, s.along / far) / far - s.range.x;
    let share = clamp(leave / (s.range.y - s.range.x), 0.0, 1.0);
    return Path(
        place, cell_place(voxels, b) - place, near, 1.0 / b.z - near, plane, end - plane, share * b.z / mix(a.z, b.z, share));
}

// The part of the depths x..y that lies above a surface, by as much as the ray's ends do: what is below the tangent plane
// of its own end hides nothing from a ray, however far a step looks. `slope` is that of the plane there, `middle` a depth.
fn above(plane: vec4f, slope: f32, middle: f32, depths: vec2f) -> vec2f {
    let across = abs(plane.x) / voxels.scale.x + abs(plane.y) / voxels.scale.y;
    let width = abs(slope) / voxels.slices_per_depth + middle * across;
    let limit = (plane.w + voxels.bias * width) / slope;
    let cut = select(vec2f(depths.x, min(depths.y, limit)), vec2f(max(depths.x, limit), depths.y), slope > 0.0);
    return select(cut, depths, slope == 0.0);
}
