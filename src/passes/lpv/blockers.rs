//! Which faces of cells light passes.

use super::Volume;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Rays that are traced at once.
const RAYS: usize = 1 << 20;

/// Writes a mask of open faces a cell.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(context: &mut Context<'_, '_>, volume: &Volume, open: &Buffer<u32>) -> Result<()> {
    let rays_of_all = 3 * volume.cells as usize;
    let occluded = context.resources.buffer("lpv_occluded", rays_of_all.div_ceil(32))?;
    if context.settings.is("indirect_visibility", "off") {
        context.recorder.clear(&occluded)?;
        return faces(context, volume, &occluded, open);
    }
    let rays = context.resources.buffer("lpv_face_rays", rays_of_all)?;
    let between = context.kernel("lpv/blockers", "rays_between")?;
    let pass = context.recorder.pass("blockers", &between).uniform("volume", volume);
    pass.bind("rays", &rays).dispatch(rays_of_all)?;
    let tracer = context.tracer;
    for first in (0..rays_of_all).step_by(RAYS) {
        let range = first..rays_of_all.min(first + RAYS);
        context.rays += tracer.any(context.recorder, "blockers_trace", &rays, &occluded, range)?;
    }
    faces(context, volume, &occluded, open)
}

/// Masks from the answers.
fn faces(context: &mut Context<'_, '_>, volume: &Volume, occluded: &Buffer<u32>, open: &Buffer<u32>) -> Result<()> {
    let faces = context.kernel("lpv/blockers", "faces")?;
    let pass = context.recorder.pass("blockers", &faces).uniform("volume", volume);
    pass.bind("occluded", occluded).bind("open", open).dispatch(volume.cells as usize)
}
