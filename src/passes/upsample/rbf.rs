//! Interpolation by radial basis functions in a single pass.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::one_pass::Fragments;
use crate::passes::{Context, GBuffer};

/// Twin of `RbfParams` in `shaders/passes/upsample/rbf.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct RbfParams {
    /// Fragments that each pixel takes light from, at most 4.
    pub samples: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

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
    let params = RbfParams { samples: context.settings.int("rbf_samples"), pad0: 0, pad1: 0, pad2: 0 };
    let paper = context.settings.is("rbf_form", "paper");
    let kernel = context.kernel("upsample/rbf", if paper { "paper" } else { "main" })?;
    let pyramid = fragments.texels.pyramid;
    let pass = context.recorder.pass("rbf", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.uniform("view", &context.view).bind("level_map", &fragments.level_map);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_geometric", &gbuffer.geometric).bind("fragment_at", &fragments.at);
    let pass = pass.bind("fragment_irradiance", own).bind("direct_irradiance", irradiance);
    pass.dispatch(context.view.pixels())
}
