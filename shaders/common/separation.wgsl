// Separation: what can lie between a box of points and a light, in the light's affine coordinates a, b, h.
// The light is a box of its own, [0, extent_a] x [0, extent_b] at h = 0. Segments between the boxes fill their convex
// hull, whose cross-section at s is (1 - s) from + s to.

// Shadow rays end here on their way to the light; what is nearer to it blocks none.
const T_MAX: f32 = 0.9999;
// A plane's normal is known to this share of the slack of its corners, which is generous.
const NORMAL_SHARE: f32 = 0.0625;

struct Box {
    lo: vec3f,
    hi: vec3f,
}

// Three corners in the light's coordinates, and what rounding may have moved each by.
struct Corners {
    a: vec3f,
    b: vec3f,
    c: vec3f,
    slack: vec3f,
}

struct Plane {
    corner: vec3f,
    normal: vec3f,
    slack: f32,     // height that the slack of a point makes
    doubt: vec3f,   // of the normal
}

fn largest(v: vec3f) -> f32 {
    return max(max(v.x, v.y), v.z);
}

fn smallest(v: vec3f) -> f32 {
    return min(min(v.x, v.y), v.z);
}

// True when a cross-section of the hull meets a box: each of the six conditions is linear in s.
fn hull_meets(start: Box, end: Box, margin: vec3f, at: Box) -> bool {
    let flat = margin / 1024.0 + 1e-30;
    let up = end.hi - start.hi;
    let low = end.lo - start.lo;
    let way_hi = select(up, flat, abs(up) < flat);
    let way_lo = select(low, flat, abs(low) < flat);
    let hi = (at.lo - margin - start.hi) / way_hi;
    let lo = (at.hi + margin - start.lo) / way_lo;
    let none = vec3f(0.0);
    let all = vec3f(1.000001 * T_MAX);
    let enter = max(largest(select(none, hi, way_hi > none)), largest(select(none, lo, way_lo < none)));
    let leave = min(smallest(select(all, hi, way_hi < none)), smallest(select(all, lo, way_lo > none)));
    return max(enter, 0.0) <= min(leave, all.x);
}

fn plane_of(t: Corners) -> Plane {
    let e = t.b - t.a;
    let f = t.c - t.a;
    let normal = cross(e, f);
    let spread = (abs(e) + abs(f)) * NORMAL_SHARE;
    let doubt = t.slack.yzx * spread.zxy + t.slack.zxy * spread.yzx;
    return Plane(t.a, normal, dot(abs(normal), t.slack), doubt);
}

// Least and largest height of a box over a plane, and the doubt about them beyond the slack.
fn box_heights(plane: Plane, b: Box) -> vec3f {
    let half = 0.5 * (b.hi - b.lo);
    let d = b.lo + half - plane.corner;
    let at = dot(plane.normal, d);
    let spread = dot(abs(plane.normal), half);
    return vec3f(at - spread, at + spread, dot(plane.doubt, abs(d) + half));
}

// True when the plane has both on one side, or on it: a rounding below counts as on it.
fn one_side(plane: Plane, tile: vec3f, light: vec3f) -> bool {
    let above = min(tile.x - tile.z, light.x - light.z) + plane.slack >= 0.0;
    let below = max(tile.y + tile.z, light.y + light.z) - plane.slack <= 0.0;
    return above || below;
}

// True when the triangle lies below the tangent plane of a pixel, or on it.
fn under_horizon(t: Corners, origin: vec3f, normal: vec3f) -> bool {
    let over = vec3f(dot(normal, t.a - origin), dot(normal, t.b - origin), dot(normal, t.c - origin));
    return largest(over) <= dot(abs(normal), t.slack);
}

// True when the triangle lies outside of one side of the pyramid from a pixel to the light, above or below it.
fn beside_pyramid(t: Corners, origin: vec3f, extent: vec2f) -> bool {
    let h = origin.z;
    let heights = vec3f(t.a.z, t.b.z, t.c.z);
    let reach_h = largest(abs(heights)) + abs(h);
    var found = largest(heights) + t.slack.z < (1.0 - T_MAX) * h || h + t.slack.z < smallest(heights);
    for (var axis = 0u; axis < 2u; axis++) {
        let place = vec3f(t.a[axis], t.b[axis], t.c[axis]);
        let far = largest(abs(place)) + abs(origin[axis]) + extent[axis];
        let doubt = t.slack[axis] * reach_h + t.slack.z * far;
        // A point of a segment has a h0 - a0 h between 0 and extent (h0 - h).
        let left = place * h - origin[axis] * heights;
        let right = extent[axis] * (vec3f(h) - heights) - left;
        found = found || largest(left) < -doubt || largest(right) < -doubt;
    }
    return found && h > t.slack.z;
}

// Largest determinant of vectors of these sizes.
fn permanent(a: vec3f, b: vec3f, c: vec3f) -> f32 {
    return dot(a, b.yzx * c.zxy + b.zxy * c.yzx);
}

fn box_corner(b: Box, which: u32) -> vec3f {
    return select(b.lo, b.hi, ((vec3u(which) >> vec3u(0u, 1u, 2u)) & vec3u(1u)) != vec3u(0u));
}

// True when every segment from the box to the light crosses the triangle: its ends lie on both sides of the plane, and
// it passes the three edges on one side; both are linear in each end, so the corners decide.
fn hides(t: Corners, start: Box, end: Box) -> bool {
    let reach = max(max(t.a, t.b), max(t.c, max(start.hi, end.hi))) - min(min(t.a, t.b), min(t.c, min(start.lo, end.lo)));
    let plane = plane_of(t);
    let tile = box_heights(plane, start);
    let light = box_heights(plane, end);
    let doubt = 4.0 * permanent(reach, max(abs(t.b - t.a), abs(t.c - t.a)), t.slack);
    let ahead = tile.x > 0.0;
    let near = select(-tile.y, tile.x, ahead);
    let far = select(light.x, -light.y, ahead);
    let way = select(light.y - tile.x, tile.y - light.x, ahead);
    // Beyond the end of the rays nothing hides.
    if !(near > doubt && far > doubt + 3.0 * (1.0 - T_MAX) * way) {
        return false;
    }
    let edge_doubt = 4.0 * permanent(reach, reach, t.slack);
    for (var k = 0u; k < 32u; k++) {
        let o = box_corner(start, k / 4u);
        let d = select(1.0, -1.0, ahead) * (box_corner(end, k % 4u) - o);
        let past = vec3f(
            dot(cross(t.a - o, t.b - o), d),
            dot(cross(t.b - o, t.c - o), d),
            dot(cross(t.c - o, t.a - o), d),
        );
        if !(smallest(past) > edge_doubt) {
            return false;
        }
    }
    return true;
}
