//! Sides of surface samples as hits of gather rays.

use super::points::LpvPoint;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::indirect::{GatherWave, Lists};

/// Writes hits, rays and paths of a wave; its `width` is the number of points.
///
/// # Errors
/// Those of the device.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    wave: &GatherWave,
    points: &Buffer<LpvPoint>,
    lists: &Lists,
) -> Result<()> {
    let kernel = context.kernel("lpv/sample_rays", "main")?;
    let pass = context.recorder.pass("sample_rays", &kernel).uniform("wave", wave).bind("points", points);
    let pass = pass.bind("hits", &lists.hits).bind("rays", &lists.rays).bind("paths", &lists.paths);
    pass.dispatch(wave.size())
}
