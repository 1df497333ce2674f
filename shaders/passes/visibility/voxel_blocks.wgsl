// Voxel blocks: the bits of all cells of a block and of the ring around it, so that a march may pass what is empty.
// In     bits of the cells
// Out    bits of the blocks, behind them
// Rule   a thread a word of a block; cells outside of the grid have no bits

import package::common::grid::{Grid, item_index};
import package::common::voxels::{BLOCK, RING, Voxels, block_columns, first_block};

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> voxels: Voxels;
@group(0) @binding(2) var<storage, read_write> bits: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let word = i % voxels.words;
    let block = i / voxels.words;
    let corner = BLOCK * vec2u(block % block_columns(voxels), block / block_columns(voxels));
    let first = max(corner, vec2u(RING)) - RING;
    let end = min(corner + BLOCK + RING, vec2u(voxels.columns, voxels.rows));
    var found = 0u;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            found |= bits[(y * voxels.columns + x) * voxels.words + word];
        }
    }
    bits[(first_block(voxels) + block) * voxels.words + word] = found;
}
