//! Adds the light that reached the hits of a wave to its pixels.

use super::{GatherPath, GatherWave};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, TILE_PIXELS};

/// One thread a pixel sums its strata in order.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    wave: &GatherWave,
    paths: &Buffer<GatherPath>,
    occluded: &Buffer<u32>,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("indirect/gather_sum", "main")?;
    context
        .recorder
        .pass("gather_sum", &kernel)
        .uniform("wave", wave)
        .bind("paths", paths)
        .bind("occluded", occluded)
        .bind("indirect_irradiance", irradiance)
        .dispatch((wave.tiles * TILE_PIXELS) as usize)
}
