//! The samples that the pixels of each large fragment choose from.

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::extra_samples::{Extras, LARGE, SAMPLES};
use crate::passes::refine::one_pass::Fragments;
use crate::passes::{Context, GBuffer};

/// Places for the samples of a fragment; twin of `SLOTS` in `shaders/common/border_samples.wgsl`.
const SLOTS: usize = 32;

/// Lists the samples of all large fragments, [`SLOTS`] for each texel from level [`LARGE`] on.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
) -> Result<Buffer<[u32; 4]>> {
    let pyramid = fragments.texels.pyramid;
    let texels = pyramid.texels() - pyramid.first_texel(LARGE);
    let samples = context.resources.buffer("border_samples", (SLOTS * texels).max(1))?;
    if texels == 0 {
        return Ok(samples);
    }
    let extras = fragments.extras.as_ref().map(|extras| spread(context, extras)).transpose()?;
    let overrides = [("EXTRAS", f64::from(u8::from(extras.is_some())))];
    let kernel = context.kernel_with("upsample/rbf_samples", "main", &overrides)?;
    let pass = context.recorder.pass("rbf_samples", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.uniform("view", &context.view).bind("level_map", &fragments.level_map);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("fragment_at", &fragments.at);
    // Where there are no extra samples their light is not read.
    let pass = pass.bind("fragment_irradiance", own).bind("extra_light", extras.as_ref().unwrap_or(own));
    pass.bind("border_samples", &samples).dispatch(texels)?;
    Ok(samples)
}

/// Extra samples by the texel that they belong to.
fn spread(context: &mut Context<'_, '_>, extras: &Extras) -> Result<Buffer<[f32; 4]>> {
    let rows = SAMPLES * extras.at.len();
    let spread = context.resources.buffer("extra_light", rows)?;
    let kernel = context.kernel("upsample/rbf_samples", "spread")?;
    let pass = context.recorder.pass("rbf_samples", &kernel).bind("extra_at", &extras.at);
    pass.bind("extra_irradiance", &extras.irradiance).bind("extra_rows", &spread).dispatch(rows)?;
    Ok(spread)
}
