// Samples in and about the large fragments, which their pixels take light from; a list of slots for each texel from level 3 on.
// A slot: xyz the bits of irradiance, w the place from the texel's first pixel on, see `packed`.

const LARGE: u32 = 3u;          // the smallest fragments that have a list
const SLOTS: u32 = 32u;
const COUNT: u32 = 31u;         // the slot whose fourth number says how many there are

const BIAS: i32 = 4096;

// Row and column; a sample that is too far for them is none.
fn packed(place: vec2i) -> u32 {
    let at = vec2u(place + BIAS);
    return (at.y << 13u) | at.x;
}

fn is_near(place: vec2i) -> bool {
    return all(abs(place) < vec2i(BIAS));
}

fn place_of(word: u32) -> vec2f {
    return vec2f(vec2i(i32(word & 0x1fffu), i32(word >> 13u)) - BIAS);
}
