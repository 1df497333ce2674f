//! Which faces of cells light passes, and where surfaces lie that close the others.

use bytemuck::{Pod, Zeroable};

use super::Volume;
use super::points::NOWHERE;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::visibility::{Hit, Ray};

/// Rays that are traced at once.
const RAYS: usize = 1 << 20;

/// Twin of `BlockersParams` in `shaders/passes/lpv/blockers.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct BlockersParams {
    /// Face of the part: axis by axis, cell by cell.
    pub first: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Writes for each upper face, axis by axis, where the way between the middles meets a surface, in cells from the lower
/// one, or `NOWHERE`; and a mask of open faces a cell.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    volume: &Volume,
    met: &Buffer<f32>,
    open: &Buffer<u32>,
) -> Result<()> {
    if context.settings.is("indirect_visibility", "off") {
        met.write(context.recorder.gpu(), 0, &vec![NOWHERE; met.len()])?;
    } else {
        trace(context, volume, met)?;
    }
    let kernel = context.kernel("lpv/blockers", "faces")?;
    let pass = context.recorder.pass("blockers", &kernel).uniform("volume", volume);
    pass.bind("surfaces", met).bind("open", open).dispatch(volume.cells as usize)
}

fn trace(context: &mut Context<'_, '_>, volume: &Volume, met: &Buffer<f32>) -> Result<()> {
    let (all, tracer) = (3 * volume.cells as usize, context.tracer);
    let rays: Buffer<Ray> = context.resources.buffer("lpv_face_rays", all.min(RAYS))?;
    let hits: Buffer<Hit> = context.resources.buffer("lpv_face_hits", all.min(RAYS))?;
    let between = context.kernel("lpv/blockers", "rays_between")?;
    let meet = context.kernel("lpv/blockers", "meet")?;
    for first in (0..all).step_by(RAYS) {
        let count = RAYS.min(all - first);
        let params = BlockersParams { first: first as u32, ..BlockersParams::zeroed() };
        let pass = context.recorder.pass("blockers", &between).uniform("volume", volume).uniform("params", &params);
        pass.bind("rays", &rays).dispatch(count)?;
        context.rays += tracer.closest(context.recorder, "blockers_trace", &rays, &hits, 0..count)?;
        let pass = context.recorder.pass("blockers", &meet).uniform("params", &params);
        pass.bind("hits", &hits).bind("met", met).dispatch(count)?;
    }
    Ok(())
}
