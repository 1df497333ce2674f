//! Incremental refinement: which nodes are split, and the fragments that are left at the end.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::refine::nodes::{Level, Nodes};
use crate::passes::refine::one_pass::Fragments;
use crate::passes::refine::pyramid::Texels;
use crate::passes::{Context, GBuffer};

/// Twin of `IncrementalParams` in `shaders/passes/refine/incremental.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct IncrementalParams {
    /// First node of the level.
    pub first: u32,
    /// Nodes of the level.
    pub count: u32,
    /// Words of visibility bits a node.
    pub words: u32,
    /// Bits in doubt from which on a node is split.
    pub least_bits: u32,
    /// Difference of irradiance over the mean.
    pub threshold: f32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

fn params(level: Level) -> IncrementalParams {
    IncrementalParams { first: level.first as u32, count: level.count as u32, ..IncrementalParams::zeroed() }
}

/// The mean irradiance of the coarsest level, which the illumination threshold is relative to.
///
/// # Errors
/// Those of the device.
pub fn mean(context: &mut Context<'_, '_>, nodes: &Nodes, level: Level) -> Result<Buffer<[f32; 4]>> {
    let mean = context.resources.buffer("mean_irradiance", 1)?;
    let kernel = context.kernel("refine/incremental", "mean")?;
    let pass = context.recorder.pass("incremental", &kernel).uniform("params", &params(level));
    pass.bind("node_irradiance", &nodes.irradiance).bind("mean_irradiance", &mean).dispatch_groups(1)?;
    Ok(mean)
}

/// Splits nodes around which `least` bits or more of a light are in doubt.
///
/// # Errors
/// Those of the device.
pub fn bits(
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    node_bits: &Buffer<u32>,
    [words, least]: [u32; 2],
) -> Result<()> {
    let kernel = context.kernel("refine/incremental", "bits")?;
    let params = IncrementalParams { words, least_bits: least, ..params(level) };
    let pyramid = nodes.pyramid.at(level.level);
    let pass = context.recorder.pass("incremental", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("node_rows", &nodes.rows).bind("node_at", &nodes.at).bind("node_bits", node_bits);
    pass.dispatch(level.count)
}

/// Splits nodes whose irradiance differs from a neighbour's by more than `threshold` times the mean.
///
/// # Errors
/// Those of the device.
pub fn differ(
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    mean: &Buffer<[f32; 4]>,
    threshold: f64,
) -> Result<()> {
    let kernel = context.kernel("refine/incremental", "differ")?;
    let params = IncrementalParams { threshold: threshold as f32, ..params(level) };
    let pyramid = nodes.pyramid.at(level.level);
    let pass = context.recorder.pass("incremental", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("node_rows", &nodes.rows).bind("node_at", &nodes.at);
    let pass = pass.bind("node_receivers", &nodes.receivers).bind("node_irradiance", &nodes.irradiance);
    pass.bind("mean_irradiance", mean).dispatch(level.count)
}

/// Level and reason of every pixel, and which texels are fragments: those of nodes that nothing split.
///
/// # Errors
/// Those of the device.
pub fn choose(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    nodes: &Nodes,
    texels: Texels,
    state: &Buffer<u32>,
) -> Result<Fragments> {
    let (pixels, places) = (context.view.pixels(), context.view.tiled as usize);
    let fragments = Fragments {
        level_map: context.resources.buffer("level_map", pixels)?,
        reason_map: context.resources.buffer("reason_map", pixels)?,
        at: context.resources.buffer("fragment_at", nodes.pyramid.texels())?,
        texels,
        extras: None,
    };
    context.recorder.clear(&fragments.at)?;
    let kernel = context.kernel("refine/incremental", "choose")?;
    let pass = context.recorder.pass("incremental", &kernel).uniform("pyramid", &nodes.pyramid);
    let pass = pass.bind("g_normal", &gbuffer.normal).bind("texel_state", state);
    let pass = pass.bind("node_rows", &nodes.rows).bind("node_at", &nodes.at);
    let pass = pass.bind("level_map", &fragments.level_map).bind("reason_map", &fragments.reason_map);
    pass.bind("fragment_at", &fragments.at).dispatch(places)?;
    Ok(fragments)
}
