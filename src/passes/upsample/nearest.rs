//! Every pixel takes its fragment's irradiance.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::refine::one_pass::Fragments;

/// Writes the irradiance of every pixel.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("upsample/nearest", "main")?;
    let pass = context.recorder.pass("nearest", &kernel).uniform("pyramid", &fragments.texels.pyramid);
    let pass = pass.bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
    let pass = pass.bind("level_map", &fragments.level_map).bind("direct_irradiance", irradiance);
    pass.dispatch(context.view.pixels())
}
