//! From fragments to pixels.

pub mod bilateral;
pub mod bilinear;
pub mod edge_aware;
pub mod nearest;
pub mod rbf;
pub mod rbf_paper;
pub mod rbf_samples;
pub mod vpl_pixels;

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::one_pass::Fragments;
use crate::passes::{Context, GBuffer};

/// Irradiance a pixel from `own`, that of each fragment of the list, as the setting `upsample` says.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
) -> Result<Buffer<[f32; 4]>> {
    let irradiance = context.resources.buffer("direct_irradiance", context.view.pixels())?;
    record_into(context, gbuffer, fragments, own, &irradiance)?;
    Ok(irradiance)
}

/// As [`record`], into an image of the caller's.
///
/// # Errors
/// Those of the device.
pub fn record_into(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    if context.settings.is("upsample", "edge-aware") {
        edge_aware::record(context, gbuffer, fragments, own, irradiance)
    } else if context.settings.is("upsample", "rbf") {
        rbf::record(context, gbuffer, fragments, own, irradiance)
    } else if context.settings.is("upsample", "bilinear") {
        bilinear::record(context, fragments, own, irradiance)
    } else {
        nearest::record(context, fragments, own, irradiance)
    }
}

/// The images of levels 1 and above.
fn levels(context: &mut Context<'_, '_>, fragments: &Fragments) -> Result<Buffer<[f32; 4]>> {
    context.resources.buffer("illumination", fragments.texels.pyramid.texels_above())
}
