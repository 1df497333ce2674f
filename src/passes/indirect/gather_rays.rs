//! Stratified hemisphere rays of a wave of pixels.

use super::{GatherPath, GatherWave};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::visibility::Ray;
use crate::passes::{Context, GBuffer};

/// Writes the rays and paths of a wave.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    wave: &GatherWave,
    rays: &Buffer<Ray>,
    paths: &Buffer<GatherPath>,
) -> Result<()> {
    let kernel = context.kernel("indirect/gather_rays", "main")?;
    context
        .recorder
        .pass("gather_rays", &kernel)
        .uniform("wave", wave)
        .bind("g_position", &gbuffer.position)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_geometric", &gbuffer.geometric)
        .bind("rays", rays)
        .bind("paths", paths)
        .dispatch(wave.size())
}
