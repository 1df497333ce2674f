// Irradiance from a virtual light: as a point, as a disc [WEH89; NSW09 Eq. 1], or near it as the quadrilateral of its
// texels, exact. Records come as the first three rows of VirtualLight.
//   E = flux cos_i cos_j / (pi d^2 + A)      [NSW09 Eqs. 1, 5; Deviation: divided by the emitter's area, which the text
// leaves out, so that flux, not flux times area, lights a surface; a point has A = 0: NW09 Sec. 3.4 with unit vectors]
// Deviation: cos_j of a cluster of surfaces that face different ways is the mean of theirs, `emission`.

import package::common::basis::PI;
import package::common::polygon::{Polygon, clip, contour};
import package::common::rsm::{RsmMap, rsm_direction, rsm_origin, rsm_tile};

const POINT: u32 = 0u;
const DISC: u32 = 1u;
const QUAD: u32 = 2u;
// What is nearer than so many of its radii is taken for a quadrilateral; beyond, a point is as good, and a disc too dark.
const NEAR_RADII: f32 = 4.0;
// A mean of unit normals this long is one of equal ones, but for rounding; a shorter one than that no quadrilateral's.
const ALL_ALIKE: f32 = 0.99999;
const NEARLY_ALIKE: f32 = 0.95;
// Patches seen more obliquely by the light have no quadrilateral.
const LEAST_SLOPE: f32 = 0.02;

// Whether the normal of a virtual light may be a mean of normals that differ, which is shorter than 1.
override MIXED: bool = true;

// Where light arrives.
struct Lit {
    position: vec3f,
    normal_shade: vec3f,
    normal_geo: vec3f,
}

fn mean_of(v: vec3f) -> f32 {
    return (v.x + v.y + v.z) / 3.0;
}

// The clamped cosine up to its fourth band [RH01]. Normals that lie about their mean as heat spreads on a sphere leave of
// band l the power l (l + 1) / 2 of the mean's length [HSRG07].
fn bands(x: f32, alike: f32) -> f32 {
    let x2 = x * x;
    let third = alike * alike * alike;
    let tenth = third * third * third * alike;
    return 0.25 + 0.5 * alike * x + 0.3125 * third * (1.5 * x2 - 0.5)
        - 0.09375 * tenth * ((4.375 * x2 - 3.75) * x2 + 0.375);
}

// Mean of the clamped cosines of many normals, `x` the cosine of their mean and `alike` its length; the bands beyond the
// fourth like the sixth.
fn emission(x: f32, alike: f32) -> f32 {
    let third = alike * alike * alike;
    let sixth = pow(third, 7.0);
    let mean = max(bands(x, alike) + sixth * (max(x, 0.0) - bands(x, 1.0)), 0.0);
    return select(mean, max(x, 0.0), alike > ALL_ALIKE);
}

fn unit_normal(facing: vec4f) -> vec3f {
    return facing.xyz * inverseSqrt(max(dot(facing.xyz, facing.xyz), 1e-37));
}

// As a point, or as a disc; zero where either cosine, or that to the geometric normal, is not positive, and beyond `reach`.
fn disc_irradiance(at: Lit, place: vec4f, facing: vec4f, flux: vec3f, disc: bool, reach: f32) -> vec3f {
    let d = place.xyz - at.position;
    let d2 = dot(d, d);
    let w = d * inverseSqrt(max(d2, 1e-37));
    let cos_i = dot(at.normal_shade, w);
    var cos_j = -dot(facing.xyz, w);
    if MIXED {
        let alike = length(facing.xyz);
        cos_j = emission(cos_j / max(alike, 1e-30), alike);
    }
    let lit = (cos_i > 0.0) & (cos_j > 0.0) & (dot(at.normal_geo, w) > 0.0) & (d2 < reach * reach);
    let share = cos_i * cos_j / max(PI * d2 + select(0.0, place.w, disc), 1e-37);
    return flux * select(0.0, share, lit);
}

// The same, at most what a unit of flux may give: a cluster's mean gives no more than any of its surfaces may.
fn limited_irradiance(
    at: Lit, place: vec4f, facing: vec4f, flux: vec3f, disc: bool, reach: f32, most: f32,
) -> vec3f {
    let share = disc_irradiance(at, place, facing, vec3f(1.0), disc, reach).x;
    return flux * min(share, most);
}

fn is_near(at: Lit, place: vec4f, facing: vec4f) -> bool {
    let d = place.xyz - at.position;
    let reach = NEAR_RADII * facing.w;
    return dot(d, d) < reach * reach;
}

// The quadrilateral in the light's tangent plane whose corners the light sees where those of its block of texels are;
// relative to the lit point. No corners where the light sees the plane too obliquely, its surfaces
// face different ways, or there is no block.
fn patch_of(at: Lit, place: vec3f, facing: vec4f, map: RsmMap, block: u32, extent: u32) -> Polygon {
    let size = f32(map.resolution);
    let first = vec2f(vec2u(block & 0xffffu, block >> 16u)) / size;
    let width = f32(extent & 0xffffu) / size;
    let tile = rsm_tile(map, first + 0.5 * width);
    let origin = rsm_origin(map, tile);
    let normal = unit_normal(facing);
    let height = dot(normal, place - origin);
    var polygon: Polygon;
    polygon.count = select(4u, 0u, width == 0.0 || length(facing.xyz) < NEARLY_ALIKE);
    for (var k = 0u; k < 4u; k++) {
        let corner = vec2f(f32((k ^ (k >> 1u)) & 1u), f32(k >> 1u));
        let direction = rsm_direction(map, tile, first + width * corner);
        let slope = dot(normal, direction);
        polygon.corners[k] = origin + direction * (height / min(slope, -LEAST_SLOPE)) - at.position;
        polygon.count = select(polygon.count, 0u, slope > -LEAST_SLOPE);
    }
    return polygon;
}

// Twice the vector area.
fn spread_of(p: Polygon) -> f32 {
    return length(cross(p.corners[2] - p.corners[0], p.corners[3] - p.corners[1]));
}

// As a quadrilateral that reflects `flux` evenly; what lies below either horizon of the lit point gives nothing.
fn quad_irradiance(at: Lit, place: vec4f, facing: vec4f, flux: vec3f, polygon: Polygon) -> vec3f {
    let area = 0.5 * spread_of(polygon);
    let front = dot(facing.xyz, at.position - place.xyz) > 0.0;
    let cut = clip(clip(polygon, at.normal_shade), at.normal_geo);
    return flux * select(0.0, contour(at.normal_shade, cut) / (PI * max(area, 1e-37)), front);
}
