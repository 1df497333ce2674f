// Those samples of a large fragment that lie nearest to a pixel of it.

import package::common::border_samples::{COUNT, SLOTS, place_of};
import package::common::radial_basis::Samples;

@group(0) @binding(7) var<storage, read> border_samples: array<vec4u>;

// In order of distance: its square, and in the last bits the slot.
struct Nearest {
    one: u32,
    two: u32,
    three: u32,
    four: u32,
    five: u32,
}

const SLOT: u32 = 31u;
const NOBODY: u32 = 0x7f000000u;

fn nearer(n: Nearest, key: u32) -> Nearest {
    let a = max(n.one, key);
    let b = max(n.two, a);
    let c = max(n.three, b);
    let d = max(n.four, c);
    return Nearest(min(n.one, key), min(n.two, a), min(n.three, b), min(n.four, c), min(n.five, d));
}

// Of the list `row`, if it counts; `here` from the fragment's first pixel on.
fn nearest_samples(row: u32, here: vec2f, counts: bool) -> Nearest {
    let count = select(0u, border_samples[SLOTS * row + COUNT].w, counts);
    var n = Nearest(NOBODY, NOBODY, NOBODY, NOBODY, NOBODY);
    for (var k = 0u; k < count; k++) {
        let step = place_of(border_samples[SLOTS * row + k].w) - here;
        n = nearer(n, select(NOBODY, (bitcast<u32>(dot(step, step)) & ~SLOT) | k, k < count));
    }
    return n;
}

// Adds a sample, unless one of those there is near it.
fn with_sample(s: Samples, place: vec2f, light: vec3f, close: f32, counts: bool) -> Samples {
    var more = s;
    var fits = counts && s.count < 4u;
    for (var i = 0u; i < 4u; i++) {
        let apart = place - s.place[i];
        fits = fits && (i >= s.count || dot(apart, apart) > close * close);
    }
    for (var i = 0u; i < 4u; i++) {
        let here = fits && s.count == i;
        more.place[i] = select(s.place[i], place, here);
        more.light[i] = select(s.light[i], light, here);
    }
    more.count += select(0u, 1u, fits);
    return more;
}

// Adds the sample of a key; `origin`: the fragment's first pixel.
fn with_nearest(s: Samples, row: u32, origin: vec2f, key: u32, close: f32, counts: bool) -> Samples {
    let found = counts && key < NOBODY;
    let sample = border_samples[SLOTS * row + select(0u, key & SLOT, found)];
    return with_sample(s, origin + place_of(sample.w), bitcast<vec3f>(sample.xyz), close, found);
}
