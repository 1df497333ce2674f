//! One ray a pixel, through its centre.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::visibility::Ray;
use crate::passes::{Context, View};

/// Writes the rays of `count` pixels from place `first` of the tile order on.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, rays: &Buffer<Ray>, first: usize, count: usize) -> Result<()> {
    let kernel = context.kernel("geometry/primary_rays", "main")?;
    let view = View { first: first as u32, ..context.view };
    context.recorder.pass("primary_rays", &kernel).uniform("view", &view).bind("rays", rays).dispatch(count)
}
