//! Shading points of a range of fragments.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples;
use crate::passes::refine::one_pass::Listed;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Twin of `FragmentReceiversParams` in `shaders/passes/gather/fragment_receivers.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct FragmentReceiversParams {
    /// First fragment of the list.
    pub first: u32,
    /// Sets of sample points.
    pub patterns: u32,
    /// The user's seed.
    pub seed: u32,
    /// Unused.
    pub pad: u32,
}

/// Writes the receivers of `count` fragments from number `first` on; each one's `pixel` is its fragment's number.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    listed: &Listed,
    first: usize,
    count: usize,
    receivers: &Buffer<Receiver>,
) -> Result<()> {
    let kernel = context.kernel("gather/fragment_receivers", "main")?;
    let params = FragmentReceiversParams {
        first: first as u32,
        patterns: light_samples::patterns(context),
        seed: context.settings.int("seed"),
        pad: 0,
    };
    let pass = context.recorder.pass("fragment_receivers", &kernel).uniform("params", &params);
    let pass = pass.uniform("pyramid", &listed.fragments.texels.pyramid).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("fragment_list", &listed.list).bind("fragment_flags", &listed.flags);
    pass.bind("receivers", receivers).bind("fragment_at", &listed.fragments.at).dispatch(count)
}
