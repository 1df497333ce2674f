// Irradiance of a parallelogram of unit radiance, exact, clipped by the receiver's horizons.
// Near the light by its contour [Lam60; Arv95], E = 1/2 sum_i theta_i n . (v_i x v_{i+1}) / |v_i x v_{i+1}|, whose terms
// cancel more and more with distance; there by Gauss-Legendre quadrature (N3). Either form holds about 1e-5 in float32.

// Distance in light sizes from which on 3 x 3 Gauss points are more exact than the contour.
const FAR_SIZES: f32 = 5.0;
const GAUSS: f32 = 0.774596669;
// A quadrilateral cut by two planes has six corners at most.
const MOST_CORNERS: u32 = 6u;

struct Polygon {
    corners: array<vec3f, 6>,
    count: u32,
}

// One edge of the contour. The cross product is taken with the edge itself: v_i x v_{i+1} = v_i x (v_{i+1} - v_i), whose
// rounding does not grow with distance as the other's does.
fn edge_term(n: vec3f, a: vec3f, b: vec3f) -> f32 {
    let c = cross(a, b - a);
    let s = length(c);
    return select(0.0, atan2(s, dot(a, b)) / s * dot(n, c), s > 0.0);
}

// The part of the polygon on the side that n points to (Sutherland-Hodgman) (N4).
fn clip(polygon: Polygon, n: vec3f) -> Polygon {
    var cut: Polygon;
    cut.count = 0u;
    for (var i = 0u; i < polygon.count; i++) {
        let a = polygon.corners[i];
        let b = polygon.corners[(i + 1u) % polygon.count];
        let ha = dot(n, a);
        let hb = dot(n, b);
        if ha >= 0.0 && cut.count < MOST_CORNERS {
            cut.corners[cut.count] = a;
            cut.count++;
        }
        if (ha >= 0.0) != (hb >= 0.0) && cut.count < MOST_CORNERS {
            cut.corners[cut.count] = a + (b - a) * (ha / (ha - hb));
            cut.count++;
        }
    }
    return cut;
}

// cos_s cos_l / d^2 times the area that `spread` = (edge x edge) stands for, at y.
fn kernel(n: vec3f, spread: vec3f, y: vec3f) -> f32 {
    let d2 = dot(y, y);
    return max(0.0, dot(n, y)) * abs(dot(spread, y)) / (d2 * d2);
}

// 3 x 3 Gauss points of the parallelogram about its middle.
fn far_parallelogram(n: vec3f, corner: vec3f, u: vec3f, v: vec3f) -> f32 {
    let middle = corner + 0.5 * (u + v);
    let spread = cross(u, v);
    var sum = 0.0;
    for (var i = -1; i <= 1; i++) {
        for (var j = -1; j <= 1; j++) {
            let weight = select(5.0, 8.0, i == 0) * select(5.0, 8.0, j == 0) / 324.0;
            sum += weight * kernel(n, spread, middle + 0.5 * GAUSS * (f32(i) * u + f32(j) * v));
        }
    }
    return sum;
}

// The same over a fan of triangles, each a square with one edge drawn together.
fn far_polygon(n: vec3f, polygon: Polygon) -> f32 {
    var sum = 0.0;
    for (var k = 1u; k + 1u < polygon.count; k++) {
        let a = polygon.corners[0];
        let ab = polygon.corners[k] - a;
        let bc = polygon.corners[k + 1u] - polygon.corners[k];
        let spread = cross(ab, bc);
        for (var i = -1; i <= 1; i++) {
            let s = 0.5 + 0.5 * GAUSS * f32(i);
            for (var j = -1; j <= 1; j++) {
                let t = 0.5 + 0.5 * GAUSS * f32(j);
                let weight = select(5.0, 8.0, i == 0) * select(5.0, 8.0, j == 0) / 324.0;
                sum += weight * s * kernel(n, spread, a + s * (ab + t * bc));
            }
        }
    }
    return sum;
}

fn contour(n: vec3f, polygon: Polygon) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < polygon.count; i++) {
        sum += edge_term(n, polygon.corners[i], polygon.corners[(i + 1u) % polygon.count]);
    }
    return 0.5 * abs(sum);
}

// Irradiance at the origin with normal n from corner + a u + b v of unit radiance, whatever side it shines to; what lies
// below n's plane or below that of the geometric normal does not count.
fn parallelogram_irradiance(n: vec3f, normal_geo: vec3f, corner_in: vec3f, u_in: vec3f, v_in: vec3f) -> f32 {
    // Irradiance does not depend on scale; products of far or tiny coordinates would leave float32's range.
    let extent = max(abs(corner_in), max(abs(corner_in + u_in), max(abs(corner_in + v_in), abs(corner_in + u_in + v_in))));
    let scale = 1.0 / max(max(extent.x, max(extent.y, extent.z)), 1e-35);
    let corner = corner_in * scale;
    let u = u_in * scale;
    let v = v_in * scale;
    let middle = corner + 0.5 * (u + v);
    let size2 = max(dot(u, u), dot(v, v));
    let far = dot(middle, middle) > FAR_SIZES * FAR_SIZES * size2;
    let heights = vec4f(dot(n, corner), dot(n, corner + u), dot(n, corner + u + v), dot(n, corner + v));
    let geometric = vec4f(dot(normal_geo, corner), dot(normal_geo, corner + u), dot(normal_geo, corner + u + v), dot(normal_geo, corner + v));
    if all(heights <= vec4f(0.0)) || all(geometric <= vec4f(0.0)) {
        return 0.0;
    }
    if all(heights >= vec4f(0.0)) && all(geometric >= vec4f(0.0)) && far {
        return far_parallelogram(n, corner, u, v);
    }
    var polygon: Polygon;
    polygon.corners[0] = corner;
    polygon.corners[1] = corner + u;
    polygon.corners[2] = corner + u + v;
    polygon.corners[3] = corner + v;
    polygon.count = 4u;
    polygon = clip(clip(polygon, n), normal_geo);
    if far {
        return far_polygon(n, polygon);
    }
    return contour(n, polygon);
}
