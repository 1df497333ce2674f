// Which virtual lights of a batch a texel has left to light it: `words` words a texel, from level `lowest` up, after a head.

import package::common::pyramid::pyramid;

struct VplListsParams {
    first: u32,     // virtual light of the batch
    count: u32,     // virtual lights of the batch
    words: u32,
    lowest: u32,    // level below which nothing is split, 1 at least
    reach: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// Word of the head that holds the length of the list of texels; the others are dispatch arguments.
const LISTED: u32 = 3u;
const HEAD: u32 = 4u;

fn mask_at(params: VplListsParams, number: u32, word: u32) -> u32 {
    return HEAD + (number - pyramid.levels[params.lowest].z) * params.words + word;
}

// All virtual lights of the batch that this word is for.
fn batch_word(params: VplListsParams, word: u32) -> u32 {
    let count = min(32u, max(params.count, 32u * word) - 32u * word);
    return select((1u << (count & 31u)) - 1u, 0xffffffffu, count == 32u);
}
