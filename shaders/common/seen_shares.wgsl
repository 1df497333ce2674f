// Which share of interleaved samples is seen, from the words of bits of a node and its neighbours.

// How many of the node itself, of those left and right of it, above and below, and in the corners, each of which asked
// another set, have each bit of a word: bits of these numbers.
struct Counts {
    ones: vec4u,
    twos: vec4u,
    fours: u32,     // of the corners
}

// `words`: of the 3 x 3 nodes.
fn counted(words: array<u32, 9>) -> Counts {
    let ones = vec4u(
        words[4], words[3] ^ words[5], words[1] ^ words[7], words[0] ^ words[2] ^ words[6] ^ words[8]);
    let carry = (words[0] ^ words[2]) & (words[6] ^ words[8]);
    let pairs = vec2u(words[0] & words[2], words[6] & words[8]);
    let twos = vec4u(0u, words[3] & words[5], words[1] & words[7], pairs.x ^ pairs.y ^ carry);
    return Counts(ones, twos, pairs.x & pairs.y);
}

// Those of one bit.
fn counts_at(c: Counts, bit: u32) -> vec4f {
    let low = ((c.ones >> vec4u(bit)) & vec4u(1u)) + 2u * ((c.twos >> vec4u(bit)) & vec4u(1u));
    return vec4f(low + vec4u(0u, 0u, 0u, 4u * ((c.fours >> bit) & 1u)));
}

// Share of a sample of each set that is seen; of a set that nobody asked, the mean of the others.
fn seen_shares(known: vec4f, seen: vec4f) -> vec4f {
    let mean = dot(seen, vec4f(1.0)) / max(dot(known, vec4f(1.0)), 1.0);
    return select(vec4f(mean), seen / max(known, vec4f(1.0)), known > vec4f(0.0));
}

// From the own set and those of the neighbours beside, above and in the corners to sets 0, 1, 2, 3.
fn by_set(shares: vec4f, own: u32) -> vec4f {
    let columns = select(shares, shares.yxwz, (own & 1u) != 0u);
    return select(columns, columns.zwxy, (own & 2u) != 0u);
}
