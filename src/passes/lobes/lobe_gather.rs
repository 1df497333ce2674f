//! What the lobe of each fragment reflects of a light, and of each pixel.

use bytemuck::{Pod, Zeroable};

use super::Work;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};

/// Twin of `LobeGatherParams` in `shaders/passes/lobes/lobe_gather.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LobeGatherParams {
    /// First fragment.
    pub first: u32,
    /// Samples of the light.
    pub strata: u32,
    /// Words of bits a fragment.
    pub words: u32,
    /// 1: both sides emit.
    pub two_sided: u32,
    /// Of the lit side.
    pub normal: [f32; 3],
    /// Places in a lobe.
    pub places: u32,
}

/// Adds the light to the fragments of a piece.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(context: &mut Context<'_, '_>, work: &Work<'_>, lit: &Buffer<[f32; 4]>) -> Result<()> {
    let light = work.light;
    let params = LobeGatherParams {
        first: work.first as u32,
        strata: light.strata,
        words: light.shadow_light().words() as u32,
        two_sided: light.two_sided.into(),
        normal: light.normal.to_array(),
        places: work.places() as u32,
    };
    let kernel = context.kernel("lobes/lobe_gather", "sum")?;
    let pass = context.recorder.pass("lobe_gather", &kernel).uniform("params", &params).uniform("view", &context.view);
    let pass = pass.bind("receivers", work.receivers).bind("points", &light.points);
    let pass = pass.bind("light_radiance", &light.radiance).bind("asked", work.asked);
    let pass = pass.bind("lobe_weights", work.weights).bind("lobe_seen", work.seen);
    pass.bind("lobe_fragments", lit).dispatch_cut(work.count, 300.0 + 6.0 * f64::from(light.strata))
}

/// Adds colour times light to the pixels.
///
/// # Errors
/// Those of the device.
pub(super) fn apply(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    image: &Buffer<[f32; 4]>,
    specular: &Buffer<[f32; 4]>,
) -> Result<()> {
    let kernel = context.kernel("lobes/lobe_gather", "apply")?;
    let pass = context.recorder.pass("lobe_gather", &kernel).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_albedo", &gbuffer.albedo).bind("instance_lobes", context.scene.lobes()?);
    pass.bind("lobe_image", image).bind("specular_radiance", specular).dispatch(context.view.pixels())
}
