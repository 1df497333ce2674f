//! Blocks of voxels, so that a march may pass what is empty.

use super::voxelize::VoxelGrid;
use crate::error::Result;
use crate::passes::Context;

/// Cells along an edge of a block; twin of `BLOCK` in `shaders/common/voxels.wgsl`.
const BLOCK: u64 = 4;
/// First guess of what a word of a block costs, nanoseconds.
const WORD_NS: f64 = 300.0;

/// Blocks of a grid.
pub fn count(columns: u64, rows: u64) -> u64 {
    columns.div_ceil(BLOCK).saturating_mul(rows.div_ceil(BLOCK))
}

/// Gathers the bits of the cells.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, grid: &VoxelGrid) -> Result<()> {
    let kernel = context.kernel("visibility/voxel_blocks", "main")?;
    let words = count(grid.voxels.columns.into(), grid.voxels.rows.into()) as usize * grid.voxels.words as usize;
    let pass = context.recorder.pass("voxel_blocks", &kernel).uniform("voxels", &grid.voxels);
    pass.bind("bits", &grid.bits).dispatch_cut(words, WORD_NS)
}
