//! Shading points of the lobes' fragments.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples;
use crate::passes::refine::one_pass::Listed;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Twin of `LobePointsParams` in `shaders/passes/lobes/lobe_points.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LobePointsParams {
    /// Sets of sample points.
    pub patterns: u32,
    /// The user's seed.
    pub seed: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Writes the receivers of all fragments, and where they are.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    listed: &Listed,
    count: usize,
) -> Result<Buffer<Receiver>> {
    let receivers = context.resources.buffer("lobe_receivers", count)?;
    let params = LobePointsParams {
        patterns: light_samples::patterns(context),
        seed: context.settings.int("seed"),
        pad0: 0,
        pad1: 0,
    };
    let kernel = context.kernel("lobes/lobe_points", "main")?;
    let pass = context.recorder.pass("lobe_points", &kernel).uniform("params", &params);
    let pass = pass.uniform("pyramid", &listed.fragments.texels.pyramid).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("fragment_list", &listed.list).bind("fragment_flags", &listed.flags);
    pass.bind("receivers", &receivers).bind("fragment_at", &listed.fragments.at).dispatch(count)?;
    let kernel = context.kernel("lobes/lobe_points", "exponents")?;
    let pass = context.recorder.pass("lobe_points", &kernel).bind("g_albedo", &gbuffer.albedo);
    pass.bind("instance_lobes", context.scene.lobes()?).bind("receivers", &receivers).dispatch(count)?;
    Ok(receivers)
}
