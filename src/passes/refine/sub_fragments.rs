//! Sub-fragment visibility tests: shading points of the four texels below each node, and which nodes they split.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::nodes::{Level, Nodes};
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Sub-fragments of a node.
pub const SUBS: usize = 4;

/// Twin of `SubFragmentsParams` in `shaders/passes/refine/sub_fragments.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SubFragmentsParams {
    /// First node of the level.
    pub first: u32,
    /// Interleaved sets of samples: 1 or 4.
    pub classes: u32,
    /// 1: the four ask one set, 0: each its own.
    pub together: u32,
    /// Words of bits a sub-fragment.
    pub words: u32,
    /// Samples on which they differ, from which on a node is split.
    pub least_bits: u32,
    /// Samples between two, up to which they are not split with it.
    pub most_apart: u32,
    /// 1: the difference of how many are seen counts, 0: how many change.
    pub counts: u32,
    /// 1: what faces nothing lies outside of a cone, and sees nothing.
    pub hard: u32,
}

impl SubFragmentsParams {
    /// As the settings say, for one level.
    pub fn new(context: &Context<'_, '_>, level: Level) -> Self {
        let settings = context.settings;
        let together = settings.is("sub_fragment_samples", "same");
        Self {
            first: level.first as u32,
            classes: settings.int("interleave").pow(2),
            together: together.into(),
            most_apart: settings.float("gradient_threshold").map_or(u32::MAX, |most| most as u32),
            counts: settings.is("gradient_metric", "counts").into(),
            ..Self::zeroed()
        }
    }
}

/// Writes [`SUBS`] shading points for each node of a level above 0.
///
/// # Errors
/// Those of the device.
pub fn points(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    nodes: &Nodes,
    level: Level,
    state: &Buffer<u32>,
    receivers: &Buffer<Receiver>,
) -> Result<()> {
    let kernel = context.kernel("refine/sub_fragments", "points")?;
    let (params, pyramid) = (SubFragmentsParams::new(context, level), nodes.pyramid.at(level.level));
    let pass = context.recorder.pass("sub_fragments", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("texel_state", state).bind("g_position", &gbuffer.position);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
    let pass = pass.bind("node_rows", &nodes.rows).bind("node_receivers", &nodes.receivers);
    pass.bind("sub_receivers", receivers).dispatch(SUBS * level.count)
}

/// Marks the nodes of a level whose sub-fragments (`receivers`) see different samples of one light, `least` or more.
///
/// # Errors
/// Those of the device.
pub fn test(
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    receivers: &Buffer<Receiver>,
    sub_bits: &Buffer<u32>,
    light: &LightSamples,
    least: u32,
) -> Result<()> {
    let kernel = context.kernel("refine/sub_fragments", "test")?;
    let (words, hard) = (light.strata.div_ceil(32), u32::from(!light.is_area()));
    let params = SubFragmentsParams { words, least_bits: least, hard, ..SubFragmentsParams::new(context, level) };
    let pyramid = nodes.pyramid.at(level.level);
    let pass = context.recorder.pass("sub_fragments", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("node_rows", &nodes.rows).bind("sub_receivers", receivers);
    pass.bind("sub_bits", sub_bits).dispatch(level.count)
}
