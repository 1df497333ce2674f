//! One ray a pixel, through its centre.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::visibility::Ray;

/// Writes a ray for each pixel of the tiles that cover the image.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>) -> Result<Buffer<Ray>> {
    let kernel = context.kernel("geometry/primary_rays", "main")?;
    let count = context.view.tiled as usize;
    let rays = context.resources.buffer("primary_rays", count)?;
    context
        .recorder
        .pass("primary_rays", &kernel)
        .uniform("view", &context.view)
        .bind("rays", &rays)
        .dispatch(count)?;
    Ok(rays)
}
