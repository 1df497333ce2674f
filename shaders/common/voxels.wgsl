// The grid of voxels: what the camera sees, and a margin, cut on the image into square cells and along the view into
// slices of equal depth [NPW10 Sec. 3.3: one bit a slice]. A cell has `words` words, bit k % 32 of word k / 32 for
// slice k. After the cells follow blocks of them, each with the bits of all its cells and of those in a ring around it.
// A straight ray crosses the sides of cells where they are planes through the eye.

struct Voxels {
    eye: vec3f,
    columns: u32,
    right: vec3f,
    rows: u32,
    up: vec3f,
    words: u32,
    backward: vec3f,
    near: f32,
    scale: vec2f,   // cells for each unit of x/z and y/z
    center: vec2f,  // place of the view's axis, cells
    far: f32,
    slices_per_depth: f32,
    bias: f32,      // voxels between a surface and the end of a marched ray
    steps: u32,
}

// Cells along an edge of a block, and of the ring on each side.
const BLOCK: u32 = 4u;
const RING: u32 = 4u;

fn block_columns(voxels: Voxels) -> u32 {
    return (voxels.columns + BLOCK - 1u) / BLOCK;
}

// Cells before the first block.
fn first_block(voxels: Voxels) -> u32 {
    return voxels.columns * voxels.rows;
}

// A direction along the camera's axes: right, down, and depth.
fn eye_direction(voxels: Voxels, d: vec3f) -> vec3f {
    return vec3f(dot(voxels.right, d), -dot(voxels.up, d), -dot(voxels.backward, d));
}

// A point along these axes.
fn eye_space(voxels: Voxels, p: vec3f) -> vec3f {
    return eye_direction(voxels, p - voxels.eye);
}

// Columns and rows from the grid's corner, fractions included.
fn cell_place(voxels: Voxels, q: vec3f) -> vec2f {
    return voxels.center + voxels.scale * q.xy / q.z;
}

// The cell at a place, or the one nearest to it.
fn cell_at(voxels: Voxels, place: vec2f) -> vec2u {
    return vec2u(clamp(vec2i(floor(place)), vec2i(0), vec2i(i32(voxels.columns), i32(voxels.rows)) - 1));
}

// The slice at a depth, or the one nearest to it.
fn slice_at(voxels: Voxels, depth: f32) -> u32 {
    return u32(clamp((depth - voxels.near) * voxels.slices_per_depth, 0.0, f32(32u * voxels.words - 1u)));
}

// Bits of the slices first..last that lie in a word.
fn word_mask(word: u32, first: u32, last: u32) -> u32 {
    let low = max(first, 32u * word) - 32u * word;
    let high = min(last, 32u * word + 31u) - 32u * word;
    return (0xffffffffu << low) & (0xffffffffu >> (31u - high));
}
