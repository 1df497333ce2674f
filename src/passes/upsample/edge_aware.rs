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
    let kernel = context.kernel("upsample/edge_aware", "level")?;
    for level in (1..=pyramid.coarsest).rev() {
        let pass = context.recorder.pass("edge_aware", &kernel).uniform("pyramid", &pyramid.at(level));
        let pass = pass.uniform("view", &context.view).bind("means", &texels.means);
        let pass = pass.bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
        pass.bind("illumination", &illumination).dispatch(pyramid.levels[level as usize][3] as usize)?;
    }
    let kernel = context.kernel("upsample/edge_aware", "pixels")?;
    let pass = context.recorder.pass("edge_aware", &kernel).uniform("pyramid", &pyramid).uniform("view", &context.view);
    let pass = pass.bind("means", &texels.means).bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("illumination", &illumination);
    pass.bind("direct_irradiance", irradiance).dispatch(context.view.pixels())
}
