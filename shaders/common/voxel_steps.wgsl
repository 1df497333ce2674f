// A segment through the voxels in steps that are equal on the image, and in larger ones through empty blocks.

import package::common::voxel_march::{Path, Segment, above, path_of, voxel_bits, voxels};
import package::common::voxels::{
    BLOCK, RING, Voxels, block_columns, cell_at, first_block, slice_at, word_mask,
};

// The thick ray of [NPW10 Sec. 3.3.1]: slices that are looked at ahead of each step for each cell that it leaves out, and
// at most. None behind, where the ray has just left a surface.
const THICK: f32 = 0.5;
const THICKEST: f32 = 1.0;
// Slices that a step looks through at most, unless `voxels.steps` are too few for that.
const DEEP: f32 = 4.0;
// Steps that one look at a block may save.
const MOST: f32 = 8.0;

// How many steps it takes to look into each cell on the way along the longer side, and into few slices a step.
fn steps_of(p: Path, depth: f32) -> f32 {
    let cells = max(abs(p.step.x), abs(p.step.y));
    let wanted = ceil(max(cells, abs(depth) * voxels.slices_per_depth / DEEP));
    return clamp(wanted, 1.0, f32(voxels.steps));
}

// Cells from one step to the next.
fn stride_of(p: Path, steps: f32) -> f32 {
    return max(abs(p.step.x), abs(p.step.y)) / steps;
}

// How many steps lie inside of a block and the ring about it, whatever cell of the block their middle is in.
fn steps_of_block(stride: f32) -> f32 {
    return clamp(floor(2.0 * f32(RING) / max(stride, 1.0)) + 1.0, 1.0, MOST);
}

// First word of the cell at a place, or of its block.
fn words_at(place: vec2f, fine: bool) -> u32 {
    let cell = cell_at(voxels, place);
    let block = cell / BLOCK;
    let number = select(first_block(voxels) + block.y * block_columns(voxels) + block.x, cell.y * voxels.columns + cell.x, fine);
    return number * voxels.words;
}

// Whether a voxel is met: the cell in the middle of each step, all depths that the step spans. Where a block is empty its
// steps are, too. One loop for both and for all words of a cell, so that no thread waits for others at either.
fn meets_in_steps(s: Segment) -> bool {
    let p = path_of(s);
    let steps = select(0.0, steps_of(p, (s.range.y - s.range.x) * s.along.z), s.range.x < s.range.y);
    let step = 1.0 / steps;
    let stride = stride_of(p, steps);
    let group = steps_of_block(stride);
    let thicker = clamp(THICK * (stride - 1.0), 0.0, THICKEST) / voxels.slices_per_depth;
    let thick = select(vec2f(-thicker, 0.0), vec2f(0.0, thicker), s.along.z > 0.0);
    var leaving = true;
    var from_z = 1.0 / p.near;
    var k = 0.0;
    var fine_until = 0.0;
    var word = 0u;
    var found = false;
    while k < steps && !found {
        let fine = k < fine_until;
        let end = min(k + select(group, 1.0, fine), steps);
        let middle = 0.5 * (k + end) * step;
        let to_z = 1.0 / (p.near + end * step * p.slope);
        let whole = vec2f(min(from_z, to_z), max(from_z, to_z)) + thick;
        let slopes = p.plane + middle * p.turn;
        let z = 0.5 * (whole.x + whole.y);
        let depths = select(whole, above(s.planes[1], slopes.y, z, above(s.planes[0], slopes.x, z, whole)), fine);
        let first = slice_at(voxels, depths.x);
        let last = max(slice_at(voxels, depths.y), first);
        word = max(word, first / 32u);
        let bits = voxel_bits[words_at(p.place + middle * p.step, fine) + word] & word_mask(word, first, last);
        let filled = bits != 0u && depths.x <= depths.y;
        let more = !filled && word < last / 32u && depths.x <= depths.y;
        word = select(0u, word + 1u, more);
        found = filled && fine && (!leaving || middle > p.leave);
        leaving = leaving && (filled || more);
        fine_until = select(fine_until, end, filled && !fine);
        let on = !more && (fine || !filled);
        k = select(k, end, on);
        from_z = select(from_z, to_z, on);
    }
    return found;
}
