//! The sum over the visible samples of a light.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::visibility::Receiver;

/// Twin of `GatherParams` in `shaders/common/gather_params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct GatherParams {
    /// Samples.
    pub strata: u32,
    /// Words of visibility a receiver, 0 for none.
    pub words: u32,
    /// Which light.
    pub light: u32,
    /// Unused.
    pub pad: u32,
}

/// What a sum over the samples of a light reads and writes.
pub struct Gathered<'g> {
    /// Whose samples.
    pub light: &'g LightSamples,
    /// Shading points.
    pub receivers: &'g Buffer<Receiver>,
    /// Which samples they see.
    pub visibility: &'g Buffer<u32>,
    /// Shading points in use.
    pub count: usize,
    /// Whether `visibility` was found out; else everything is seen.
    pub traced: bool,
    /// In image order; added to.
    pub irradiance: &'g Buffer<[f32; 4]>,
}

impl Gathered<'_> {
    /// Words of visibility a receiver, 0 where everything is seen.
    pub(super) fn words(&self) -> u32 {
        if self.traced { self.light.strata.div_ceil(32) } else { 0 }
    }
}

/// Adds the irradiance of one light at each receiver, sample by sample.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, work: &Gathered<'_>) -> Result<()> {
    record_as(context, "gather", work)
}

/// Runs the pass `stem`, which has the bindings of `gather`.
pub(super) fn record_as(context: &mut Context<'_, '_>, stem: &str, work: &Gathered<'_>) -> Result<()> {
    let kernel = context.kernel(&format!("gather/{stem}"), "main")?;
    let light = work.light;
    let params = GatherParams { strata: light.strata, words: work.words(), light: light.light, pad: 0 };
    context
        .recorder
        .pass(stem, &kernel)
        .uniform("params", &params)
        .bind("receivers", work.receivers)
        .bind("visibility", work.visibility)
        .bind("light_points", &light.points)
        .bind("light_radiance", &light.radiance)
        .bind("lights", context.scene.lights()?)
        .bind("direct_irradiance", work.irradiance)
        .dispatch_cut(work.count, 200.0 + 4.0 * f64::from(light.strata))
}
