//! The share of its irradiance from virtual lights that each fragment sees.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::one_pass::Listed;
use crate::passes::refine::pyramid::Pyramid;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Twin of `VplVisibleParams` in `shaders/passes/indirect/vpl_visible.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct VplVisibleParams {
    /// Of a receiver.
    pub rays: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Sums up the answers of `count` receivers: two rows each, what arrives and all that was asked.
///
/// # Errors
/// Those of the device.
pub fn sum_up(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    (occluded, weights): (&Buffer<u32>, &Buffer<[f32; 4]>),
    sums: &Buffer<[f32; 4]>,
) -> Result<()> {
    let params = VplVisibleParams { rays: context.settings.int("indirect_rays"), pad0: 0, pad1: 0, pad2: 0 };
    let kernel = context.kernel("indirect/vpl_visible", "sum_up")?;
    let pass = context.recorder.pass("vpl_visible", &kernel).uniform("params", &params);
    let pass = pass.bind("receivers", receivers).bind("occluded", occluded).bind("ray_weights", weights);
    pass.bind("seen_sums", sums).dispatch(count)
}

/// Multiplies the irradiance of `count` fragments, or of every pixel, by what is seen of it there and around.
///
/// # Errors
/// Those of the device.
pub fn apply(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    listed: Option<&Listed>,
    count: usize,
    sums: &Buffer<[f32; 4]>,
    irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    let overrides = [("PIXELS", f64::from(u8::from(listed.is_none())))];
    let kernel = context.kernel_with("indirect/vpl_visible", "apply", &overrides)?;
    let nothing: Buffer<u32> = context.resources.buffer("no_fragments", 1)?;
    let pyramid = listed.map_or_else(|| Pyramid::new(&context.view, 0, 0), |listed| listed.fragments.texels.pyramid);
    let pass = context.recorder.pass("vpl_visible", &kernel).uniform("pyramid", &pyramid);
    let pass = pass.uniform("view", &context.view).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("sums", sums).bind("irradiance", irradiance);
    let pass = pass.bind("fragment_list", listed.map_or(&nothing, |listed| &listed.list));
    let pass = pass.bind("level_map", listed.map_or(&nothing, |listed| &listed.fragments.level_map));
    pass.bind("fragment_at", listed.map_or(&nothing, |listed| &listed.fragments.at)).dispatch(count)
}
