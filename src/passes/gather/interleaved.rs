//! Irradiance of nodes from the samples that they and their neighbours see.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::passes::refine::nodes::{Level, Nodes};

/// Twin of `InterleavedParams` in `shaders/passes/gather/interleaved.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct InterleavedParams {
    /// First node of the level.
    pub first: u32,
    /// Samples that a node asks.
    pub strata: u32,
    /// Words of bits a node; 0: everything is seen.
    pub words: u32,
    /// Sets of samples: 1 or 4.
    pub classes: u32,
    /// Of the lit side, or a spot's axis.
    pub normal: [f32; 3],
    /// Of a spot; -2 for an area light.
    pub cos_cutoff: f32,
    /// 1: both sides emit.
    pub two_sided: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// Adds one light to the nodes of a level; `bits` as [`crate::passes::visibility::reuse::Reuse`] left them, or none
/// where everything is seen.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    nodes: &Nodes,
    level: Level,
    light: &LightSamples,
    bits: Option<&Buffer<u32>>,
) -> Result<()> {
    let nothing: Buffer<u32> = context.resources.buffer("no_bits", 2)?;
    let params = InterleavedParams {
        first: level.first as u32,
        strata: light.strata,
        words: bits.map_or(0, |_| light.strata.div_ceil(32)),
        classes: light.classes,
        normal: light.normal.to_array(),
        cos_cutoff: light.cos_cutoff,
        two_sided: light.two_sided.into(),
        pad0: 0,
        pad1: 0,
        pad2: 0,
    };
    let patterns = f64::from(u8::from(light.patterns > light.classes));
    let kernel = context.kernel_with("gather/interleaved", "main", &[("PATTERNS", patterns)])?;
    let pyramid = nodes.pyramid.at(level.level);
    let pass = context.recorder.pass("interleaved", &kernel).uniform("params", &params).uniform("pyramid", &pyramid);
    let pass = pass.bind("node_rows", &nodes.rows).bind("node_at", &nodes.at);
    let pass = pass.bind("node_receivers", &nodes.receivers).bind("node_bits", bits.unwrap_or(&nothing));
    let pass = pass.bind("light_points", &light.points).bind("light_radiance", &light.radiance);
    let work = 400.0 + 20.0 * f64::from(light.strata * light.classes);
    pass.bind("node_irradiance", &nodes.irradiance).dispatch_cut(level.count, work)
}
