//! Plain bilinear interpolation from level to level.

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
    let pyramid = fragments.texels.pyramid;
    let illumination = super::levels(context, fragments)?;
    let pull = context.kernel("upsample/bilinear", "pull")?;
    for level in 1..=pyramid.coarsest {
        let pass = context.recorder.pass("bilinear", &pull).uniform("pyramid", &pyramid.at(level));
        let pass = pass.bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
        pass.bind("illumination", &illumination).dispatch(pyramid.levels[level as usize][3] as usize)?;
    }
    let push = context.kernel("upsample/bilinear", "push")?;
    for level in (1..pyramid.coarsest).rev() {
        let pass = context.recorder.pass("bilinear", &push).uniform("pyramid", &pyramid.at(level));
        pass.bind("illumination", &illumination).dispatch(pyramid.levels[level as usize][3] as usize)?;
    }
    let pixels = context.kernel("upsample/bilinear", "pixels")?;
    let pass = context.recorder.pass("bilinear", &pixels).uniform("pyramid", &pyramid);
    let pass = pass.bind("fragment_at", &fragments.at).bind("fragment_irradiance", own);
    let pass = pass.bind("illumination", &illumination).bind("level_map", &fragments.level_map);
    pass.bind("direct_irradiance", irradiance).dispatch(context.view.pixels())
}
