//! Fragments of the lobes.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::one_pass::{self, Listed};
use crate::passes::{Context, GBuffer};

/// Twin of `LobeLevelsParams` in `shaders/passes/lobes/lobe_levels.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LobeLevelsParams {
    /// Lights of the table.
    pub lights: u32,
    /// Texels of all levels in use.
    pub texels: u32,
    /// Share of the lobe's half-width; negative: no lobe metric.
    pub threshold: f32,
    /// Unused.
    pub pad: u32,
}

/// Chooses and lists them.
///
/// # Errors
/// Those of the device.
pub fn record(context: &mut Context<'_, '_>, gbuffer: &GBuffer) -> Result<Listed> {
    let (texels, before) = one_pass::states(context, gbuffer)?;
    let pyramid = texels.pyramid;
    let state: Buffer<u32> = context.resources.buffer("lobe_state", pyramid.texels())?;
    let params = LobeLevelsParams {
        lights: context.prepared.lights as u32,
        texels: pyramid.texels() as u32,
        threshold: context.settings.float("lobe_threshold").map_or(-1.0, |t| t as f32),
        pad: 0,
    };
    let kernel = context.kernel("lobes/lobe_levels", "begin")?;
    let pass = context.recorder.pass("lobe_levels", &kernel).bind("texel_state", &before);
    pass.bind("lobe_state", &state).dispatch(pyramid.texels())?;
    let kernel = context.kernel("lobes/lobe_levels", "mark")?;
    let lobes = context.scene.lobes()?;
    let pass = context.recorder.pass("lobe_levels", &kernel).uniform("params", &params);
    let pass = pass.uniform("pyramid", &pyramid).uniform("view", &context.view);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    let pass = pass.bind("g_albedo", &gbuffer.albedo).bind("instance_lobes", lobes);
    let pass = pass.bind("lights", context.scene.lights()?).bind("texel_state", &before).bind("marks", &state);
    pass.dispatch(context.view.pixels())?;
    one_pass::choose(context, gbuffer, texels, &state, "specular_", false)
}
