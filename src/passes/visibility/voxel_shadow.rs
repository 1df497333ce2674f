//! Which samples of a light each receiver sees through the voxels [NPW10 Sec. 3.3.1].

use super::occlusion::Asked;
use super::voxelize::VoxelGrid;
use crate::error::Result;
use crate::passes::Context;

/// First guess of what a step of a marched ray costs, nanoseconds.
const STEP_NS: f64 = 2.0;

/// Answers a question by marching: in equal steps, or voxel by voxel.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, stage: &str, grid: &VoxelGrid, asked: &Asked<'_>) -> Result<()> {
    let (light, range) = (asked.light, asked.range.clone());
    if range.is_empty() || light.strata == 0 {
        return Ok(());
    }
    let dda = context.settings.is("voxel_march", "dda");
    let entry = match (asked.some, dda) {
        (false, false) => "main",
        (true, false) => "asked",
        (false, true) => "main_dda",
        (true, true) => "asked_dda",
    };
    let kernel = context.kernel("visibility/voxel_shadow", entry)?;
    let (gpu, words) = (context.recorder.gpu().clone(), light.words());
    let params = light.params(range.len());
    let steps = if dda { grid.voxels.columns.max(grid.voxels.rows) / 2 } else { grid.voxels.steps };
    let samples = light.strata.min(32) as f64;
    let pass = context.recorder.pass(stage, &kernel).uniform("params", &params).uniform("voxels", &grid.voxels);
    pass.bind("voxel_bits", &grid.bits)
        .bind("points", light.points)
        .bind("receivers", asked.receivers.range(&gpu, range.clone())?)
        .bind("visibility", asked.bits.range(&gpu, range.start * words..range.end * words)?)
        .dispatch_cut(range.len() * words, STEP_NS * samples * f64::from(steps))
}
