//! Interpolation from level to level that never crosses an edge.

use crate::error::Result;
use crate::gpu::Buffer;
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
    let texels = &fragments.texels;
    let pyramid = texels.pyramid;
    let illumination = super::levels(context, fragments)?;
    let guides: Buffer<[f32; 4]> = context.resources.buffer("upsample_guides", 2 * pyramid.texels_above())?;
    if pyramid.coarsest > 0 {
        let kernel = context.kernel("upsample/edge_aware", "guide")?;
        let pass = context.recorder.pass("edge_aware", &kernel).uniform("pyramid", &pyramid);
        let pass = pass.uniform("view", &context.view).bind("means", &texels.means);
        pass.bind("guides", &guides).dispatch(pyramid.texels_above())?;
    }
    let kernel = context.kernel("upsample/edge_aware", "level")?;
    for level in (1..=pyramid.coarsest).rev() {
        let pass = context.recorder.pass("edge_aware", &kernel).uniform("pyramid", &pyramid.at(level));
        let pass = pass.bind("means", &texels.means).bind("guides", &guides);
        let pass = pass.bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
        pass.bind("illumination", &illumination).dispatch(pyramid.levels[level as usize][3] as usize)?;
    }
    let kernel = context.kernel("upsample/edge_aware", "pixels")?;
    let pass = context.recorder.pass("edge_aware", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.bind("guides", &guides).bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("illumination", &illumination);
    pass.bind("direct_irradiance", irradiance).dispatch(context.view.pixels())
}
