//! What the lobe of each fragment asks of a light.

use bytemuck::{Pod, Zeroable};

use super::Work;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Twin of `LobeAskParams` in `shaders/passes/lobes/lobe_ask.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LobeAskParams {
    /// First fragment.
    pub first: u32,
    /// Samples of the light.
    pub strata: u32,
    /// Words of bits a fragment.
    pub words: u32,
    /// Unused.
    pub pad: u32,
}

/// Writes bits of the samples to ask, rays to places in the lobe, and what these add.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(context: &mut Context<'_, '_>, work: &Work<'_>) -> Result<()> {
    let nothing: Buffer<[f32; 4]> = context.resources.buffer("nothing", 1)?;
    let sums = context.scene.light_sums(work.light.light as usize).unwrap_or(&nothing);
    let params = LobeAskParams {
        first: work.first as u32,
        strata: work.light.strata,
        words: work.light.shadow_light().words() as u32,
        pad: 0,
    };
    let kernel = context.kernel("lobes/lobe_ask", "main")?;
    let pass = context.recorder.pass("lobe_ask", &kernel).uniform("params", &params).uniform("source", &work.source);
    let pass = pass.uniform("view", &context.view).bind("receivers", work.receivers).bind("light_sums", sums);
    let pass = pass.bind("points", &work.light.points).bind("asked", work.asked);
    let pass = pass.bind("rays", work.rays).bind("lobe_weights", work.weights);
    pass.dispatch_cut(work.count, 3000.0 + 5.0 * f64::from(work.light.strata))
}
