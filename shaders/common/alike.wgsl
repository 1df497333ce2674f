// Whether two shading points lie on one surface: near each other's tangent plane, normals alike.

import package::common::ray::Receiver;

// Nothing is shared from this slope on between two points, 30 degrees over the tangent plane,
const STEEPEST: f32 = 0.5;
// and from this difference of unit normals on: 41 degrees.
const MOST_TURNED: f32 = 0.7;

// From 1 to 0 where `square`, that of a share, reaches 1.
fn fade(square: f32) -> f32 {
    let left = max(1.0 - square, 0.0);
    return left * left;
}

fn alike(one: Receiver, other: Receiver) -> bool {
    let step = other.origin - one.origin;
    let off = abs(dot(one.normal_geo, step));
    return off <= STEEPEST * length(step) && length(other.normal_shade - one.normal_shade) < MOST_TURNED;
}
