// Whether two shading points lie on one surface: near each other's tangent plane, normals alike.

import package::common::ray::Receiver;

// Nothing is shared from this distance to the plane on, over the width of a fragment,
const MOST_OFF: f32 = 0.5;
// and from this difference of unit normals on: 41 degrees.
const MOST_TURNED: f32 = 0.7;

// `width`: of a fragment there, scene units.
fn alike(one: Receiver, other: Receiver, width: f32) -> bool {
    let off = abs(dot(one.normal_geo, other.origin - one.origin));
    return off <= MOST_OFF * width && length(other.normal_shade - one.normal_shade) < MOST_TURNED;
}
