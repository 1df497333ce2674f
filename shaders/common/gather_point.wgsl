// A place whose hemisphere was gathered, and how far what it found holds for others [WRC88].

import package::common::alike::fade;

struct GatherPoint {
    position: vec3f,
    inverse: f32,       // sum of 1 / distance to what its rays met
    normal: vec3f,      // shading normal
    level: u32,
    // Vector irradiance: its product with a normal near its own is the irradiance there, and exactly so for its own.
    red: vec3f,
    met: f32,           // rays that met something: what is not there changes nothing
    green: vec3f,
    pad1: u32,
    blue: vec3f,
    pad2: u32,
    // Gradients of the irradiance by the place, along the surface [WH92].
    red_slope: vec3f,
    pad3: u32,
    green_slope: vec3f,
    pad4: u32,
    blue_slope: vec3f,
    pad5: u32,
}

struct PointParams {
    reach: f32,         // share of the harmonic mean distance that a point holds for
    first: u32,         // point of the level at work, and how many they are
    count: u32,
    covered: f32,       // share of a pixel's neighbours that must hold for it
}

// Normals that differ by more are of another surface.
const MOST_TURNED: f32 = 0.35;
// A point holds for the pixels beside it, however near the surfaces that it met: so many widths of a pixel.
const LEAST_PIXELS: f32 = 1.5;
// Distance to a point's plane counts so many times.
const OFF_PLANE: f32 = 4.0;

// What a point that met nothing found holds so far, which is without end, and yet has a square.
const ENDLESS: f32 = 1e18;

// From 1 to 0 how far a point holds at p with normal n, where pixels are `width` wide.
fn holds(point: GatherPoint, reach: f32, p: vec3f, n: vec3f, width: f32) -> f32 {
    let share = select(reach * point.met / max(point.inverse, 1e-30), ENDLESS, point.met == 0.0);
    let far = max(share, LEAST_PIXELS * width);
    let d = p - point.position;
    let off = OFF_PLANE * dot(d, point.normal);
    let turned = (point.normal - n) * (1.0 / MOST_TURNED);
    return fade((dot(d, d) + off * off) / max(far * far, 1e-37)) * fade(dot(turned, turned));
}

// A block's mark: its top bit, and below it the greater the nearer the pixel that it names is to the block's middle, and
// of equally near ones the first.
const MARKED: u32 = 0x80000000u;

fn mark_of(level: u32, within: vec2u) -> u32 {
    let apart = 2 * vec2i(within) + 1 - i32(1u << level);
    let far = u32(apart.x * apart.x + apart.y * apart.y);
    return MARKED | (~MARKED - ((far << (2u * level)) | (within.y << level) | within.x));
}

// Where in its block the pixel is that a mark names.
fn place_of(level: u32, mark: u32) -> vec2u {
    let key = ~MARKED - (mark & ~MARKED);
    return vec2u(key, key >> level) & vec2u((1u << level) - 1u);
}

// A weighted mean of points at one place. Of what gradients add half is taken with each point, which cancels the error of
// second order that a mean of points around the place makes without them, and the other half about the points' middle,
// which is what they lack on one side [WH92].
struct PointMean {
    weight: f32,
    away: vec3f,        // from the points to the place
    light: vec3f,
    change: vec3f,
    red_slope: vec3f,
    green_slope: vec3f,
    blue_slope: vec3f,
}

fn add_point(mean: ptr<function, PointMean>, point: GatherPoint, weight: f32, p: vec3f, n: vec3f) {
    let d = p - point.position;
    let change = vec3f(dot(point.red_slope, d), dot(point.green_slope, d), dot(point.blue_slope, d));
    (*mean).weight += weight;
    (*mean).away += weight * d;
    (*mean).light += weight * max(vec3f(dot(point.red, n), dot(point.green, n), dot(point.blue, n)), vec3f(0.0));
    (*mean).change += weight * change;
    (*mean).red_slope += weight * point.red_slope;
    (*mean).green_slope += weight * point.green_slope;
    (*mean).blue_slope += weight * point.blue_slope;
}

// What gradients add to the light of a mean, both times its weight: no more than the light, no less than three quarters off.
fn added(mean: PointMean) -> vec3f {
    let middle = mean.away / max(mean.weight, 1e-30);
    let about = vec3f(dot(mean.red_slope, middle), dot(mean.green_slope, middle), dot(mean.blue_slope, middle));
    return clamp(0.5 * (mean.change + about), -0.75 * mean.light, mean.light);
}
