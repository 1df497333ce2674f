//! What the lobes of surfaces reflect of a light, sample by sample.

use super::gather::{GatherParams, Gathered};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};

/// The image that specular passes add to, empty.
///
/// # Errors
/// Those of the device.
pub fn target(context: &mut Context<'_, '_>) -> Result<Buffer<[f32; 4]>> {
    let specular = context.resources.buffer("specular_radiance", context.view.pixels())?;
    context.recorder.clear(&specular)?;
    Ok(specular)
}

/// Adds what one light's visible samples send to the eye by the lobe of each receiver.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    work: &Gathered<'_>,
    specular: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("gather/specular", "main")?;
    let light = work.light;
    let params = GatherParams { strata: light.strata, words: work.words(), light: light.light, pad: 0 };
    let pass = context.recorder.pass("specular", &kernel).uniform("params", &params).uniform("view", &context.view);
    let pass = pass.bind("receivers", work.receivers).bind("visibility", work.visibility);
    let pass = pass.bind("light_points", &light.points).bind("light_radiance", &light.radiance);
    let pass = pass.bind("lights", context.scene.lights()?).bind("instance_lobes", context.scene.lobes()?);
    let pass = pass.bind("g_albedo", &gbuffer.albedo).bind("specular_radiance", specular);
    pass.dispatch_cut(work.count, 200.0 + 6.0 * f64::from(light.strata))
}
