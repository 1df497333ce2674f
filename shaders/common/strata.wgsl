// Which samples of a light are asked where. The 256 strata of a light are 16 blocks of 4 x 4 [NPW10: interleaved
// sampling]; a bit of a block always means the same stratum. Pixels beside each other ask different strata of a block,
// so that any 4 x 4 pixels (or cells) together ask all 16, and any 2 x 2 one of each quarter.

const BLOCKS: u32 = 16u;
const STRATA: u32 = 256u;
const WORDS: u32 = 8u;

// 4 x 4 places in the order in which 2 x 2 neighbours lie in different quarters.
fn interleave(place: vec2u) -> u32 {
    let turned = ((place & vec2u(1u)) << vec2u(1u)) | ((place >> vec2u(1u)) & vec2u(1u));
    return turned.x | (turned.y << 2u);
}

// Blocks differ, or all samples of a pixel would shift together.
fn scramble(block: u32) -> u32 {
    return (block * 7u) & 15u;
}

// The strata of a block that a pixel asks: 1, 4 (one a quarter) or all 16.
fn asked_of_block(subs: u32, pixel: vec2u, block: u32) -> u32 {
    let one = 1u << (interleave(pixel) ^ scramble(block));
    let place = ((pixel.x & 1u) | ((pixel.y & 1u) << 1u)) ^ (scramble(block) & 3u);
    let four = 0x0505u << ((place & 1u) + 4u * (place >> 1u));
    return select(select(0xffffu, four, subs == 4u), one, subs == 1u);
}

// What a pixel asks of a block by its cell's `agreed` word: nothing where all agree, one stratum where that is enough; of
// bright blocks more and of dim ones less than of others.
fn asked_by_plan(agreed: u32, subs: u32, boosts: u32, pixel: vec2u, block: u32) -> u32 {
    let same = ((agreed >> block) & 1u) != 0u;
    let once = ((agreed >> (16u + block)) & 1u) != 0u;
    let boost = (boosts >> (2u * block)) & 3u;
    let plain = select(subs, 1u, once);
    let more = select(max(plain / 4u, 1u), plain, boost == 1u);
    return select(asked_of_block(select(more, min(4u * plain, 16u), boost == 2u), pixel, block), 0u, same);
}

// A cell of 2 x 2 pixels asks each block once: which of its pixels, and which stratum of the block.
fn cell_pixel(block: u32) -> u32 {
    return (block ^ (block >> 2u)) & 3u;
}

fn cell_stratum(cell: vec2u, block: u32) -> u32 {
    return interleave(cell) ^ scramble(block);
}
