//! Incremental visibility: bits on which the level above agrees are taken from it, the others are asked.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::{self, LightSamples};
use crate::passes::refine::nodes::{Level, Nodes};
use crate::passes::visibility::shadow::ShadowLight;

/// Words of samples that a node may ask; twin of the arrays in `shaders/passes/visibility/reuse.wgsl`.
pub const MOST_WORDS: usize = 32;

/// Twin of `ReuseParams` in `shaders/common/facing_bits.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ReuseParams {
    /// Of the lit side.
    pub light_normal: [f32; 3],
    /// 1: both sides emit.
    pub two_sided: u32,
    /// Unit axis of the cone, away from the light.
    pub cone_axis: [f32; 3],
    /// Cosine of the cone's half-angle; -1 and below: no cone.
    pub cos_cutoff: f32,
    /// First node of the level.
    pub first: u32,
    /// Samples that a node asks.
    pub strata: u32,
    /// Words of bits a node.
    pub words: u32,
    /// 0: every sample is asked.
    pub reuse: u32,
    /// Of the light, or a spot's position.
    pub corner: [f32; 3],
    /// Interleaved sets of samples: 1 or 4.
    pub classes: u32,
    /// Scene units; zero for a spot, as `edge_v`.
    pub edge_u: [f32; 3],
    /// 1: sub-fragments ask one set, 0: each its own.
    pub together: u32,
    /// Scene units.
    pub edge_v: [f32; 3],
    /// First node of the level above.
    pub above: u32,
}

/// A level at work: its nodes, what they know of a light, and what they ask.
pub struct Reuse<'r> {
    /// All nodes.
    pub nodes: &'r Nodes,
    /// Those at work.
    pub level: Level,
    /// Whose samples.
    pub light: &'r LightSamples,
    /// Twice [`LightSamples::words`] a node: samples that face it, samples that it sees.
    pub bits: &'r Buffer<u32>,
    /// [`LightSamples::words`] a node.
    pub asked: &'r Buffer<u32>,
}

/// What is asked of the samples of a light that `shadow` names.
pub fn params(context: &Context<'_, '_>, light: &LightSamples, shadow: &ShadowLight<'_>, level: Level) -> ReuseParams {
    let [corner, edge_u, edge_v] = match light_samples::edges(context, light.light as usize) {
        edges if light.is_area() => edges,
        [position, ..] => [position, [0.0; 3], [0.0; 3]],
    };
    ReuseParams {
        light_normal: shadow.light_normal,
        two_sided: shadow.two_sided.into(),
        cone_axis: shadow.cone_axis,
        cos_cutoff: shadow.cos_cutoff,
        first: level.first as u32,
        strata: shadow.strata,
        words: shadow.words() as u32,
        reuse: 0,
        corner,
        classes: light.classes,
        edge_u,
        together: 0,
        edge_v,
        above: 0,
    }
}

impl Reuse<'_> {
    fn record(&self, context: &mut Context<'_, '_>, entry: &str) -> Result<()> {
        let shadow = self.light.shadow_light();
        // A spot asks one ray a node, and its shadows have no penumbra that would reach a coarser node: nothing to save.
        let reuse = context.settings.is("visibility_reuse", "incremental") && self.light.is_area();
        let mut params = params(context, self.light, &shadow, self.level);
        params.reuse = reuse.into();
        let kernel = context.kernel("visibility/reuse", entry)?;
        let pass = context.recorder.pass("reuse", &kernel).uniform("params", &params);
        let pass = pass.bind("node_bits", self.bits).bind("asked", self.asked);
        if entry == "answer" {
            return pass.dispatch(self.level.count);
        }
        let pyramid = self.nodes.pyramid.at(self.level.level);
        let pass = pass.uniform("pyramid", &pyramid).bind("node_rows", &self.nodes.rows);
        let pass = pass.bind("node_at", &self.nodes.at).bind("node_receivers", &self.nodes.receivers);
        pass.bind("points", &self.light.points).dispatch_cut(self.level.count, 100.0 * f64::from(shadow.strata))
    }

    /// Writes what is known, and what is to be asked.
    ///
    /// # Errors
    /// Those of the device.
    pub fn ask(&self, context: &mut Context<'_, '_>) -> Result<()> {
        self.record(context, "ask")
    }

    /// Takes the answers in.
    ///
    /// # Errors
    /// Those of the device.
    pub fn answer(&self, context: &mut Context<'_, '_>) -> Result<()> {
        self.record(context, "answer")
    }
}
