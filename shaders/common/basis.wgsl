// Orthonormal bases and the cosine-weighted hemisphere.

const PI: f32 = 3.14159265358979;

// [DBC17] Two tangents of a unit normal, without a branch that fails at -z.
fn tangents(n: vec3f) -> mat2x3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat2x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y));
}

// [SC97] The concentric map: equal areas of the square to equal areas of the disc, with little stretch.
fn disc_from_square(square: vec2f) -> vec2f {
    let p = 2.0 * square - 1.0;
    if all(p == vec2f(0.0)) {
        return vec2f(0.0);
    }
    let wide = abs(p.x) > abs(p.y);
    let r = select(p.y, p.x, wide);
    let phi = select(PI / 2.0 - PI / 4.0 * (p.x / p.y), PI / 4.0 * (p.y / p.x), wide);
    return r * vec2f(cos(phi), sin(phi));
}

// A direction about n with density cos / pi, from a place in the unit square (Malley's method).
fn cosine_direction(n: vec3f, square: vec2f) -> vec3f {
    let d = disc_from_square(square);
    let z = sqrt(max(0.0, 1.0 - dot(d, d)));
    return normalize(tangents(n) * d + n * z);
}
