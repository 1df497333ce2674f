//! Radial basis functions as the paper's text has them, for comparison.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::refine::one_pass::Fragments;

/// Writes the irradiance of every pixel; `samples` as [`super::rbf_samples::record`] listed them.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
    samples: &Buffer<[u32; 4]>,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("upsample/rbf_paper", "main")?;
    let pass = context.recorder.pass("rbf_paper", &kernel).uniform("pyramid", &fragments.texels.pyramid);
    let pass = pass.bind("level_map", &fragments.level_map).bind("fragment_at", &fragments.at);
    let pass = pass.bind("fragment_irradiance", own).bind("border_samples", samples);
    pass.bind("direct_irradiance", irradiance).dispatch(context.view.pixels())
}
