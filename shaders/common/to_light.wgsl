// Affine maps of nodes and triangles into a light's own coordinates, with a bound of what rounding does to them.

import package::common::bvh::{Node, Triangle};
import package::common::separation::{Box, Corners};

// Rounding of a coordinate as a share of the largest term in it: 16 units in the last place.
const ROUNDING: f32 = 9.5367431640625e-7;

// An affine map into the light's coordinates: rows, offset, and a bound of what rounding does.
struct ToLight {
    rows: mat3x3f,  // a column is a row of the map
    at: vec3f,
    slack: vec3f,
}

fn size(v: vec3f) -> f32 {
    return dot(abs(v), vec3f(1.0));
}

// The transposed inverse: of rows the columns of the inverse.
fn dual(m: mat3x3f) -> mat3x3f {
    let x = cross(m[1], m[2]);
    let y = cross(m[2], m[0]);
    let z = cross(m[0], m[1]);
    return mat3x3f(x, y, z) * (1.0 / dot(m[0], x));
}

// From a space with origin `center` (seen from the light's corner) and these columns, reaching `reach`.
fn to_light(rows: mat3x3f, columns: mat3x3f, center: vec3f, reach: f32, far: f32) -> ToLight {
    let turned = mat3x3f(rows[0] * columns, rows[1] * columns, rows[2] * columns);
    let own = vec3f(size(turned[0]), size(turned[1]), size(turned[2]));
    let whole = vec3f(size(rows[0]), size(rows[1]), size(rows[2]));
    return ToLight(turned, center * rows, ROUNDING * (own * reach + whole * far));
}

fn place(map: ToLight, p: vec3f) -> vec3f {
    return p * map.rows + map.at;
}

fn box_in_light(map: ToLight, node: Node) -> Box {
    let half = 0.5 * (node.hi - node.lo);
    let middle = place(map, node.lo + half);
    let reach = half * mat3x3f(abs(map.rows[0]), abs(map.rows[1]), abs(map.rows[2]));
    return Box(middle - reach, middle + reach);
}

fn corners_in_light(map: ToLight, t: Triangle) -> Corners {
    return Corners(place(map, t.a), place(map, t.b), place(map, t.c), map.slack);
}
