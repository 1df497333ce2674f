// Means of a light's picture over rectangles, from sums over everything left of and below each corner of its texels, of
// the picture less its mean [Cro84].

@group(0) @binding(21) var<storage, read> light_sums: array<vec4f>;

// Rectangles are no smaller than this share of the picture: differences of sums would be all rounding.
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

// Mean of a picture of `size` columns and rows with this mean between two places (a, b).
fn mean_between(size: vec2u, mean: vec3f, lo: vec2f, hi: vec2f) -> vec3f {
    let texels = vec2f(size);
    let least = 0.5 * sqrt(LEAST_SHARE) * texels;
    let middle = clamp(0.5 * (lo + hi) * texels, least, texels - least);
    let half = max(0.5 * (hi - lo) * texels, least);
    let a = clamp(middle - half, vec2f(0.0), texels);
    let b = clamp(middle + half, vec2f(0.0), texels);
    let whole = sum_at(size, b) - sum_at(size, vec2f(a.x, b.y)) - sum_at(size, vec2f(b.x, a.y)) + sum_at(size, a);
    return max(mean + whole / ((b.x - a.x) * (b.y - a.y)), vec3f(0.0));
}
