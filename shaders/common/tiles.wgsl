// Work is laid out in tiles of 8 x 8 pixels, so that neighbours in a list are neighbours in the image.

const TILE: u32 = 8u;
const TILE_PIXELS: u32 = 64u;

// The pixel at place `index` of the tile order; it may lie outside the image where the image ends inside a tile.
fn pixel_in_tile_order(index: u32, width: u32) -> vec2u {
    let tiles_x = (width + TILE - 1u) / TILE;
    let tile = index / TILE_PIXELS;
    let within = index % TILE_PIXELS;
    // One division: the remainder would be another.
    let row = tile / tiles_x;
    return vec2u(tile - row * tiles_x, row) * TILE + vec2u(within % TILE, within / TILE);
}
