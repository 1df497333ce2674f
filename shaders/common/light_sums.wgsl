// Sums of a light's picture over rectangles, by sums over everything left of and below each corner of its texels, of
// the picture less its mean [Cro84].

@group(0) @binding(21) var<storage, read> light_sums: array<vec4f>;

// Of rectangles smaller than this share of the picture, differences of sums would be all rounding.
const LEAST_SHARE: f32 = 6e-6;

// `at`: a place in texels, row 0 at the bottom.
fn sum_at(size: vec2u, at: vec2f) -> vec3f {
    let corner = min(vec2u(at), size - 1u);
    let f = at - vec2f(corner);
    let row = size.x + 1u;
    let i = corner.y * row + corner.x;
    let below = mix(light_sums[i].xyz, light_sums[i + 1u].xyz, f.x);
    return mix(below, mix(light_sums[i + row].xyz, light_sums[i + row + 1u].xyz, f.x), f.y);
}

// Mean between two places (a, b) of a picture with this mean.
fn rectangle_mean(size: vec2u, mean: vec3f, lo: vec2f, hi: vec2f) -> vec3f {
    let texels = vec2f(size);
    let a = clamp(lo, vec2f(0.0), vec2f(1.0)) * texels;
    let b = clamp(hi, vec2f(0.0), vec2f(1.0)) * texels;
    let area = (b.x - a.x) * (b.y - a.y);
    if area < LEAST_SHARE * texels.x * texels.y {
        return mean_about(size, mean, 0.5 * (a + b));
    }
    let whole = sum_at(size, b) - sum_at(size, vec2f(a.x, b.y)) - sum_at(size, vec2f(b.x, a.y)) + sum_at(size, a);
    return max(mean + whole / area, vec3f(0.0));
}

// Mean about a place in texels, over a rectangle just large enough.
fn mean_about(size: vec2u, mean: vec3f, at: vec2f) -> vec3f {
    let texels = vec2f(size);
    let half = 0.5 * sqrt(LEAST_SHARE) * texels;
    let middle = clamp(at, half, texels - half);
    let lo = middle - half;
    let hi = middle + half;
    let whole = sum_at(size, hi) - sum_at(size, vec2f(lo.x, hi.y)) - sum_at(size, vec2f(hi.x, lo.y)) + sum_at(size, lo);
    return max(mean + whole / (4.0 * half.x * half.y), vec3f(0.0));
}
