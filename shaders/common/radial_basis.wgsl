// Gaussian radial bases about up to four samples, and the weights of the samples at a place between them.

const C: f32 = 2.0;     // [KJ16 Eq. 2b]
// Least pivot of a matrix that is solved; below it weights are normalised.
const LEAST_PIVOT: f32 = 1e-4;

// Samples of a pixel: places in pixels, light.
struct Samples {
    count: u32,
    place: array<vec2f, 4>,
    light: array<vec3f, 4>,
}

fn basis(a: vec2f, b: vec2f, width: f32) -> f32 {
    let step = (a - b) / width;
    return exp(-dot(step, step) / C);
}

// The lower triangle L of Phi = L L^T [a row and column of what is no sample are those of the identity], its first column
// after a 1, then the second, the third and the last number; and the inverses of the diagonal.
struct Factor {
    first: vec3f,
    second: vec2f,
    third: f32,
    inverse: vec4f,
    sound: bool,
}

fn between(s: Samples, i: u32, j: u32, width: f32) -> f32 {
    return select(0.0, basis(s.place[i], s.place[j], width), i < s.count && j < s.count);
}

// Written out: loops over rows and columns would go through memory.
fn factored(s: Samples, width: f32) -> Factor {
    let first = vec3f(between(s, 0u, 1u, width), between(s, 0u, 2u, width), between(s, 0u, 3u, width));
    let a = 1.0 - first.x * first.x;
    let ia = inverseSqrt(max(a, LEAST_PIVOT));
    let second = (vec2f(between(s, 1u, 2u, width), between(s, 1u, 3u, width)) - first.yz * first.x) * ia;
    let b = 1.0 - first.y * first.y - second.x * second.x;
    let ib = inverseSqrt(max(b, LEAST_PIVOT));
    let third = (between(s, 2u, 3u, width) - first.y * first.z - second.x * second.y) * ib;
    let c = 1.0 - first.z * first.z - second.y * second.y - third * third;
    let ic = inverseSqrt(max(c, LEAST_PIVOT));
    return Factor(first, second, third, vec4f(1.0, ia, ib, ic), min(a, min(b, c)) > LEAST_PIVOT);
}

fn solved(f: Factor, b: vec4f) -> vec4f {
    let y1 = (b.y - f.first.x * b.x) * f.inverse.y;
    let y2 = (b.z - f.first.y * b.x - f.second.x * y1) * f.inverse.z;
    let y3 = (b.w - f.first.z * b.x - f.second.y * y1 - f.third * y2) * f.inverse.w;
    let w = y3 * f.inverse.w;
    let z = (y2 - f.third * w) * f.inverse.z;
    let y = (y1 - f.second.x * z - f.second.y * w) * f.inverse.y;
    return vec4f(b.x - f.first.x * y - f.first.y * z - f.first.z * w, y, z, w);
}

// Weights of the samples at a place; they add up to 1.
fn weights_at(s: Samples, here: vec2f, width: f32) -> vec4f {
    let ones = select(vec4f(0.0), vec4f(1.0), vec4u(0u, 1u, 2u, 3u) < vec4u(s.count));
    let phi = ones * vec4f(
        basis(here, s.place[0], width), basis(here, s.place[1], width), basis(here, s.place[2], width),
        basis(here, s.place[3], width));
    let f = factored(s, width);
    let bare = solved(f, phi);
    let flat = solved(f, ones);
    let exact = bare + flat * ((1.0 - dot(ones, bare)) / dot(ones, flat));
    return select(phi / max(dot(ones, phi), 1e-30), exact, f.sound);
}
