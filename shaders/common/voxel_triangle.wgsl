// A triangle before the camera: the cells of the voxel grid that it may touch, and its depths within one of them.

import package::common::voxels::{Voxels, cell_at, cell_place};

// Share by which a triangle is wider than it is, so that rounding leaves no crack between neighbours.
const CRACK: f32 = 1e-5;

// Corners along the camera's axes, normals of the planes through the eye and each edge, and the cells to look at.
struct Triangle {
    corner: array<vec3f, 3>,
    side: array<vec3f, 3>,  // opposite corner i
    volume: f32,
    lo: vec2u,
    hi: vec2u,
    empty: bool,
}

// The part of the segment p + t e, t in 0..1, between the planes before and behind: x the first t, y the last.
fn clip(range: vec2f, at_start: f32, slope: f32) -> vec2f {
    if slope == 0.0 {
        return select(vec2f(1.0, 0.0), range, at_start >= 0.0);
    }
    let t = -at_start / slope;
    return select(vec2f(range.x, min(range.y, t)), vec2f(max(range.x, t), range.y), slope > 0.0);
}

// `corner` along the camera's axes.
fn eye_triangle(voxels: Voxels, corner: array<vec3f, 3>) -> Triangle {
    var t: Triangle;
    t.corner = corner;
    var lo = vec2f(1e30);
    var hi = vec2f(-1e30);
    for (var i = 0u; i < 3u; i++) {
        let p = t.corner[i];
        let e = t.corner[(i + 1u) % 3u] - p;
        // By the edge, which is exact where the corners are near each other.
        t.side[(i + 2u) % 3u] = cross(p, e);
        let range = clip(vec2f(0.0, 1.0), p.z - voxels.near, e.z);
        if range.x <= range.y {
            // Exactly in front, so that no rounding turns a place over.
            let a = p + range.x * e;
            let b = p + range.y * e;
            let start = cell_place(voxels, vec3f(a.xy, max(a.z, voxels.near)));
            let end = cell_place(voxels, vec3f(b.xy, max(b.z, voxels.near)));
            lo = min(lo, min(start, end));
            hi = max(hi, max(start, end));
        }
    }
    t.volume = dot(t.corner[0] - t.corner[1], t.side[0]);
    let size = vec2f(f32(voxels.columns), f32(voxels.rows));
    // Cells whose middles the bounds hold, and a little more.
    lo = floor(lo + 0.499);
    hi = floor(hi - 0.499);
    t.empty = !(all(hi >= vec2f(0.0)) && all(lo < size) && all(lo <= hi));
    t.lo = cell_at(voxels, clamp(lo, vec2f(0.0), size));
    t.hi = cell_at(voxels, clamp(hi, vec2f(0.0), size));
    return t;
}

// Weights of the corners where a ray from the eye, (x, y, 1) along the camera's axes, meets the triangle's plane; not
// normalised: depth = |volume| / their sum.
fn weights_at(t: Triangle, ray: vec3f) -> vec3f {
    return vec3f(dot(t.side[0], ray), dot(t.side[1], ray), dot(t.side[2], ray)) * sign(t.volume);
}

// Least and largest depth inside a cell of the plane of a triangle that covers the cell's middle, no farther than the
// triangle reaches; the first above the second where it does not cover it. The plane, so that where two triangles meet
// within a cell none of their slices is left out.
fn depths_in(voxels: Voxels, t: Triangle, cell: vec2u) -> vec2f {
    let lo = vec2f(cell) - voxels.center;
    let at_middle = weights_at(t, vec3f((lo + 0.5) / voxels.scale, 1.0));
    let weight = at_middle.x + at_middle.y + at_middle.z;
    if !(weight > 0.0) || any(at_middle < vec3f(-CRACK * weight)) {
        return vec2f(1.0, 0.0);
    }
    let nearest = min(t.corner[0].z, min(t.corner[1].z, t.corner[2].z));
    let farthest = max(t.corner[0].z, max(t.corner[1].z, t.corner[2].z));
    let middle = clamp(abs(t.volume) / weight, nearest, farthest);
    var depths = vec2f(middle);
    for (var i = 0u; i < 4u; i++) {
        let place = lo + vec2f(f32(i & 1u), f32(i >> 1u));
        let weights = weights_at(t, vec3f(place / voxels.scale, 1.0));
        let sum = weights.x + weights.y + weights.z;
        // Where the sum is not above 0 the plane is not met before infinity.
        let depth = clamp(select(farthest, abs(t.volume) / sum, sum > 0.0), nearest, farthest);
        depths = vec2f(min(depths.x, depth), max(depths.y, depth));
    }
    let seen = depths.y >= voxels.near && depths.x <= voxels.far;
    return select(vec2f(1.0, 0.0), depths, seen);
}
