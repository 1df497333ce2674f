//! The sum over the visible samples of a light.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::visibility::Receiver;

/// Twin of `GatherParams` in `shaders/passes/gather/gather.wgsl`.
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

/// Adds the irradiance of one light at `count` receivers.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    light: &LightSamples,
    receivers: &Buffer<Receiver>,
    visibility: &Buffer<u32>,
    count: usize,
    traced: bool,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("gather/gather", "main")?;
    let words = if traced { light.strata.div_ceil(32) } else { 0 };
    let params = GatherParams { strata: light.strata, words, light: light.light, pad: 0 };
    context
        .recorder
        .pass("gather", &kernel)
        .uniform("params", &params)
        .bind("receivers", receivers)
        .bind("visibility", visibility)
        .bind("light_points", &light.points)
        .bind("light_radiance", &light.radiance)
        .bind("lights", context.scene.lights()?)
        .bind("direct_irradiance", irradiance)
        .dispatch_cut(count, 4.0 * f64::from(light.strata))
}
