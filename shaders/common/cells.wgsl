// Cells of 2 x 2 pixels, 16 in a tile, in the order of the tiles; and what is known of a light in them.

import package::common::tiles::{TILE, TILE_PIXELS};

const TILE_CELLS: u32 = 16u;
const CELLS_ACROSS: u32 = 4u;

// Places lie on one surface while they are less than this out of each other's tangent plane, as a share of their distance,
// and their normals turned by no more than this cosine.
const FLAT: f32 = 0.2;
const LEAST_COSINE: f32 = 0.8;

// cell_state.
const STATE_NONE: u32 = 0u;     // no pixel that faces the light
const STATE_LIT: u32 = 1u;
const STATE_DARK: u32 = 2u;
const STATE_ZONE: u32 = 3u;     // partly, or perhaps partly, in shadow

// cell_plan: what a cell of the zone does.
const PLAN_ZONE: u32 = 1u;
const PLAN_TRACED: u32 = 2u;    // each pixel asks for itself
const PLAN_CALM: u32 = 0x80u;   // little changes here: by few blocks
const PLAN_SUBS_SHIFT: u32 = 2u;    // five bits: strata a pixel asks of a block
const PLAN_RADIUS_SHIFT: u32 = 8u;  // two bits: of the filter

// Place of a cell in the image, in cells.
fn cell_place(index: u32, width: u32) -> vec2u {
    let tiles_x = (width + TILE - 1u) / TILE;
    let tile = index / TILE_CELLS;
    let within = index % TILE_CELLS;
    return vec2u(tile % tiles_x, tile / tiles_x) * CELLS_ACROSS + vec2u(within % CELLS_ACROSS, within / CELLS_ACROSS);
}

fn cell_index(place: vec2u, width: u32) -> u32 {
    let tiles_x = (width + TILE - 1u) / TILE;
    let tile = place / CELLS_ACROSS;
    let within = place % CELLS_ACROSS;
    return (tile.y * tiles_x + tile.x) * TILE_CELLS + within.y * CELLS_ACROSS + within.x;
}

// Index in image order, as cell_state has it.
fn cell_in_image(place: vec2u, width: u32) -> u32 {
    return place.y * ((width + 1u) / 2u) + place.x;
}

// Pixel `corner` (0 to 3) of a cell.
fn cell_corner(place: vec2u, corner: u32) -> vec2u {
    return place * 2u + vec2u(corner & 1u, corner >> 1u);
}
