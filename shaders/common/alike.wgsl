// Whether two shading points lie on one surface: near each other's tangent plane, normals alike.

import package::common::ray::Receiver;

// Nothing is shared from this slope on between two points, 30 degrees over the tangent plane,
const STEEPEST: f32 = 0.5;
// and from this difference of unit normals on: 41 degrees.
const MOST_TURNED: f32 = 0.7;

fn alike(one: Receiver, other: Receiver) -> bool {
    let step = other.origin - one.origin;
    let off = abs(dot(one.normal_geo, step));
    return off <= STEEPEST * length(step) && length(other.normal_shade - one.normal_shade) < MOST_TURNED;
}
