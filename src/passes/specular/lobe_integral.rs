//! The unshadowed light of an area light in the lobe of each pixel.

use super::LobeLight;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};

/// Writes reflectance and exponent of each pixel.
///
/// # Errors
/// Those of the device.
pub fn surfaces(context: &mut Context<'_, '_>, gbuffer: &GBuffer, surface: &Buffer<[f32; 4]>) -> Result<()> {
    let kernel = context.kernel("specular/lobe_integral", "surfaces")?;
    let pass = context.recorder.pass("lobe_integral", &kernel).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_albedo", &gbuffer.albedo).bind("instance_lobes", context.scene.lobes()?);
    pass.bind("lobe_surface", surface).dispatch(context.view.pixels())
}

/// Writes what a light adds to each pixel if nothing is in between.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    source: &LobeLight,
    surface: &Buffer<[f32; 4]>,
    lit: &Buffer<[f32; 4]>,
) -> Result<()> {
    let picture = f64::from(u8::from(source.picture()));
    let kernel = context.kernel_with("specular/lobe_integral", "main", &[("PICTURE", picture)])?;
    let nothing: Buffer<[f32; 4]> = context.resources.buffer("nothing", 1)?;
    let sums = context.scene.light_sums(source.light as usize).unwrap_or(&nothing);
    let pass = context.recorder.pass("lobe_integral", &kernel).uniform("source", source);
    let pass = pass.uniform("view", &context.view).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("light_sums", sums);
    let pass = pass.bind("lobe_surface", surface).bind("lobe_light", lit);
    pass.dispatch_cut(context.view.pixels(), if source.picture() { 8000.0 } else { 2000.0 })
}
