//! Interpolation by radial basis functions in a single pass.

use super::{rbf_paper, rbf_samples};
use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::refine::compact;
use crate::passes::refine::one_pass::Fragments;
use crate::passes::{Context, GBuffer};

/// Writes the irradiance of every pixel.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let samples = rbf_samples::record(context, gbuffer, fragments, own)?;
    let pyramid = fragments.texels.pyramid;
    if context.settings.is("rbf_form", "paper") {
        return rbf_paper::record(context, fragments, own, &samples, irradiance);
    }
    let most = f64::from(context.settings.int("rbf_samples"));
    let kernel = context.kernel_with("upsample/rbf", "main", &[("SAMPLES", most)])?;
    let pass = context.recorder.pass("rbf", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.bind("level_map", &fragments.level_map).bind("fragment_at", &fragments.at);
    let pass = pass.bind("fragment_irradiance", own).bind("border_samples", &samples);
    pass.bind("direct_irradiance", irradiance).dispatch(context.view.tiled as usize)?;
    (1..=pyramid.coarsest.min(2)).try_for_each(|level| small(context, gbuffer, fragments, own, irradiance, level))
}

/// Pixels of fragments of level 1 or 2, from a list: few, and asking most.
fn small(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    fragments: &Fragments,
    own: &Buffer<[f32; 4]>,
    irradiance: &Buffer<[f32; 4]>,
    level: u32,
) -> Result<()> {
    let (pixels, pyramid) = (context.view.pixels(), fragments.texels.pyramid);
    let list: Buffer<u32> = context.resources.buffer("small_pixels", pixels)?;
    let arguments = context.resources.buffer_for("small_arguments", 4, Usage::Indirect)?;
    compact::record(context, "rbf", &fragments.level_map, pixels, u32::MAX, level, &list, &arguments)?;
    let most = f64::from(context.settings.int("rbf_samples"));
    let kernel = context.kernel_with("upsample/rbf", "small", &[("SAMPLES", most)])?;
    let pass = context.recorder.pass("rbf", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.uniform("view", &context.view).bind("level_map", &fragments.level_map);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("fragment_at", &fragments.at);
    let pass = pass.bind("fragment_irradiance", own).bind("small_pixels", &list);
    pass.bind("direct_irradiance", irradiance).dispatch_indirect(&arguments, 0)
}
